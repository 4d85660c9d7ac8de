use std::{
    ops::ControlFlow,
    path::Path,
    time::{Duration, Instant},
};

use super::study::{FoldsChoice, StudyEvent};
use crate::window::job::Report;
use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        Channel, CrossValidated, ErrorTable,
        recorded::{Determination, Findings, FittedModel, NonlinearGain, SplitComparison},
    },
};
use decoupler_files::import::{Plan, Recording, Setup};

/// Work for the thread.
#[derive(Clone, Debug)]
pub enum Task {
    /// Measure what the readings determine; without a model, that of the better of ridge and network.
    Findings(Option<FittedModel>),
    /// Test on every sample.
    CrossValidation,
}

/// Findings on a recording, with what they were measured on.
#[derive(Clone, Debug)]
pub struct RecordingFindings {
    /// Setup of the recording.
    pub setup: Setup,
    /// Number of folds, and the rule by which they were made.
    pub folds: String,
    /// Number of samples.
    pub samples: usize,
    /// Channels of the readings.
    pub inputs: Vec<Channel>,
    /// Channels of the targets.
    pub targets: Vec<Channel>,
    /// The findings.
    pub findings: Findings,
    /// Time that it took, without reading the files.
    pub time: Duration,
}

/// Result of a cross-validation.
#[derive(Clone, Debug)]
pub struct FoldsResult {
    /// Setup of the recording.
    pub setup: Setup,
    /// Number of folds, and the rule by which they were made.
    pub folds: String,
    /// Number of samples, each tested once.
    pub samples: usize,
    /// Errors of the mean, of ridge and of the networks.
    pub table: ErrorTable,
    /// Remarks on the readings, target by target, and where a network is no better than ridge.
    pub remarks: Vec<String>,
}

/// Does a task on the recording of `setup`; ends early if it is cancelled.
///
/// # Errors
/// If the recording cannot be read, divided or trained on, with what to do.
pub fn work(setup: Setup, task: &Task, choice: FoldsChoice, report: &Report<StudyEvent>) -> Result<(), String> {
    let Some(plan) = setup.plan().cloned() else {
        return Err("This is not a recording.".to_owned());
    };
    let watch = &mut |progress| {
        report.progress(StudyEvent::Reading(progress), |_, _| ());
        if report.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let recording = plan.recording(Path::new(""), watch);
    if report.is_cancelled() {
        return Ok(());
    }
    let recording = recording.map_err(|error| error.to_string())?;
    match task {
        Task::Findings(model) => find(setup, &plan, recording, (*model, choice.folds), report),
        Task::CrossValidation => validate(setup, &plan, &recording, choice, report),
    }
}

fn find(
    setup: Setup,
    plan: &Plan,
    recording: Recording,
    (model, folds): (Option<FittedModel>, usize),
    report: &Report<StudyEvent>,
) -> Result<(), String> {
    let begun = Instant::now();
    let division = (&plan.division, folds);
    let begin = |stage| report.send(StudyEvent::Began(stage));
    let is_cancelled = || report.is_cancelled();
    let found = Findings::measure(setup.settings(), &recording.set, division, model, &begin, &is_cancelled);
    if let Some(findings) = found.map_err(|error| error.to_string())? {
        report.send(StudyEvent::Found(Box::new(RecordingFindings {
            setup,
            folds: folds_in_words(folds, plan.division.by),
            samples: recording.set.samples(),
            inputs: recording.inputs,
            targets: recording.targets,
            findings,
            time: begun.elapsed(),
        })));
    }
    Ok(())
}

fn validate(
    setup: Setup,
    plan: &Plan,
    recording: &Recording,
    FoldsChoice { folds, compares_random }: FoldsChoice,
    report: &Report<StudyEvent>,
) -> Result<(), String> {
    let (settings, set, by) = (setup.settings(), &recording.set, plan.division.by);
    let is_cancelled = || report.is_cancelled();
    let assigned =
        Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split)).map_err(|error| error.to_string())?;
    let validated =
        CrossValidated::on_folds(settings, set, assigned, is_cancelled).map_err(|error| error.to_string())?;
    let Some(validated) = validated else { return Ok(()) };
    let comparison = if compares_random && by != SplitBy::Random {
        let compared = SplitComparison::complete(settings, set, folds, (by, &validated), &is_cancelled);
        let compared = compared.map_err(|error| error.to_string())?;
        if compared.is_none() {
            return Ok(());
        }
        compared
    } else {
        None
    };
    let determined = Determination::measure(set, validated.network.view(), by);
    let gains = NonlinearGain::of_validated(set, &validated, by);
    let mut remarks = Vec::new();
    for (target, channel) in recording.targets.iter().enumerate() {
        let name = &channel.name;
        remarks.push(match &determined[target] {
            Ok(determined) => determined.sentence(name),
            Err(cause) => format!("{name}: {cause}"),
        });
        remarks.extend(gains[target].and_then(|gain| gain.remark(name)));
        remarks.extend(comparison.as_ref().map(|comparison| comparison.sentence(target, name)));
    }
    report.send(StudyEvent::Validated(Box::new(FoldsResult {
        folds: folds_in_words(folds, by),
        samples: set.samples(),
        table: ErrorTable::of_scores(&recording.problem(), &validated.scores(set), None),
        remarks,
        setup,
    })));
    Ok(())
}

fn folds_in_words(folds: usize, by: SplitBy) -> String {
    format!("{folds} folds by {by}")
}
