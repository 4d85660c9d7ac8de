//! The views, one module each; they do not depend on each other.
//!
//! A new view is a module whose main type implements [`View`], with a [`ViewKind`] and a field and a line in [`Views`]
//! below. It requests changes to the window as an [`Effect`](crate::window::shared::Effect), which the frame applies.

mod compare;
mod live;
mod sensor;
mod study;
mod train;

use std::path::PathBuf;

use super::{
    job::Jobs,
    shared::{View, ViewKind},
};
use decoupler_files::import::Plan;

pub(super) use train::CHECKPOINT;
pub use train::DecoderResult;

use self::{compare::CompareView, live::LiveView, sensor::SensorView, study::StudyView, train::TrainView};

/// All views.
#[derive(Debug)]
pub struct Views {
    /// One training and the sensor that it decodes.
    pub train: TrainView,
    /// Many trainings or measurements at once.
    pub study: StudyView,
    /// Two finished trainings side by side.
    pub compare: CompareView,
    /// What the readings determine.
    pub sensor: SensorView,
    /// Frames decoded as they arrive.
    pub live: LiveView,
}

impl Views {
    /// Creates the views in their initial state; their work is listed among `jobs`.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            train: TrainView::new(jobs),
            study: StudyView::new(jobs),
            compare: CompareView::new(jobs),
            sensor: SensorView::new(jobs),
            live: LiveView::new(jobs),
        }
    }

    /// Opens the recordings of this plan in the Train view.
    pub fn open_plan(&mut self, plan: &Plan) {
        self.train.recording.open_plan(plan);
    }

    /// Returns true if the user has opened a recording, also one whose files are missing.
    pub fn has_recording(&self) -> bool {
        !self.train.recording.is_empty()
    }

    /// Opens dropped files in the Train view.
    pub fn open_files(&mut self, paths: Vec<PathBuf>) {
        self.train.recording.open(paths);
    }

    /// Returns a view.
    pub fn get(&mut self, view: ViewKind) -> &mut dyn View {
        match view {
            ViewKind::Train => &mut self.train,
            ViewKind::Study => &mut self.study,
            ViewKind::Compare => &mut self.compare,
            ViewKind::Sensor => &mut self.sensor,
            ViewKind::Live => &mut self.live,
        }
    }
}
