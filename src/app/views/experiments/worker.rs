//! The threads of an experiment: one that hands over what is finished, and as many that train as there are cores. All
//! of them yield to the window.

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, channel},
    },
    thread,
};

use crate::{
    app::threads::{LastEvent, Report, Wake, yield_to_window},
    evaluation::experiments::{Experiment, Finished, run_experiments, worker_threads},
};

/// Tells experiments apart that were begun in one window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunNumber(u64);

/// What the threads tell the window. What a cancelled experiment still had in hand comes with its own number.
#[derive(Debug)]
pub enum ExperimentEvent {
    /// A trial has come to something.
    Finished(RunNumber, Box<Finished>),
    /// The experiment has ended, or why it could not go on.
    Ended(RunNumber, Result<(), String>),
}

/// The window's end of the threads.
pub struct ExperimentWorker {
    report: Report<ExperimentEvent>,
    events: Receiver<ExperimentEvent>,
    is_cancelled: Arc<AtomicBool>,
    latest: RunNumber,
}

impl ExperimentWorker {
    /// No thread yet. `wake` is called after each event.
    pub fn new(wake: Wake) -> Self {
        let (outgoing, events) = channel();
        Self {
            report: Report::new(outgoing, wake),
            events,
            is_cancelled: Arc::default(),
            latest: RunNumber::default(),
        }
    }

    /// Runs `experiment` and tells its number; one that still runs is cancelled.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn run(&mut self, experiment: Experiment) -> std::io::Result<RunNumber> {
        self.cancel();
        let number = RunNumber(self.latest.0 + 1);
        self.is_cancelled = Arc::default();
        let is_cancelled = Arc::clone(&self.is_cancelled);
        let died = "The experiment ended unexpectedly; what is finished stays.".to_owned();
        let mut ending = LastEvent::new(self.report.clone(), ExperimentEvent::Ended(number, Err(died)));
        thread::Builder::new().name("experiments".to_owned()).spawn(move || {
            yield_to_window();
            let result = run_experiments(
                &[experiment],
                worker_threads(false),
                || is_cancelled.load(Ordering::Relaxed),
                |finished| {
                    let news = ExperimentEvent::Finished(number, Box::new(finished));
                    ending.send(news);
                },
            );
            ending.replace(ExperimentEvent::Ended(
                number,
                result.map_err(|error| error.to_string()),
            ));
        })?;
        self.latest = number;
        Ok(number)
    }

    /// Ends the experiment. Its threads end after the epochs in progress, which nobody waits for.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// The next event, if one has come.
    pub fn next_event(&self) -> Option<ExperimentEvent> {
        self.events.try_recv().ok()
    }
}

impl Drop for ExperimentWorker {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl fmt::Debug for ExperimentWorker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ExperimentWorker").finish_non_exhaustive()
    }
}
