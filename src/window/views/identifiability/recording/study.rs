use std::{
    ops::ControlFlow,
    path::Path,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, TrainingSize, Workload,
        recorded::{
            Determination, Findings, FittedModel, SplitComparison, StudyStep, channel_remarks, nonlinear_gains,
            ridge_remark,
        },
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
    /// Model of the analysis.
    pub(super) model: FittedModel,
    /// Extent of a cross-validation.
    pub(super) choice: FoldsChoice,
}

/// Extent of a cross-validation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoldsChoice {
    /// Number of folds.
    pub folds: usize,
    /// True to repeat the cross-validation with random folds, which shows how optimistic they are.
    pub compares_random: bool,
}

/// Work of the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnderWay {
    /// Findings, with the current step once the files are read.
    Findings(Option<StudyStep>),
    /// A cross-validation.
    CrossValidation,
}

/// Event of the thread.
#[derive(Debug)]
pub enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// A step of the work has begun.
    Began(StudyStep),
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
            model: FittedModel::Network,
            choice: FoldsChoice {
                folds: 5,
                compares_random: false,
            },
        }
    }

    /// Returns true while the thread computes.
    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Returns the work under way.
    pub fn unfinished(&self) -> Option<Unfinished> {
        Some(match self.under_way? {
            UnderWay::Findings(None) => Unfinished::discarded("Analysis", "the files are being read".to_owned()),
            UnderWay::Findings(Some(stage)) => Unfinished::discarded("Analysis", stage.to_string()),
            UnderWay::CrossValidation => {
                Unfinished::discarded("Cross-validation", format!("{} folds", self.choice.folds))
            }
        })
    }

    /// Analyses the readings of the recording of `setup`.
    pub(super) fn analyse(&mut self, setup: Setup) {
        self.found = None;
        self.start(UnderWay::Findings(None), setup, Task::Findings(self.model));
    }

    /// Cross-validates the recording of `setup`.
    pub(super) fn cross_validate(&mut self, setup: Setup) {
        self.validated = None;
        self.start(UnderWay::CrossValidation, setup, Task::CrossValidation);
    }

    fn start(&mut self, under_way: UnderWay, setup: Setup, task: Task) {
        (self.under_way, self.reading) = (Some(under_way), None);
        let choice = self.choice;
        self.job.start(
            move |report| report.unless_cancelled(work(setup, &task, choice, report)),
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
                StudyEvent::Began(stage) => self.under_way = Some(UnderWay::Findings(Some(stage))),
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

/// Work for the thread.
#[derive(Clone, Debug)]
pub enum Task {
    /// Measure what the readings determine with this model.
    Findings(FittedModel),
    /// Cross-validate.
    CrossValidation,
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
        Task::Findings(model) => find(setup, &plan, recording, *model, choice.folds, report),
        Task::CrossValidation => validate(setup, &plan, &recording, choice, report),
    }
}

fn find(
    setup: Setup,
    plan: &Plan,
    recording: Recording,
    model: FittedModel,
    folds: usize,
    report: &Report<StudyEvent>,
) -> Result<(), String> {
    let begun = Instant::now();
    let divided = (plan.division.by, folds);
    let begin = |stage| report.send(StudyEvent::Began(stage));
    let is_cancelled = || report.is_cancelled();
    let ends: (&Job<'_>, &dyn Fn() -> bool) = (&Job::new(&is_cancelled), &|| false);
    let found = Findings::measure(setup.settings(), &recording.set, divided, model, &begin, ends);
    let findings = found.map_err(|error| error.to_string())?;
    report.send(StudyEvent::Found(Box::new(RecordingFindings {
        warnings: describe_warnings(&recording, plan.division.by, &findings),
        findings,
        setup,
        folds: describe_folds(folds, plan.division.by),
        samples: recording.set.samples(),
        targets: recording.targets,
        time: begun.elapsed(),
    })));
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
    let job = &Job::new(&is_cancelled);
    let workload = Workload::of(settings, TrainingSize::of(settings, set));
    workload
        .check_memory(memory_budget())
        .map_err(|error| error.to_string())?;
    let assigned =
        Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split)).map_err(|error| error.to_string())?;
    let validated = CrossValidated::on_folds(settings, set, assigned, job).map_err(|error| error.to_string())?;
    let comparison = if compares_random && by != SplitBy::Random {
        let compared = SplitComparison::complete(settings, set, folds, (by, &validated), job);
        Some(compared.map_err(|error| error.to_string())?)
    } else {
        None
    };
    let determined = Determination::measure(set, validated.network.view(), by);
    let gains = nonlinear_gains(set, &validated, by);
    let mut remarks = channel_remarks(set, by, &recording.inputs, &recording.targets);
    for (target, channel) in recording.targets.iter().enumerate() {
        let name = &channel.name;
        remarks.push(match &determined[target] {
            Ok(determined) => determined.sentence(name, "the network explains"),
            Err(cause) => format!("{name}: {cause}"),
        });
        remarks.extend(gains[target].and_then(|gain| ridge_remark(gain, name)));
        remarks.extend(comparison.as_ref().map(|comparison| comparison.sentence(target, name)));
    }
    report.send(StudyEvent::Validated(Box::new(FoldsResult {
        folds: describe_folds(folds, by),
        samples: set.samples(),
        table: ErrorTable::of_scores(&recording.problem(), &validated.scores(set), None),
        remarks,
        setup,
    })));
    Ok(())
}

fn describe_folds(folds: usize, by: SplitBy) -> String {
    format!("{folds} folds by {by}")
}
