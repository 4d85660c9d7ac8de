//! Runs an experiment in the background: one thread hands over what is finished, and as many train as there are cores.

use crate::{
    app::job::Job,
    evaluation::experiments::{Experiment, Finished, run_experiments, worker_threads},
};

/// News of the experiment begun last.
#[derive(Debug)]
pub enum ExperimentEvent {
    /// A trial has come to something.
    Finished(Box<Finished>),
    /// The experiment has ended, or why it could not go on.
    Ended(Result<(), String>),
}

/// Runs `experiment`; one that still runs is cancelled, and ends after the epochs in progress.
pub fn run(job: &mut Job<ExperimentEvent>, experiment: Experiment) {
    job.start(
        move |report| {
            run_experiments(
                &[experiment],
                worker_threads(false),
                || report.is_cancelled(),
                |finished| report.send(ExperimentEvent::Finished(Box::new(finished))),
            )
        },
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; what is finished stays"));
            ExperimentEvent::Ended(ended.and_then(|run| run.map_err(|error| error.to_string())))
        },
    );
}
