//! Answers questions in the background. Only the newest question counts: older waiting questions are dropped, and a
//! slow analysis is abandoned as soon as another question is asked.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    scene::Scene,
    sensor::{Axes, SensorModel},
};

use super::{Analysis, Question, recording::RecordingStudy};
use crate::window::job::{Background, Wake};

/// The Identifiability view.
#[derive(Debug)]
pub struct IdentifiabilityView {
    /// Current question.
    pub question: Question,
    /// The newest answer, displayed until the next one is computed.
    pub analysis: Option<Arc<Analysis>>,
    /// Reason why the question has no answer.
    pub problem: Option<String>,
    /// True while the answer is being computed.
    pub is_pending: bool,
    /// True while the view is displayed.
    pub(super) is_shown: bool,
    /// Axis along which pattern and sensitivity are drawn: 0 for x, 1 for y, 2 for z.
    pub axis: usize,
    /// Settings of the Train view when they were last adopted.
    followed: Option<(SensorModel, Scene)>,
    /// The node under the pointer, marked on both pictures.
    pub(super) node: Option<usize>,
    pub(super) worker: IdentifiabilityWorker,
    /// Analysis of a recording.
    pub(super) study: RecordingStudy,
}

impl IdentifiabilityView {
    /// Creates the view with the default question; `wake` is called after each answer.
    pub fn new(wake: Wake) -> Self {
        Self {
            question: Question::of(&Simulation::default()),
            analysis: None,
            problem: None,
            is_pending: false,
            is_shown: false,
            axis: 2,
            followed: None,
            node: None,
            study: RecordingStudy::new(Arc::clone(&wake)),
            worker: IdentifiabilityWorker::new(wake),
        }
    }

    /// Starts to answer the question.
    pub(super) fn ask(&mut self) {
        self.is_pending = true;
        self.worker.ask(self.question);
    }

    /// Adopts this sensor and scene if they have changed since they were last adopted; otherwise changes made here are
    /// kept. Returns true if they were adopted.
    pub fn follow(&mut self, simulation: &Simulation) -> bool {
        let present = (simulation.sensor, simulation.scene);
        if self.followed.replace(present) == Some(present) {
            return false;
        }
        self.question = Question::of(simulation);
        true
    }

    /// Adopts this sensor and scene, discarding changes made here.
    pub fn take(&mut self, simulation: &Simulation) {
        self.followed = Some((simulation.sensor, simulation.scene));
        self.question = Question::of(simulation);
    }

    /// Returns these settings with the sensor of the question. Changes made here are kept when these settings come
    /// back.
    pub fn hand_over(&mut self, settings: &RunSettings) -> RunSettings {
        let sensor = self.question.sensor;
        let mut settings = *settings;
        if let Some(simulation) = settings.simulation_mut() {
            self.followed = Some((sensor, simulation.scene));
            simulation.sensor = sensor;
        }
        settings
    }

    /// Returns the index of [`Self::axis`] among the moving axes, or that of z if this axis does not move.
    pub fn place_of_axis(&self, axes: Axes) -> usize {
        let indices = axes.indices();
        let found = indices.iter().position(|&index| index == self.axis);
        found.unwrap_or(indices.len() - 1)
    }
}

/// An analysis faster than this is completed even if another question is asked, so that the picture follows a slider.
const SHORT: Duration = Duration::from_millis(250);

/// Result of an analysis; `None` if it was abandoned.
type Answered = Result<Option<Arc<Analysis>>, String>;

/// Message of the thread to the window.
#[derive(Debug)]
pub struct Answer {
    /// True if no other question has been asked since.
    pub is_newest: bool,
    /// Analysis, or the reason why there is none.
    pub analysis: Result<Arc<Analysis>, String>,
}

/// Handle of the analysis thread.
#[derive(Debug)]
pub struct IdentifiabilityWorker {
    job: Background<Answered>,
    /// The newest question, waiting while another is answered.
    waiting: Option<Question>,
}

impl IdentifiabilityWorker {
    /// Creates a worker without a question; `wake` is called after each answer.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Background::new("identifiability", wake),
            waiting: None,
        }
    }

    /// Asks a question.
    pub fn ask(&mut self, question: Question) {
        if self.job.is_under_way() {
            self.job.cancel();
            self.waiting = Some(question);
        } else {
            self.begin(question);
        }
    }

    /// Returns the next answer, if there is one.
    pub fn next_answer(&mut self) -> Option<Answer> {
        loop {
            let answered = self.job.next_event()?;
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
        self.job.start(
            move |report| {
                let begun = Instant::now();
                let is_abandoned = || report.is_cancelled() && begun.elapsed() > SHORT;
                let analysis = Analysis::new(&question, is_abandoned);
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

    use super::*;

    #[test]
    fn changes_are_kept_until_the_settings_change() {
        let mut simulation = Simulation::default();
        let mut state = IdentifiabilityView::new(Arc::new(|| ()));
        assert!(state.follow(&simulation));
        state.question.sensor.geometry.height_mm = 7.0;
        assert!(!state.follow(&simulation));
        assert_eq!(state.question.sensor.geometry.height_mm, 7.0);
        simulation.scene.largest_compression = 0.4;
        assert!(state.follow(&simulation));
        assert_eq!(state.question, Question::of(&simulation));
    }

    #[test]
    fn an_axis_that_does_not_move_is_replaced_by_z() {
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
        let mut question = Question::of(&Simulation::default());
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
    fn an_invalid_question_gives_a_reason() {
        let (mut worker, wakes) = worker();
        let mut question = Question::of(&Simulation::default());
        question.sensor.geometry.row_pitch_mm = 0.0;
        worker.ask(question);
        let answer = next_answer(&mut worker, &wakes);
        assert!(answer.analysis.unwrap_err().contains("row pitch"));
    }
}
