//! Drawings of the test set and of the displayed result on it, for both sources.

use std::{cell::OnceCell, sync::Arc};

use decoupler_core::{dataset::Dataset, evaluation::node_rms_mm};
use decoupler_files::figure::value_pairs;
use ndarray::Array2;

use crate::window::{
    shared::{RunResult, Shared},
    test_view::Drawing,
};

/// Drawings of the current test set. They are rebuilt only when it, the result, the snapshot or the target changes.
#[derive(Debug, Default)]
pub struct Drawn {
    /// The surfaces of the displayed snapshot; `None` where no surface goes through the targets of a recording.
    pub surfaces: Option<Drawing>,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    /// The test set, and the outputs of the network on it.
    test: Option<Arc<Dataset>>,
    answers: Option<Arc<Array2<f64>>>,
    snapshot: usize,
    /// The target of [`Self::pairs`]; none for the nodes of an array.
    target: Option<usize>,
    spread_mm: OnceCell<Vec<f64>>,
    pairs: OnceCell<Vec<(f64, f64)>>,
}

fn is_same<T>(one: Option<&Arc<T>>, other: Option<&Arc<T>>) -> bool {
    one.map(Arc::as_ptr) == other.map(Arc::as_ptr)
}

impl Drawn {
    /// Follows the current test set and the network's `result` on it, at the snapshot nearest to `snapshot`.
    /// `target` is the target whose values the charts of a recording show. Returns the snapshot.
    pub(super) fn follow(
        &mut self,
        shared: &Shared,
        result: Option<&RunResult>,
        snapshot: usize,
        target: usize,
    ) -> usize {
        let (array, recording) = (shared.test(), shared.recorded_test());
        let Some(test) = array.map(|array| &array.set).or(recording.map(|test| &test.set)) else {
            *self = Self::default();
            return snapshot;
        };
        let snapshots = array.map_or(test.samples(), |array| array.snapshots.len());
        let snapshot = snapshot.min(snapshots.saturating_sub(1));
        let (answers, target) = (result.map(|result| &result.answers), recording.map(|_| target));
        let is_same_test = is_same(self.test.as_ref(), Some(test));
        let is_same_result = is_same_test && is_same(self.answers.as_ref(), answers);
        if !is_same_result || self.target != target {
            self.pairs = OnceCell::new();
        }
        if !is_same_result {
            self.spread_mm = OnceCell::new();
        }
        if !is_same_result || self.snapshot != snapshot {
            let answers = answers.map(|answers| &**answers);
            self.drops_percent = array.and_then(|test| test.drops_percent(&test.readings_ohm(snapshot)));
            self.surfaces = match array {
                Some(test) => Some(test.drawing(answers, snapshot)),
                None => recording.and_then(|test| test.drawing(answers, snapshot)),
            };
        }
        (self.test, self.answers) = (Some(Arc::clone(test)), answers.cloned());
        (self.snapshot, self.target) = (snapshot, target);
        snapshot
    }

    fn result(&self) -> Option<(&Dataset, &Array2<f64>)> {
        Some((self.test.as_deref()?, self.answers.as_deref()?))
    }

    /// Returns the root mean square error of each node, once there is a result: [`node_rms_mm`].
    pub(super) fn spread_mm(&self) -> Option<&[f64]> {
        let (test, decoded_mm) = self.result()?;
        Some(self.spread_mm.get_or_init(|| node_rms_mm(test, decoded_mm)))
    }

    /// Actual and decoded values of the test set, once there is a result: z of the nodes of an array in millimetres, or the
    /// values of the displayed target in its unit.
    pub fn pairs(&self) -> Option<&[(f64, f64)]> {
        let (test, answers) = self.result()?;
        Some(self.pairs.get_or_init(|| value_pairs(test, answers, self.target)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::{shared::RunView, training_worker::RunId};
    use decoupler_core::evaluation::{Run, RunSettings};

    fn result(run: &Run) -> RunResult {
        let decoupled_mm = run.decouple_test();
        RunResult {
            errors: run.errors_of(&decoupled_mm),
            network_alone: None,
            answers: Arc::new(decoupled_mm),
            charts: None,
            remarks: Vec::new(),
            coverage: Vec::new(),
            best_epoch: 0,
            defect: None,
            epochs_run: 0,
            starts_ended: 0,
            wall_time: None,
            frame_time: None,
            is_idle: true,
            networks: Arc::new(run.network()),
        }
    }

    #[test]
    fn drawings_of_the_whole_test_set_are_made_once_per_result() {
        let mut settings = RunSettings {
            hidden: 2,
            ..RunSettings::default()
        };
        settings.simulation_mut().unwrap().sensor.scale = "2x3_2x9".parse().unwrap();
        (
            settings.simulation_mut().unwrap().samples,
            settings.simulation_mut().unwrap().test_samples,
        ) = (20, 8);
        let mut run = Run::prepare(settings).unwrap();
        let mut shared = Shared::new(true);
        shared.run = Some(RunView::begun(RunId::new(), &run, None, None).unwrap());
        let mut drawn = Drawn::default();
        drawn.follow(&shared, shared.result(), 0, 0);
        assert!(drawn.pairs().is_none() && drawn.surfaces.as_ref().unwrap().decoded.is_none());

        shared.run.as_mut().unwrap().result = Some(result(&run));
        assert_eq!(drawn.follow(&shared, shared.result(), 0, 0), 0);
        let first = value_pairs(run.test(), &run.decouple_test(), None);
        assert_eq!(drawn.pairs(), Some(&first[..]));
        let (pairs, spread) = (drawn.pairs().unwrap().as_ptr(), drawn.spread_mm().unwrap().as_ptr());
        let actual = drawn.surfaces.as_ref().unwrap().actual.nodes.clone();
        assert_eq!(
            drawn.follow(&shared, shared.result(), 1_000_000, 0),
            3,
            "the last of four snapshots"
        );
        assert_ne!(drawn.surfaces.as_ref().unwrap().actual.nodes, actual);
        assert_eq!(
            drawn.pairs().unwrap().as_ptr(),
            pairs,
            "not remade for another snapshot"
        );
        assert_eq!(drawn.spread_mm().unwrap().as_ptr(), spread);

        run.step();
        shared.run.as_mut().unwrap().result = Some(result(&run));
        drawn.follow(&shared, shared.result(), 3, 0);
        let next = value_pairs(run.test(), &run.decouple_test(), None);
        assert_ne!(next, first);
        assert_eq!(drawn.pairs(), Some(&next[..]));
    }
}
