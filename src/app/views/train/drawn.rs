use std::{cell::OnceCell, sync::Arc};

use ndarray::Array2;

use crate::{
    app::{
        shared::Shared,
        test_view::{Frame, TestView},
    },
    dataset::Dataset,
    evaluation::node_rms_mm,
    figure::z_pairs_mm,
};

/// What is drawn of the test set on show. It is made anew only when that, the result or the snapshot changes.
#[derive(Debug, Default)]
pub struct Drawn {
    /// The snapshot on show.
    pub frames: Frames,
    of: Option<Of>,
    snapshot: usize,
    spread_mm: OnceCell<Vec<f64>>,
    pairs_mm: OnceCell<Vec<(f64, f64)>>,
}

/// The snapshot being drawn.
#[derive(Debug, Default)]
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
    /// Follows what is on show, at the snapshot nearest to the one wished for. Returns that one.
    pub(super) fn follow(&mut self, shared: &Shared, snapshot: usize) -> usize {
        let Some(test) = shared.test() else { return snapshot };
        let snapshot = test.nearest_snapshot(snapshot);
        let decoupled_mm = shared.result().map(|result| &result.decoupled_mm);
        let is_same = self.of.as_ref().is_some_and(|of| of.is(test, decoupled_mm));
        if is_same && self.snapshot == snapshot {
            return snapshot;
        }
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
        let actual = test.frame(test.set.targets(), snapshot);
        let decoupled = decoupled_mm.map(|decoupled_mm| test.frame(decoupled_mm.view(), snapshot));
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

    /// How far each node is off in general, once there is a result: [`node_rms_mm`].
    pub(super) fn spread_mm(&self) -> Option<&[f64]> {
        let (test, decoupled_mm) = self.result()?;
        Some(self.spread_mm.get_or_init(|| node_rms_mm(test, decoupled_mm)))
    }

    /// Actual and decoupled z of the nodes of the test set, in millimetres, once there is a result.
    pub(super) fn pairs_mm(&self) -> Option<&[(f64, f64)]> {
        let (test, decoupled_mm) = self.result()?;
        Some(self.pairs_mm.get_or_init(|| z_pairs_mm(test, decoupled_mm)))
    }
}
