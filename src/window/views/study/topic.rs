//! The topics, with what each contributes to the one mechanism: form, task, outcome.

use std::sync::{Arc, atomic::AtomicBool};

use decoupler_core::{
    evaluation::{
        TradeOffPoint,
        experiments::{Experiment, Finished, PaperTable},
    },
    problem::Problem,
    text::counted,
};
use decoupler_files::{
    export::{NetworkFile, Table, cells_table, trade_off_points, trials_table},
    figure::TradeOffLimits,
    import::{Progress, Recorded, Setup},
};
use eframe::egui::Ui;

use super::{
    ExperimentForm, ExperimentOutcome, Report, SpeedForm, SpeedOutcome, SpeedPlan, experiment,
    readings::{self, MAX_FOLDS},
    speed,
};
use crate::window::{
    job,
    widgets::{fields::count_ui, section_heading_ui},
};

/// What is studied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// A table of the paper.
    Table(PaperTable),
    /// A sweep over two axes.
    Sweep,
    /// Speed against accuracy of every decoder.
    Speed,
    /// What the readings of a recording determine.
    Readings,
    /// A cross-validation of the network of a recording.
    Folds,
}

/// Words about a topic.
#[derive(Clone, Copy, Debug)]
pub struct TopicWords {
    /// Name in the list.
    pub name: &'static str,
    /// Verb on the button.
    pub verb: &'static str,
    /// What it is about.
    pub meaning: &'static str,
    /// What will be shown, before there is anything.
    pub invitation: &'static str,
}

impl Topic {
    /// All topics, in the order of the list.
    pub const ALL: [Self; 7] = [
        Self::Table(PaperTable::HiddenNodes),
        Self::Table(PaperTable::CrossValidation),
        Self::Table(PaperTable::ArrayScales),
        Self::Sweep,
        Self::Speed,
        Self::Readings,
        Self::Folds,
    ];

    /// Returns the words about it.
    pub fn words(self) -> TopicWords {
        let (name, verb, meaning) = match self {
            Self::Table(PaperTable::HiddenNodes) => (
                "Table 1",
                "Run",
                "Errors of networks with different numbers of hidden nodes on the paper's array.",
            ),
            Self::Table(PaperTable::CrossValidation) => (
                "Table 2",
                "Run",
                "Cross-validation of a large and a small dataset, shuffled again in each repeat, and the scatter of the \
                 errors over the folds (the paper's Fig. 5).",
            ),
            Self::Table(PaperTable::ArrayScales) => (
                "Table 3",
                "Run",
                "Errors on arrays of different scales, with 12 hidden nodes.",
            ),
            Self::Sweep => (
                "Sweep",
                "Run",
                "Any two settings varied against each other, all others fixed.",
            ),
            Self::Speed => (
                "Speed against accuracy",
                "Measure",
                "The error, the decoding time and the training time of every decoder, measured on this machine.",
            ),
            Self::Readings => (
                "What the readings determine",
                "Analyse",
                "How well the readings of a recording determine each target, and channels without information; takes \
                 seconds.",
            ),
            Self::Folds => (
                "Cross-validation",
                "Cross-validate",
                "Every sample of a recording tested by networks trained on the other folds: one training per fold.",
            ),
        };
        let invitation = match self {
            Self::Table(_) | Self::Sweep => {
                "Our figures appear next to the published ones as the trials finish."
            }
            Self::Speed => {
                "The error, the time for a frame and the training time of every decoder, on an array at several noise \
                 levels, measured on this machine."
            }
            Self::Readings => {
                "How well the readings determine each target: measured on held-out samples, with confidence intervals of \
                 95 % from independent stretches or groups of samples."
            }
            Self::Folds => "Tests on every sample and lists the held-out errors here.",
        };
        TopicWords {
            name,
            verb,
            meaning,
            invitation,
        }
    }

    /// Returns the title of the results of an experiment.
    pub fn heading(self) -> String {
        match self {
            Self::Table(table) => table.heading(),
            Self::Sweep => "Sweep over two axes".to_owned(),
            _ => self.words().name.to_owned(),
        }
    }

