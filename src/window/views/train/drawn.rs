use std::{cell::OnceCell, sync::Arc};

use ndarray::Array2;

use crate::window::{
    shared::{RunResult, Shared},
    test_view::{Frame, Positions, RecordedTest, TestView},
};
use decoupler_core::{dataset::Dataset, evaluation::node_rms_mm};
use decoupler_files::figure::{TargetSurface, surface::Surface, value_pairs};

/// Drawings of the current test set. They are rebuilt only when it, the result, the snapshot or the target changes.
#[derive(Debug, Default)]
pub struct Drawn {
    /// The displayed snapshot.
    pub frames: Frames,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    /// Surfaces of a sample of a recording, where one goes through its targets: actual, decoded, and their difference.
    pub target_surfaces: Option<[Surface; 3]>,
    of: Option<Of>,
    snapshot: usize,
    /// The target of [`Self::pairs`]; none for the nodes of an array.
    target: Option<usize>,
    spread_mm: OnceCell<Vec<f64>>,
    pairs: OnceCell<Vec<(f64, f64)>>,
}

/// The displayed snapshot. For a recording the height of a node is the value of its target, in its unit.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Actual surface.
    pub actual: Frame,
    /// Surface decoded by the network, and its error (decoupled − actual).
    pub decoupled: Option<(Frame, Frame)>,
}

/// A test set and the outputs of the network on it.
#[derive(Debug)]
struct Of {
    test: Arc<Dataset>,
    answers: Option<Arc<Array2<f64>>>,
}

impl Of {
    fn is(&self, test: &Arc<Dataset>, answers: Option<&Arc<Array2<f64>>>) -> bool {
        let is_same_result = match (&self.answers, answers) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        };
        is_same_result && Arc::ptr_eq(&self.test, test)
    }
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
        match (shared.test(), shared.recorded_test()) {
            (Some(test), _) => self.follow_array(test, result, snapshot),
            (None, Some(test)) => self.follow_recording(test, result, snapshot, target),
            (None, None) => {
                *self = Self::default();
                snapshot
            }
        }
    }

    /// Discards drawings of another test set, result or snapshot. Returns true if everything is up to date.
    fn is_drawn(&mut self, test: &Arc<Dataset>, result: Option<&RunResult>, snapshot: usize) -> bool {
        let answers = result.map(|result| &result.answers);
        let is_same = self.of.as_ref().is_some_and(|of| of.is(test, answers));
        if is_same && self.snapshot == snapshot {
            return true;
        }
        if !is_same {
            let is_same_test = self.of.as_ref().is_some_and(|of| Arc::ptr_eq(&of.test, test));
            // The actual surface stays while the network is trained.
            let actual = if is_same_test && self.snapshot == snapshot {
                std::mem::take(&mut self.frames.actual)
            } else {
                Frame::default()
            };
            *self = Self {
                of: Some(Of {
                    test: Arc::clone(test),
                    answers: answers.cloned(),
                }),
                frames: Frames {
                    actual,
                    decoupled: None,
                },
                ..Self::default()
            };
        } else {
            self.frames = Frames::default();
        }
        self.snapshot = snapshot;
        false
    }

    fn follow_array(&mut self, test: &TestView, result: Option<&RunResult>, snapshot: usize) -> usize {
        let snapshot = test.nearest_snapshot(snapshot);
        if self.is_drawn(&test.set, result, snapshot) {
            return snapshot;
        }
        self.drops_percent = test.drops_percent(&test.readings_ohm(snapshot));
        if self.frames.actual.nodes_mm.is_empty() {
            self.frames.actual = test.frame(test.set.targets(), snapshot);
        }
        let actual = &self.frames.actual;
        self.frames.decoupled = result.map(|result| {
            let decoupled = match &result.frame {
                Some((of, frame)) if *of == snapshot => frame.clone(),
                _ => test.frame(result.answers.view(), snapshot),
            };
            let error = actual.error_of(&decoupled);
            (decoupled, error)
        });
        snapshot
    }

    fn follow_recording(
        &mut self,
        test: &RecordedTest,
        result: Option<&RunResult>,
        sample: usize,
        target: usize,
    ) -> usize {
        let sample = sample.min(test.set.samples().saturating_sub(1));
        let is_drawn = self.is_drawn(&test.set, result, sample);
        if self.target != Some(target) {
            (self.target, self.pairs) = (Some(target), OnceCell::new());
        }
        if let (false, Positions::Surface(through)) = (is_drawn, &test.positions) {
            self.draw_targets(test, through, result);
        }
        sample
    }

    /// Draws the surfaces through the displayed targets of the sample.
    fn draw_targets(&mut self, test: &RecordedTest, through: &TargetSurface, result: Option<&RunResult>) {
        let actual = test.set.targets().row(self.snapshot).to_vec();
        let decoded = result.map(|result| result.answers.row(self.snapshot).to_vec());
        let range = through.range_of(&test.ranges);
        let surfaces = through.surfaces(&actual, decoded.as_ref().unwrap_or(&actual), range);
        let [actual, found, error] = surfaces.each_ref().map(|surface| Frame {
            nodes_mm: Arc::clone(&surface.nodes),
            grid_mm: Arc::clone(&surface.values),
        });
        self.frames = Frames {
            actual,
            decoupled: decoded.map(|_| (found, error)),
        };
        self.target_surfaces = Some(surfaces);
    }

    fn result(&self) -> Option<(&Dataset, &Array2<f64>)> {
        let of = self.of.as_ref()?;
        Some((&of.test, of.answers.as_ref()?))
    }

    /// Returns the root mean square error of each node, once there is a result: [`node_rms_mm`].
    pub(super) fn spread_mm(&self) -> Option<&[f64]> {
        let (test, decoupled_mm) = self.result()?;
        Some(self.spread_mm.get_or_init(|| node_rms_mm(test, decoupled_mm)))
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
    use crate::window::{
        shared::RunView,
        test_view::TestSet,
        training_worker::{Began, RunId},
    };
    use decoupler_core::{
        dataset::SplitBy,
        evaluation::{Run, RunSettings},
    };

    fn result(run: &Run) -> RunResult {
        let decoupled_mm = run.decouple_test();
        RunResult {
            errors: run.errors_of(&decoupled_mm),
            network_alone: None,
            answers: Arc::new(decoupled_mm),
            charts: None,
            remarks: Vec::new(),
            coverage: Vec::new(),
            frame: None,
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
        shared.run = Some(RunView::new(Began {
            id: RunId::new(),
            asked: settings.into(),
            setup: settings.into(),
            search: None,
            problem: Arc::clone(run.problem()),
            weights: 0,
            test: TestSet::of(&run, SplitBy::Time).unwrap(),
            baselines: run.baselines().unwrap().clone(),
        }));
        let mut drawn = Drawn::default();
        drawn.follow(&shared, shared.result(), 0, 0);
        assert!(drawn.pairs().is_none() && drawn.frames.decoupled.is_none());

        shared.run.as_mut().unwrap().result = Some(result(&run));
        assert_eq!(drawn.follow(&shared, shared.result(), 0, 0), 0);
        let first = value_pairs(run.test(), &run.decouple_test(), None);
        assert_eq!(drawn.pairs(), Some(&first[..]));
        let (pairs, spread) = (drawn.pairs().unwrap().as_ptr(), drawn.spread_mm().unwrap().as_ptr());
        let actual = drawn.frames.actual.nodes_mm.clone();
        assert_eq!(
            drawn.follow(&shared, shared.result(), 1_000_000, 0),
            3,
            "the last of four snapshots"
        );
        assert_ne!(drawn.frames.actual.nodes_mm, actual);
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
