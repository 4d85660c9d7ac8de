//! Answers questions in the background. Only the newest question counts: older ones that wait are dropped, and an answer
//! that takes long is abandoned as soon as another question is asked.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::{Analysis, Question};
use crate::window::job::{Job, Wake};

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
    use std::sync::mpsc::{Receiver, channel};

    use super::*;
    use decoupler_core::evaluation::SimulatedSettings;

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