    /// Returns the tables for programs of its results, each with its name and contents.
    pub fn tables(self) -> &'static [(&'static str, &'static str, TableOf)] {
        match self {
            Self::Table(_) | Self::Sweep => &[
                ("Every cell", "The values of every cell with every digit, as CSV.", every_cell),
                ("Every trial", "Every trial with its seed and errors, as CSV.", every_trial),
            ],
            Self::Speed => &[(
                "All points",
                "Every point, of an array at every noise level, with every digit, as CSV.",
                all_points,
            )],
            Self::Readings | Self::Folds => &[],
        }
    }

    /// Returns true for topics about recordings.
    pub fn is_of_recordings(self) -> bool {
        matches!(self, Self::Readings | Self::Folds)
    }
}

/// Makes a table of results.
pub type TableOf = fn(&Outcome) -> Table;

fn every_cell(outcome: &Outcome) -> Table {
    match outcome {
        Outcome::Experiment(outcome) => cells_table(&outcome.results),
        _ => Table::default(),
    }
}

fn every_trial(outcome: &Outcome) -> Table {
    match outcome {
        Outcome::Experiment(outcome) => trials_table(&outcome.results),
        _ => Table::default(),
    }
}

fn all_points(outcome: &Outcome) -> Table {
    match outcome {
        Outcome::Speed(outcome) => trade_off_points(&outcome.levels),
        _ => Table::default(),
    }
}

/// Form of a topic.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// A table or a sweep.
    Experiment(ExperimentForm),
    /// Speed against accuracy.
    Speed(SpeedForm),
    /// What the readings determine.
    Readings,
    /// A cross-validation with this number of folds.
    Folds(usize),
}

impl Form {
    /// Returns the default form of a topic.
    pub fn new(topic: Topic) -> Self {
        match topic {
            Topic::Table(table) => Self::Experiment(ExperimentForm::table(table)),
            Topic::Sweep => Self::Experiment(ExperimentForm::sweep()),
            Topic::Speed => Self::Speed(SpeedForm::default()),
            Topic::Readings => Self::Readings,
            Topic::Folds => Self::Folds(5),
        }
    }

    /// Returns the task of the form, checked as far as possible without beginning; `train` is the setup of the Train view.
    ///
    /// # Errors
    /// If the form is not valid, or the Train view has no source; the message says what to do.
    pub fn task(&self, train: &Result<Setup, String>) -> Result<Task, String> {
        let recording = || {
            let setup = train.clone()?;
            let is_recording = setup.plan().is_some();
            let advice = "choose Recording as the source in the Train view; the Sensor view shows it for a simulated array";
            is_recording.then_some(setup).ok_or_else(|| format!("This is about a recording: {advice}."))
        };
        match self {
            Self::Experiment(form) => form.task(),
            Self::Speed(form) => form.task(train.as_ref()?),
            Self::Readings => Ok(Task::Readings(recording()?)),
            Self::Folds(folds) => Ok(Task::Folds(recording()?, *folds)),
        }
    }

    /// Shows the fields.
    pub fn fields_ui(&mut self, ui: &mut Ui, train: &Result<Setup, String>) {
        match self {
            Self::Experiment(form) => form.fields_ui(ui, train),
            Self::Speed(form) => form.fields_ui(ui, train.as_ref().is_ok_and(|setup| setup.plan().is_none())),
            Self::Readings => {}
            Self::Folds(folds) => {
                section_heading_ui(ui, "Cross-validation");
                let hint = "Number of parts. Each part is tested by networks trained on the other parts.";
                count_ui(ui, "Folds", hint, folds, 2..=MAX_FOLDS);
            }
        }
    }
}

/// Work of a background job.
#[derive(Clone, Debug)]
pub enum Task {
    /// Trials of an experiment, on the samples of a setup.
    Experiment(Box<Experiment>, Setup),
    /// Times and errors of decoders.
    Speed(SpeedPlan),
    /// Findings on a recording.
    Readings(Setup),
    /// A cross-validation with a number of folds.
    Folds(Setup, usize),
}

impl Task {
    /// Describes how much work it is.
    pub fn size(&self) -> String {
        match self {
            Self::Experiment(experiment, _) => experiment::describe_size(experiment),
            Self::Speed(plan) => counted(plan.points(), "point"),
            Self::Readings(setup) => setup.source_name(),
            Self::Folds(setup, folds) => format!("{}, {}", setup.source_name(), counted(*folds, "training")),
        }
    }

