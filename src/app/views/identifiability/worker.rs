//! The thread that answers questions. Only the newest question counts: older ones that wait are dropped, and an answer
//! that takes long is abandoned as soon as another question is asked.

use std::{
    fmt, io,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use super::{Analysis, AnalysisError, Question};
use crate::app::threads::{Report, Wake, WorkerDied, next_event, yield_to_window};

/// An answer that takes less is finished though another question is asked, so that the picture follows a slider.
const SHORT: Duration = Duration::from_millis(250);

/// What the thread tells the window.
#[derive(Debug)]
pub struct Answer {
    /// Whether no other question has been asked since.
    pub is_newest: bool,
    /// What the readings can tell, or why that is not known.
    pub analysis: Result<Box<Analysis>, String>,
}

type Numbered = (u64, Result<Box<Analysis>, AnalysisError>);

/// The window's end of the thread.
pub struct IdentifiabilityWorker {
    wake: Wake,
    /// The number of the newest question.
    newest: Arc<AtomicU64>,
    link: Option<Link>,
}

struct Link {
    questions: Sender<(u64, Question)>,
    answers: Receiver<Numbered>,
}

impl IdentifiabilityWorker {
    /// No thread yet. `wake` is called after each answer.
    pub fn new(wake: Wake) -> Self {
        Self {
            wake,
            newest: Arc::default(),
            link: None,
        }
    }

    /// Asks, on the thread that is there or on a new one.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn ask(&mut self, question: Question) -> io::Result<()> {
        let number = self.newest.fetch_add(1, Ordering::Relaxed) + 1;
        let link = match self.link.take() {
            Some(link) => link,
            None => self.start()?,
        };
        // The other end is gone only if the thread died, which the next look at the answers shows.
        let _ = link.questions.send((number, question));
        self.link = Some(link);
        Ok(())
    }

    /// The next answer, if one has come.
    pub fn next_answer(&mut self) -> Option<Answer> {
        let newest = self.newest.load(Ordering::Relaxed);
        match next_event(&self.link.as_ref()?.answers) {
            Ok(Some((number, analysis))) => Some(Answer {
                is_newest: number == newest,
                analysis: analysis.map_err(|error| error.to_string()),
            }),
            Ok(None) => None,
            Err(WorkerDied) => {
                self.link = None;
                let text = "The thread that computes this ended unexpectedly: change a value to try again.";
                Some(Answer {
                    is_newest: true,
                    analysis: Err(text.to_owned()),
                })
            }
        }
    }

    fn start(&self) -> io::Result<Link> {
        let (questions, incoming) = channel();
        let (outgoing, answers) = channel();
        let report = Report::new(outgoing, Arc::clone(&self.wake));
        let newest = Arc::clone(&self.newest);
        let work = move || {
            yield_to_window();
            answer_all(&incoming, &newest, &report);
        };
        thread::Builder::new().name("identifiability".to_owned()).spawn(work)?;
        Ok(Link { questions, answers })
    }
}

impl Drop for IdentifiabilityWorker {
    fn drop(&mut self) {
        // What is being answered is of no use any more.
        self.newest.fetch_add(1, Ordering::Relaxed);
    }
}

impl fmt::Debug for IdentifiabilityWorker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IdentifiabilityWorker").finish_non_exhaustive()
    }
}

fn answer_all(incoming: &Receiver<(u64, Question)>, newest: &AtomicU64, report: &Report<Numbered>) {
    let mut last: Option<Analysis> = None;
    while let Ok(mut asked) = incoming.recv() {
        while let Ok(newer) = incoming.try_recv() {
            asked = newer;
        }
        let (number, question) = asked;
        let begun = Instant::now();
        let is_abandoned = || newest.load(Ordering::Relaxed) != number && begun.elapsed() > SHORT;
        match Analysis::new(&question, last.as_ref(), is_abandoned) {
            Ok(Some(analysis)) => {
                last = Some(analysis.clone());
                report.send((number, Ok(Box::new(analysis))));
            }
            Ok(None) => {}
            Err(error) => report.send((number, Err(error))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::SimulatedSettings;

    #[test]
    fn the_last_answer_is_to_the_newest_question() {
        let mut worker = IdentifiabilityWorker::new(Arc::new(|| ()));
        let mut question = Question::of(&SimulatedSettings::default());
        for step in 1..=40 {
            question.sensor.geometry.height_mm = 0.1 * f64::from(step);
            worker.ask(question).unwrap();
        }
        let mut answers = 0;
        loop {
            match worker.next_answer() {
                None => thread::sleep(Duration::from_millis(2)),
                Some(answer) => {
                    answers += 1;
                    let analysis = answer.analysis.unwrap();
                    assert_eq!(answer.is_newest, analysis.question == question);
                    if answer.is_newest {
                        break;
                    }
                }
            }
        }
        assert!((1..=40).contains(&answers));
        assert!(worker.next_answer().is_none());
    }

    #[test]
    fn an_impossible_question_is_answered_with_its_reason() {
        let mut worker = IdentifiabilityWorker::new(Arc::new(|| ()));
        let mut question = Question::of(&SimulatedSettings::default());
        question.sensor.geometry.row_pitch_mm = 0.0;
        worker.ask(question).unwrap();
        let answer = loop {
            if let Some(answer) = worker.next_answer() {
                break answer;
            }
            thread::sleep(Duration::from_millis(2));
        };
        assert!(answer.analysis.unwrap_err().contains("row pitch"));
    }
}
