use std::{
    ops::ControlFlow,
    path::Path,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, TrainingSize, Workload,
        recorded::{Determination, Findings, channel_remarks, ridge_remarks},
    },
    job::Job,
    problem::Channel,
};
use decoupler_files::{
    export::describe_warnings,
    import::{Plan, Progress, Recording, Setup},
    machine::memory_budget,
};

use crate::window::{
    job::{Background, Report, Wake},
    shared::{Effect, Matter, Notice, Unfinished},
};

/// Study of a recording: its background thread and its results.
#[derive(Debug)]
pub struct RecordingStudy {
    job: Background<StudyEvent>,
    /// The work under way.
    pub(super) under_way: Option<UnderWay>,
    /// Progress of reading a file.
    pub(super) reading: Option<Progress>,
    /// Findings on the recording, once measured.
    pub(super) found: Option<Box<RecordingFindings>>,
    /// Errors of the last cross-validation.
    pub(super) validated: Option<Box<FoldsResult>>,
    /// Number of folds of a cross-validation.
    pub(super) folds: usize,
}

/// Work of the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnderWay {
    /// Findings.
    Findings,
    /// A cross-validation.
    CrossValidation,
}

/// Event of the thread.
#[derive(Debug)]
pub enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// The files are read.
    Read,
    /// Findings on the recording.
    Found(Box<RecordingFindings>),
    /// The result of a cross-validation.
    Validated(Box<FoldsResult>),
    /// The thread has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

impl RecordingStudy {
    /// Creates a study without results; `wake` is called after each event.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Background::new("recording study", wake),
            under_way: None,
            reading: None,
            found: None,
            validated: None,
            folds: 5,
        }
    }

    /// Returns true while the thread computes.
    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Returns the work under way.
    pub fn unfinished(&self) -> Option<Unfinished> {
        Some(match self.under_way? {
            UnderWay::Findings => Unfinished::new("Analysis", "it takes seconds".to_owned()),
            UnderWay::CrossValidation => Unfinished::new("Cross-validation", format!("{} folds", self.folds)),
        })
    }

    /// Analyses the readings of the recording of `setup`.
    pub(super) fn analyse(&mut self, setup: Setup) {
        self.found = None;
        self.start(UnderWay::Findings, setup);
    }

    /// Cross-validates the recording of `setup`.
    pub(super) fn cross_validate(&mut self, setup: Setup) {
        self.validated = None;
        self.start(UnderWay::CrossValidation, setup);
    }

    fn start(&mut self, under_way: UnderWay, setup: Setup) {
        (self.under_way, self.reading) = (Some(under_way), None);
        let folds = self.folds;
        self.job.start(
            move |report| report.unless_cancelled(work(setup, under_way, folds, report)),
            |ended| StudyEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Cancels the work under way.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.under_way = None;
    }

    /// Takes the events of the thread.
    pub fn take_events(&mut self, effects: &mut Vec<Effect>) {
        while let Some(event) = self.job.next_event() {
            match event {
                StudyEvent::Reading(progress) => self.reading = Some(progress),
                StudyEvent::Read => self.reading = None,
                StudyEvent::Found(found) => self.found = Some(found),
                StudyEvent::Validated(validated) => self.validated = Some(validated),
                StudyEvent::Ended(ended) => {
                    self.under_way = None;
                    effects.push(match ended {
                        Ok(()) => Effect::Settle(Matter::Identifiability),
                        Err(reason) => Effect::Notify(Matter::Identifiability, Notice::Failed(reason)),
                    });
                }
            }
        }
    }
}

/// Findings on a recording, with the data that they were measured on.
#[derive(Clone, Debug)]
pub struct RecordingFindings {
    /// Setup of the recording.
    pub setup: Setup,
    /// Number of folds, and the rule by which they were made.
    pub folds: String,
    /// Number of samples.
    pub samples: usize,
    /// Channels of the targets.
    pub targets: Vec<Channel>,
    /// The findings.
    pub findings: Findings,
    /// Warnings about channels, targets and networks.
    pub warnings: Vec<String>,
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
    pub table: Vec<ErrorTable>,
    /// Remarks on the readings, target by target, and where a network is no better than ridge.
    pub remarks: Vec<String>,
}

/// Does the work on the recording of `setup`; ends early if it is cancelled.
///
/// # Errors
/// If the recording cannot be read, divided or trained on, with what to do.
pub fn work(setup: Setup, work: UnderWay, folds: usize, report: &Report<StudyEvent>) -> Result<(), String> {
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
    report.send(StudyEvent::Read);
    match work {
        UnderWay::Findings => find(setup, &plan, recording, report),
        UnderWay::CrossValidation => validate(setup, &plan, &recording, folds, report),
    }
}

fn find(setup: Setup, plan: &Plan, recording: Recording, report: &Report<StudyEvent>) -> Result<(), String> {
    let begun = Instant::now();
    let is_cancelled = || report.is_cancelled();
    let found = recording.findings(setup.settings(), plan.division.by, &Job::new(&is_cancelled));
    let findings = found.map_err(|error| error.to_string())?;
    report.send(StudyEvent::Found(Box::new(RecordingFindings {
        warnings: describe_warnings(&recording, plan.division.by, &findings),
        folds: describe_folds(findings.record.folds, plan.division.by),
        findings,
        setup,
        samples: recording.set.samples(),
        targets: recording.problem.targets,
        time: begun.elapsed(),
    })));
    Ok(())
}

fn validate(
    setup: Setup,
    plan: &Plan,
    recording: &Recording,
    folds: usize,
    report: &Report<StudyEvent>,
) -> Result<(), String> {
    let (settings, set, by) = (setup.settings(), &recording.set, plan.division.by);
    let is_cancelled = || report.is_cancelled();
    let job = &Job::new(&is_cancelled);
    let workload = Workload::of(settings, TrainingSize::of(settings, set));
    workload
        .check_memory(memory_budget())
        .map_err(|error| error.to_string())?;
    let assigned =
        Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split)).map_err(|error| error.to_string())?;
    let validated = CrossValidated::on_folds(settings, set, assigned, job).map_err(|error| error.to_string())?;
    let determined = Determination::measure(set, validated.network.view(), by);
    let scores = validated.scores(set);
    let mut remarks = channel_remarks(set, by, &recording.problem.features(), &recording.problem.targets);
    for (target, channel) in recording.problem.targets.iter().enumerate() {
        let name = &channel.name;
        remarks.push(match &determined[target] {
            Ok(determined) => determined.sentence(name, "the network explains"),
            Err(cause) => format!("{name}: {cause}"),
        });
    }
    remarks.extend(ridge_remarks(set, &validated, by, &recording.problem.targets));
    report.send(StudyEvent::Validated(Box::new(FoldsResult {
        folds: describe_folds(folds, by),
        samples: set.samples(),
        table: ErrorTable::of_scores(&recording.problem, &scores, None),
        remarks,
        setup,
    })));
    Ok(())
}

fn describe_folds(folds: usize, by: SplitBy) -> String {
    format!("{folds} folds by {by}")
}
