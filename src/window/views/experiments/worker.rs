//! Runs an experiment in the background: one thread hands over what is finished, and as many train as there are cores.

use std::{path::Path, sync::Arc};

use crate::window::job::Job;
use decoupler_core::evaluation::{
    Problem,
    experiments::{Experiment, Finished, TrialSamples, run_experiments, worker_threads},
};
use decoupler_files::import::Setup;

/// Events of the experiment begun last.
#[derive(Debug)]
pub enum ExperimentEvent {
    /// A recording has been read, with these channels.
    Read(Arc<Problem>),
    /// A trial has come to something.
    Finished(Box<Finished>),
    /// The experiment has ended, or why it could not go on.
    Ended(Result<(), String>),
}

/// Runs `experiment` on the samples of `setup`; one that still runs is cancelled, and ends after the epochs in progress.
pub fn run(job: &mut Job<ExperimentEvent>, experiment: Experiment, setup: Setup) {
    job.start(
        move |report| {
            // The paths of the window's plans are absolute.
            let samples = setup.trial_samples(Path::new(""), &|| report.is_cancelled(), &mut |_| {});
            let Some(samples) = samples.map_err(|error| error.to_string())? else {
                return Ok(());
            };
            if let TrialSamples::Recorded(recorded) = &samples {
                report.send(ExperimentEvent::Read(Arc::clone(&recorded.problem)));
            }
            let run = run_experiments(
                &[experiment],
                &samples,
                worker_threads(false),
                || report.is_cancelled(),
                |finished| report.send(ExperimentEvent::Finished(Box::new(finished))),
            );
            run.map_err(|error| error.to_string())
        },
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; the finished trials are kept"));
            ExperimentEvent::Ended(ended.and_then(|run| run))
        },
    );
}
