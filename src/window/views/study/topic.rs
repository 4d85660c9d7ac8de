use std::{
    fmt::Debug,
    sync::{Arc, atomic::AtomicBool},
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{
        TradeOffPoint,
        experiments::{Finished, PaperTable},
    },
    problem::Problem,
    text::counted,
};
use decoupler_files::{
    export::{NetworkFile, Table},
    figure::TradeOffLimits,
    import::{Progress, Recorded, Setup},
};
use eframe::egui::Ui;

use super::{Report, experiment::ExperimentForm, readings, speed::SpeedForm};
use crate::window::{
    job,
    shared::{Effect, NetworkSource},
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
                "The error, the time for a frame and the training time of every decoder, for an array at several noise \
                 levels, measured on this machine.",
            ),
            Self::Readings => (
                "What the readings determine",
                "Analyse",
                "How well the readings of a recording determine each target: measured on held-out samples in seconds, \
                 with confidence intervals of 95 % from independent stretches or groups of samples.",
            ),
            Self::Folds => (
                "Cross-validation",
                "Cross-validate",
                "Every sample of a recording tested by a network trained on the other folds: one training per fold.",
            ),
        };
        TopicWords { name, verb, meaning }
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

/// Largest number of folds offered.
const MAX_FOLDS: usize = 1000;

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

    /// Returns the task of the form, checked as far as possible without beginning. `train` is the setup of the Train view;
    /// times are measured only while it `is_quiet`.
    ///
    /// # Errors
    /// If the form is not valid, or the Train view has no source; the message says what to do.
    pub fn task(&self, train: &Result<Setup, String>, is_quiet: &Arc<AtomicBool>) -> Result<Task, String> {
        let (setup, size) = match self {
            Self::Experiment(form) => return form.task(train),
            Self::Speed(form) => return form.task(train.as_ref()?, is_quiet),
            Self::Readings => (train.clone()?, String::new()),
            Self::Folds(folds) => (train.clone()?, format!(", {}", counted(*folds, "training"))),
        };
        if setup.plan().is_none() {
            return Err(
                "This is about recordings: choose one as the source in the Train view. The Sensor view shows \
                        what the readings of an array determine."
                    .to_owned(),
            );
        }
        let (form, of) = (self.clone(), setup.clone());
        Ok(Task {
            size: format!("{}{size}", setup.source_name()),
            outcome: Box::new(None::<Report>),
            setup: Some(setup),
            run: Box::new(move |reporter| match form {
                Self::Folds(folds) => readings::cross_validate(&of, folds, reporter),
                _ => readings::find(&of, reporter),
            }),
        })
    }

    /// Shows the fields.
    pub fn fields_ui(&mut self, ui: &mut Ui, train: &Result<Setup, String>) {
        match self {
            Self::Experiment(form) => form.fields_ui(ui, train),
            Self::Speed(form) => form.fields_ui(ui, train.as_ref().is_ok_and(|setup| setup.plan().is_none())),
            Self::Readings => {}
            Self::Folds(folds) => {
                section_heading_ui(ui, "Folds");
                let hint = "Number of parts. Each part is tested by networks trained on the other parts.";
                count_ui(ui, "Folds", hint, folds, 2..=MAX_FOLDS);
            }
        }
    }
}

/// Work of a background job.
pub struct Task {
    /// How much work it is.
    pub size: String,
    /// The outcome without results.
    pub outcome: Box<dyn Outcome>,
    /// Setup of the recording, if it is about the one of the Train view.
    pub setup: Option<Setup>,
    /// Does the work, or says why that is not possible and what to do.
    pub run: Box<dyn FnOnce(&Reporter) -> Result<(), String> + Send>,
}

/// Sending end of the events of a task.
pub(in crate::window) type Reporter = job::Report<StudyEvent>;

/// Event of the newest task.
#[derive(Debug)]
pub enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// A recording has been read, with these channels.
    Problem(Arc<Problem>),
    /// A trial has finished or failed.
    Trial(Box<Finished>),
    /// The samples of a run are ready: the unit for which decoding is timed, such as "a sample", and the origin of recorded
    /// ones.
    Samples(usize, String, Option<Box<Recorded>>),
    /// A point of a run is measured, with the file of its network if it has one.
    Point(usize, Box<TradeOffPoint>, Option<Arc<NetworkFile>>),
    /// A decoder cannot be used with the samples of a run, with the reason.
    Refused(usize, String),
    /// Results of work that has none before its end.
    Report(Box<Report>),
    /// The work has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// Results so far.
pub trait Outcome: Debug {
    /// Adds what an event reports.
    fn take(&mut self, event: StudyEvent);

    /// Returns the numbers of finished and of planned parts, and the name of a part; no name for work without parts.
    fn parts(&self) -> (usize, usize, &'static str);

    /// Returns the results so far, with the decoders recommended within these limits.
    fn report(&self, limits: &TradeOffLimits) -> Report;

    /// Returns what opens an item of a page in the Train view.
    fn open(&self, _page: usize, _item: usize) -> Vec<Effect> {
        Vec::new()
    }

    /// Returns the decoder of an item, and what it is exported from.
    fn decoder(&self, _page: usize, _item: usize) -> Option<(DecoderKind, NetworkSource)> {
        None
    }

    /// Returns tables for programs, with their names.
    fn tables(&self) -> Vec<(&'static str, Box<dyn Fn() -> Table + '_>)> {
        Vec::new()
    }

    /// Returns the table with the settings behind it as Markdown, if there is one.
    fn markdown(&self) -> Option<Vec<u8>> {
        None
    }
}

/// Of work that has no results before its end.
impl Outcome for Option<Report> {
    fn take(&mut self, event: StudyEvent) {
        if let StudyEvent::Report(report) = event {
            *self = Some(*report);
        }
    }

    fn parts(&self) -> (usize, usize, &'static str) {
        (usize::from(self.is_some()), 1, "")
    }

    fn report(&self, _limits: &TradeOffLimits) -> Report {
        self.clone().unwrap_or_default()
    }
}
