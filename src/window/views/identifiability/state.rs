use std::sync::Arc;

use super::{Analysis, Question, recording::RecordingStudy, worker::IdentifiabilityWorker};
use crate::window::job::Wake;
use decoupler_core::{
    evaluation::SimulatedSettings,
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// The Identifiability view.
#[derive(Debug)]
pub struct IdentifiabilityView {
    /// Question that is asked.
    pub question: Question,
    /// The newest answer; it stays in view while the next is computed.
    pub analysis: Option<Arc<Analysis>>,
    /// Reason for which the question has no answer.
    pub problem: Option<String>,
    /// True while the answer to the question is still to come.
    pub is_pending: bool,
    /// Along which axis pattern and sensitivity are drawn: 0 for x, 1 for y, 2 for z.
    pub axis: usize,
    /// Sensor and scene of the Train view when the question was last taken from there.
    followed: Option<(SensorModel, Scene)>,
    /// The node under the pointer, marked on both pictures.
    pub(super) node: Option<usize>,
    pub(super) worker: IdentifiabilityWorker,
    /// Analysis of a recording.
    pub(super) study: RecordingStudy,
}

impl IdentifiabilityView {
    /// Nothing asked yet. `wake` is called after each answer.
    pub fn new(wake: Wake) -> Self {
        Self {
            question: Question::of(&SimulatedSettings::default()),
            analysis: None,
            problem: None,
            is_pending: false,
            axis: 2,
            followed: None,
            node: None,
            study: RecordingStudy::new(Arc::clone(&wake)),
            worker: IdentifiabilityWorker::new(wake),
        }
    }

    /// Asks the question.
    pub(super) fn ask(&mut self) {
        self.is_pending = true;
        self.worker.ask(self.question);
    }

    /// Takes up these settings, unless they are as they were when last taken: then what was changed here stays.
    /// Returns whether the question is a new one.
    pub fn follow(&mut self, settings: &SimulatedSettings) -> bool {
        let present = (settings.source.sensor, settings.source.scene);
        if self.followed.replace(present) == Some(present) {
            return false;
        }
        self.question = Question::of(settings);
        true
    }

    /// Takes up these settings, whatever was changed here.
    pub fn take(&mut self, settings: &SimulatedSettings) {
        self.followed = Some((settings.source.sensor, settings.source.scene));
        self.question = Question::of(settings);
    }

    /// These settings with the sensor looked at; what was tried here stays when they come back.
    pub fn hand_over(&mut self, settings: &SimulatedSettings) -> SimulatedSettings {
        let sensor = self.question.sensor;
        self.followed = Some((sensor, settings.source.scene));
        let mut settings = *settings;
        settings.source.sensor = sensor;
        settings
    }

    /// The place of [`Self::axis`] among the axes that move; z where that axis rests.
    pub fn place_of_axis(&self, axes: Axes) -> usize {
        let indices = axes.indices();
        let found = indices.iter().position(|&index| index == self.axis);
        found.unwrap_or(indices.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn what_is_tried_here_stays_until_the_settings_change() {
        let mut settings = SimulatedSettings::default();
        let mut state = IdentifiabilityView::new(Arc::new(|| ()));
        assert!(state.follow(&settings));
        state.question.sensor.geometry.height_mm = 7.0;
        assert!(!state.follow(&settings));
        assert_eq!(state.question.sensor.geometry.height_mm, 7.0);
        settings.source.scene.largest_compression = 0.4;
        assert!(state.follow(&settings));
        assert_eq!(state.question, Question::of(&settings));
    }

    #[test]
    fn an_axis_at_rest_gives_way_to_z() {
        let mut state = IdentifiabilityView::new(Arc::new(|| ()));
        state.axis = 0;
        assert_eq!((state.place_of_axis(Axes::Z), state.place_of_axis(Axes::Xyz)), (0, 0));
        state.axis = 2;
        assert_eq!((state.place_of_axis(Axes::Z), state.place_of_axis(Axes::Xyz)), (0, 2));
    }
}
