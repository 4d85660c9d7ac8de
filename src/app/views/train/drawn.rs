use std::{cell::OnceCell, sync::Arc};

use ndarray::Array2;

use crate::{
    app::{
        shared::{RunResult, Shared},
        test_view::{Frame, TestView},
    },
    dataset::Dataset,
    evaluation::node_rms_mm,
    figure::z_pairs_mm,
};

/// Drawings of the test set on show. They are made anew only when that, the result or the snapshot changes.
#[derive(Debug, Default)]
pub struct Drawn {
    /// The snapshot on show.
    pub frames: Frames,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    of: Option<Of>,
    snapshot: usize,
    spread_mm: OnceCell<Vec<f64>>,
    pairs_mm: OnceCell<Vec<(f64, f64)>>,
}

/// The snapshot being drawn.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// As it is.
    pub actual: Frame,
    /// As the network finds it, and the difference (decoupled − actual).
    pub decoupled: Option<(Frame, Frame)>,
}

/// A test set and what the network makes of it.
#[derive(Debug)]
struct Of {
    test: Arc<Dataset>,
    decoupled_mm: Option<Arc<Array2<f64>>>,
}

impl Of {
    fn is(&self, test: &TestView, decoupled_mm: Option<&Arc<Array2<f64>>>) -> bool {
        let is_same_result = match (&self.decoupled_mm, decoupled_mm) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        };
        is_same_result && Arc::ptr_eq(&self.test, &test.set)
    }
}

impl Drawn {
    /// Follows the test set on show and the network's `result` on it, at the snapshot nearest to the one wished for.
    /// Returns that one.
    pub(super) fn follow(&mut self, shared: &Shared, result: Option<&RunResult>, snapshot: usize) -> usize {
        let Some(test) = shared.test() else { return snapshot };
        let snapshot = test.nearest_snapshot(snapshot);
        let decoupled_mm = result.map(|result| &result.answers);
        let is_same = self.of.as_ref().is_some_and(|of| of.is(test, decoupled_mm));
        if is_same && self.snapshot == snapshot {
            return snapshot;
        }
        let is_same_test = self.of.as_ref().is_some_and(|of| Arc::ptr_eq(&of.test, &test.set));
        // The surface of what is actual stays while the network learns.
        let actual = (is_same_test && self.snapshot == snapshot).then(|| std::mem::take(&mut self.frames.actual));
        if !is_same {
            *self = Self {
                of: Some(Of {
                    test: Arc::clone(&test.set),
                    decoupled_mm: decoupled_mm.cloned(),
                }),
                ..Self::default()
            };
        }
        self.snapshot = snapshot;
        self.drops_percent = test.drops_percent(&test.readings_ohm(snapshot));
        let actual = actual.unwrap_or_else(|| test.frame(test.set.targets(), snapshot));
        let decoupled = result.map(|result| match &result.frame {
            Some((of, frame)) if *of == snapshot => frame.clone(),
            _ => test.frame(result.answers.view(), snapshot),
        });
        self.frames = Frames {
            decoupled: decoupled.map(|decoupled| {
                let error = actual.error_of(&decoupled);
                (decoupled, error)
            }),
            actual,
        };
        snapshot
    }

    fn result(&self) -> Option<(&Dataset, &Array2<f64>)> {
        let of = self.of.as_ref()?;
        Some((&of.test, of.decoupled_mm.as_ref()?))
    }

    /// Returns the root mean square error of each node, once there is a result: [`node_rms_mm`].
    pub(super) fn spread_mm(&self) -> Option<&[f64]> {
        let (test, decoupled_mm) = self.result()?;
        Some(self.spread_mm.get_or_init(|| node_rms_mm(test, decoupled_mm)))
    }

    /// Actual and decoupled z of the nodes of the test set, in millimetres, once there is a result.
    pub fn pairs_mm(&self) -> Option<&[(f64, f64)]> {
        let (test, decoupled_mm) = self.result()?;
        Some(self.pairs_mm.get_or_init(|| z_pairs_mm(test, decoupled_mm)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        app::{
            shared::RunView,
            training_worker::{Began, RunId},
        },
        evaluation::{Run, SimulatedSettings},
    };

    fn result(run: &Run) -> RunResult {
        let decoupled_mm = run.decouple_test();
        RunResult {
            errors: run.errors_of(&decoupled_mm).unwrap(),
            decoupled_mm: Arc::new(decoupled_mm),
            frame: None,
            best_epoch: 0,
            flaw: None,
            epochs_run: 0,
            starts_ended: 0,
            wall_time: None,
            frame_time: None,
            is_standing: true,
            networks: Arc::new(run.network()),
        }
    }

    #[test]
    fn what_the_whole_test_set_is_looked_at_for_is_made_once_for_each_result() {
        let mut settings = SimulatedSettings {
            hidden: 2,
            ..SimulatedSettings::default()
        };
        settings.source.sensor.scale = "2x3_2x9".parse().unwrap();
        (settings.source.samples, settings.source.test_samples) = (20, 8);
        let mut run = Run::prepare(settings).unwrap();
        let mut shared = Shared::new(true);
        shared.run = Some(RunView::new(Began {
            id: RunId::new(),
            settings,
            weights: 0,
            test: TestView::of(&settings, Arc::clone(run.test())).unwrap(),
            baselines: *run.baselines().unwrap(),
        }));
        let mut drawn = Drawn::default();
        drawn.follow(&shared, shared.result(), 0);
        assert!(drawn.pairs_mm().is_none() && drawn.frames.decoupled.is_none());

        shared.run.as_mut().unwrap().result = Some(result(&run));
        assert_eq!(drawn.follow(&shared, shared.result(), 0), 0);
        let first = z_pairs_mm(run.test(), &run.decouple_test());
        assert_eq!(drawn.pairs_mm(), Some(&first[..]));
        let (pairs, spread) = (drawn.pairs_mm().unwrap().as_ptr(), drawn.spread_mm().unwrap().as_ptr());
        let actual = drawn.frames.actual.nodes_mm.clone();
        assert_eq!(
            drawn.follow(&shared, shared.result(), 1_000_000),
            3,
            "the last of four snapshots"
        );
        assert_ne!(drawn.frames.actual.nodes_mm, actual);
        assert_eq!(
            drawn.pairs_mm().unwrap().as_ptr(),
            pairs,
            "not made again for a snapshot"
        );
        assert_eq!(drawn.spread_mm().unwrap().as_ptr(), spread);

        run.step();
        shared.run.as_mut().unwrap().result = Some(result(&run));
        drawn.follow(&shared, shared.result(), 3);
        let next = z_pairs_mm(run.test(), &run.decouple_test());
        assert_ne!(next, first);
        assert_eq!(drawn.pairs_mm(), Some(&next[..]));
    }
}
