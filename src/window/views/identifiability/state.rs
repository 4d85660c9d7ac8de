//! Answers questions in the background. Only the newest question counts: older ones that wait are dropped, and an answer
//! that takes long is abandoned as soon as another question is asked.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    evaluation::SimulatedSettings,
    scene::Scene,
    sensor::{Axes, SensorModel},
};

use super::{Analysis, Question, recording::RecordingStudy};
use crate::window::job::{Job, Wake};

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

/// An answer that takes less is finished though another question is asked, so that the picture follows a slider.
const SHORT: Duration = Duration::from_millis(250);

/// Result of an analysis; `None` if it was not computed to the end.
type Answered = Result<Option<Arc<Analysis>>, String>;

/// Message of the thread to the window.
#[derive(Debug)]
pub struct Answer {
    /// True if no other question has been asked since.
    pub is_newest: bool,
    /// Analysis, or the reason for which there is none.
    pub analysis: Result<Arc<Analysis>, String>,
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct IdentifiabilityWorker {
    job: Job<Answered>,
    /// The newest question, asked while another is answered.
    waiting: Option<Question>,
    last: Option<Arc<Analysis>>,
}

impl IdentifiabilityWorker {
    /// Nothing asked yet. `wake` is called after each answer.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("identifiability", wake),
            waiting: None,
            last: None,
        }
    }

    /// Asks.
    pub fn ask(&mut self, question: Question) {
        if self.job.is_under_way() {
            self.job.cancel();
            self.waiting = Some(question);
        } else {
            self.begin(question);
        }
    }

    /// The next answer, if one has come.
    pub fn next_answer(&mut self) -> Option<Answer> {
        loop {
            let answered = self.job.next_event()?;
            if let Ok(Some(analysis)) = &answered {
                self.last = Some(Arc::clone(analysis));
            }
            let next = self.waiting.take();
            let is_newest = next.is_none();
            if let Some(question) = next {
                self.begin(question);
            }
            if let Some(analysis) = answered.transpose() {
                return Some(Answer { is_newest, analysis });
            }
        }
    }

    fn begin(&mut self, question: Question) {
        let last = self.last.clone();
        self.job.start(
            move |report| {
                let begun = Instant::now();
                let is_abandoned = || report.is_cancelled() && begun.elapsed() > SHORT;
                let analysis = Analysis::new(&question, last.as_deref(), is_abandoned);
                Ok(analysis.map_err(|error| error.to_string())?.map(Arc::new))
            },
            |ended| ended.unwrap_or_else(|error| Err(format!("{error}; change a value to try again"))),
        );
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        mpsc::{Receiver, channel},
    };

    use decoupler_core::evaluation::SimulatedSettings;

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

    fn worker() -> (IdentifiabilityWorker, Receiver<()>) {
        let (woke, wakes) = channel();
        (
            IdentifiabilityWorker::new(Arc::new(move || woke.send(()).unwrap_or(()))),
            wakes,
        )
    }

    fn next_answer(worker: &mut IdentifiabilityWorker, wakes: &Receiver<()>) -> Answer {
        loop {
            if let Some(answer) = worker.next_answer() {
                return answer;
            }
            wakes.recv_timeout(Duration::from_secs(60)).expect("an answer");
        }
    }

    #[test]
    fn the_last_answer_is_to_the_newest_question() {
        let (mut worker, wakes) = worker();
        let mut question = Question::of(&SimulatedSettings::default());
        for step in 1..=40 {
            question.sensor.geometry.height_mm = 0.1 * f64::from(step);
            worker.ask(question);
        }
        for answers in 1.. {
            assert!(answers <= 40);
            let answer = next_answer(&mut worker, &wakes);
            assert_eq!(answer.is_newest, answer.analysis.unwrap().question == question);
            if answer.is_newest {
                break;
            }
        }
        assert!(worker.next_answer().is_none());
    }

    #[test]
    fn an_impossible_question_is_answered_with_its_reason() {
        let (mut worker, wakes) = worker();
        let mut question = Question::of(&SimulatedSettings::default());
        question.sensor.geometry.row_pitch_mm = 0.0;
        worker.ask(question);
        let answer = next_answer(&mut worker, &wakes);
        assert!(answer.analysis.unwrap_err().contains("row pitch"));
    }
}