    /// Does the work; measures times only while it `is_quiet`.
    ///
    /// # Errors
    /// If the work cannot be done, with what to do.
    pub fn run(self, is_quiet: &AtomicBool, reporter: &Reporter) -> Result<(), String> {
        match self {
            Self::Experiment(experiment, setup) => experiment::run(*experiment, &setup, reporter),
            Self::Speed(plan) => speed::measure(&plan, is_quiet, reporter),
            Self::Readings(setup) => readings::find(&setup, reporter),
            Self::Folds(setup, folds) => readings::cross_validate(&setup, folds, reporter),
        }
    }
}

/// Sending end of the events of a task.
pub type Reporter = job::Report<StudyEvent>;

/// Reports the progress of reading a file.
pub fn read(reporter: &Reporter, progress: Progress) {
    reporter.progress(StudyEvent::Reading(progress), |_, _| ());
}

/// Event of the newest task.
#[derive(Debug)]
pub enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// The files are read.
    Read,
    /// A recording has been read, with these channels.
    Problem(Arc<Problem>),
    /// A trial has finished or failed.
    Trial(Box<Finished>),
    /// The samples of a run are ready.
    Samples {
        /// Unit for which decoding is timed, such as "a sample".
        decoded: String,
        /// Origin of recorded samples.
        recorded: Option<Box<Recorded>>,
    },
    /// A point of a run is measured, with the file of its network if it has one.
    Point(usize, Box<TradeOffPoint>, Option<Arc<NetworkFile>>),
    /// A decoder cannot be used with the samples of a run, with the reason.
    Refused(usize, String),
    /// The results of work that has none before its end.
    Report(Box<Report>),
    /// The work has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// Results so far.
#[derive(Debug)]
pub enum Outcome {
    /// Of a table or a sweep.
    Experiment(ExperimentOutcome),
    /// Of speed against accuracy.
    Speed(SpeedOutcome),
    /// Of work that has no results before its end.
    Whole(Option<Report>),
}

impl Outcome {
    /// Creates an outcome without results.
    pub fn new(task: &Task) -> Self {
        match task {
            Task::Experiment(experiment, setup) => Self::Experiment(ExperimentOutcome::new(experiment, setup)),
            Task::Speed(plan) => Self::Speed(SpeedOutcome::new(plan)),
            Task::Readings(_) | Task::Folds(..) => Self::Whole(None),
        }
    }

    /// Adds what an event reports.
    pub fn take(&mut self, event: StudyEvent) {
        match (self, event) {
            (Self::Experiment(outcome), StudyEvent::Problem(problem)) => outcome.results.problem = Some(problem),
            (Self::Experiment(outcome), StudyEvent::Trial(finished)) => outcome.record(*finished),
            (Self::Speed(outcome), StudyEvent::Samples { decoded, recorded }) => {
                (outcome.decoded, outcome.recorded) = (decoded, recorded);
            }
            (Self::Speed(outcome), StudyEvent::Point(run, point, file)) => outcome.record(run, *point, file),
            (Self::Speed(outcome), StudyEvent::Refused(run, reason)) => outcome.refuse(run, reason),
            (Self::Whole(whole), StudyEvent::Report(report)) => *whole = Some(*report),
            _ => {}
        }
    }

    /// Returns the numbers of finished and of planned parts, and the name of a part; none of work without parts.
    pub fn parts(&self) -> Option<(usize, usize, &'static str)> {
        let ((done, all), part) = match self {
            Self::Experiment(outcome) => (outcome.trials(), "trial"),
            Self::Speed(outcome) => (outcome.points(), "point"),
            Self::Whole(_) => return None,
        };
        Some((done, all, part))
    }

    /// Returns true once there are results.
    pub fn has_results(&self) -> bool {
        match self {
            Self::Whole(whole) => whole.is_some(),
            _ => self.parts().is_some_and(|(done, ..)| done > 0),
        }
    }

    /// Returns the report of the results so far; `limits` are those for the recommended decoders.
    pub fn report(&self, topic: Topic, limits: &TradeOffLimits) -> Report {
        match self {
            Self::Experiment(outcome) => outcome.report(topic.heading()),
            Self::Speed(outcome) => outcome.report(limits),
            Self::Whole(whole) => whole.clone().unwrap_or_default(),
        }
    }
}
