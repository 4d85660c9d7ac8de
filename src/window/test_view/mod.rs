//! A test set ready to be drawn: that of a simulated array, or of a recording.

mod array;
mod recorded;

use std::sync::Arc;

pub use array::{Frame, HeightScale, SurfaceStyle, TestView, TestViewError};
pub use recorded::{Positions, RecordedTest, TargetCharts};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Problem, Run},
};

/// Test set of a run, ready to be drawn.
#[expect(clippy::large_enum_variant, reason = "there is one a run")]
#[derive(Clone, Debug)]
pub enum TestSet {
    /// Nodes of a simulated array.
    Array(TestView),
    /// Targets of a recording.
    Recording(RecordedTest),
}

impl TestSet {
    /// Prepares the test set of `run`.
    ///
    /// # Errors
    /// Nodes of an array through which no surface can be laid.
    pub fn of(run: &Run) -> Result<Self, TestViewError> {
        Ok(match run.settings().simulated() {
            Some(settings) => Self::Array(TestView::of(&settings, Arc::clone(run.test()))?),
            None => Self::Recording(RecordedTest::new(Arc::clone(run.test()), Arc::clone(run.problem()))),
        })
    }

    /// The samples.
    pub fn set(&self) -> &Arc<Dataset> {
        match self {
            Self::Array(test) => &test.set,
            Self::Recording(test) => &test.set,
        }
    }

    /// The nodes of a simulated array.
    pub fn array(&self) -> Option<&TestView> {
        match self {
            Self::Array(test) => Some(test),
            Self::Recording(_) => None,
        }
    }

    /// The targets of a recording.
    pub fn recording(&self) -> Option<&RecordedTest> {
        match self {
            Self::Array(_) => None,
            Self::Recording(test) => Some(test),
        }
    }

    /// Number of test snapshots: whole frames of an array, samples of a recording.
    pub fn snapshots(&self) -> usize {
        match self {
            Self::Array(test) => test.snapshots.len(),
            Self::Recording(test) => test.set.samples(),
        }
    }

    /// Description of the channels, if the targets are those of a recording.
    pub fn problem(&self) -> Option<&Problem> {
        self.recording().map(|test| &*test.problem)
    }
}
