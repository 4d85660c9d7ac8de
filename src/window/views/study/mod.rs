//! The Study view: many trainings or measurements at once, and what they show together.
//!
//! Every topic works alike. Its [`Form`] makes a [`Task`], a background job carries the task out and sends [`StudyEvent`]s, an
//! [`Outcome`] collects them, and its [`Report`] of tables, figures and notes is shown. A new topic is a variant of [`Topic`]
//! and of [`Form`], and a file with its form, its work and its outcome.

mod experiment;
mod readings;
mod report;
mod speed;
mod state;
mod sweep_folder;
mod value_list;
mod view;

use std::{fmt::Debug, sync::Arc};

use decoupler_core::{
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

use crate::window::{
    job,
    shared::{Effect, Exporting},
    widgets::{fields::count_ui, section_heading_ui},
};

use experiment::ExperimentForm;
use report::{Note, Page, Report, Row, Tone};
use speed::SpeedForm;
use state::Study;
pub use state::StudyView;
use value_list::ValueList;

/// What is studied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Topic {
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

impl Topic {
    /// All topics, in the order of the list.
    const ALL: [Self; 7] = [
        Self::Table(PaperTable::HiddenNodes),
        Self::Table(PaperTable::CrossValidation),
        Self::Table(PaperTable::ArrayScales),
        Self::Sweep,
        Self::Speed,
        Self::Readings,
        Self::Folds,
    ];

    /// Returns its name, and what it is about.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::Table(table) => [["Table 1", "Table 2", "Table 3"][table as usize], table.title()],
            Self::Sweep => ["Sweep", "Any two settings varied against each other, all others fixed."],
            Self::Speed => [
                "Speed against accuracy",
                "The error, the time for a frame and the training time of every decoder, on this machine.",
            ],
            Self::Readings => [
                "What the readings determine",
                "How well the readings of a recording determine each target, measured on held-out samples in seconds.",
            ],
            Self::Folds => [
                "Cross-validation",
                "Every sample of a recording tested by a network trained on the other folds: one training per fold.",
            ],
        }
    }

    fn name(self) -> &'static str {
        self.words()[0]
    }
}

/// Form of a topic.
#[derive(Clone, Debug, PartialEq)]
enum Form {
    /// A table or a sweep.
    Experiment(Box<ExperimentForm>),
    /// Speed against accuracy.
    Speed(SpeedForm),
    /// What the readings determine, or a cross-validation with a number of folds.
    Recording(Option<usize>),
}

/// Largest number of folds offered.
const MAX_FOLDS: usize = 1000;

impl Form {
    /// Returns the default form of a topic.
    fn new(topic: Topic) -> Self {
        match topic {
            Topic::Table(table) => Self::Experiment(ExperimentForm::table(table).into()),
            Topic::Sweep => Self::Experiment(ExperimentForm::sweep().into()),
            Topic::Speed => Self::Speed(SpeedForm::default()),
            Topic::Readings => Self::Recording(None),
            Topic::Folds => Self::Recording(Some(5)),
        }
    }

    /// Returns the task of the form, checked as far as possible without beginning. `train` is the setup of the Train view.
    ///
    /// # Errors
    /// If the form is not valid, or the Train view has no source; the message says what to do.
    fn task(&self, train: &Result<Setup, String>) -> Result<Task, String> {
        let folds = match self {
            Self::Experiment(form) => return form.task(train),
            Self::Speed(form) => return form.task(train.as_ref()?),
            Self::Recording(folds) => *folds,
        };
        let setup = train.clone()?;
        if setup.plan().is_none() {
            return Err("This is about recordings: choose one in the Train view; Sensor is about arrays.".to_owned());
        }
        let trainings = folds.map_or_else(String::new, |folds| format!(", {}", counted(folds, "training")));
        let (size, of) = (format!("{}{trainings}", setup.source_name()), setup.clone());
        let mut task = Task::new(size, None::<Report>, move |reporter| match folds {
            Some(folds) => readings::cross_validate(&of, folds, reporter),
            None => readings::find(&of, reporter),
        });
        task.study.setup = Some(setup);
        Ok(task)
    }

    /// Shows the fields.
    fn fields_ui(&mut self, ui: &mut Ui, train: &Result<Setup, String>) {
        match self {
            Self::Experiment(form) => form.fields_ui(ui, train),
            Self::Speed(form) => form.fields_ui(ui, train.as_ref().is_ok_and(|setup| setup.plan().is_none())),
            Self::Recording(None) => {}
            Self::Recording(Some(folds)) => {
                section_heading_ui(ui, "Folds");
                let hint = "Number of parts. Each part is tested by networks trained on the other parts.";
                count_ui(ui, "Folds", hint, folds, 2..=MAX_FOLDS);
            }
        }
    }
}

/// Work of a background job, and the results without results.
struct Task {
    study: Study,
    /// Does the work, or says why that is not possible and what to do.
    run: Box<Work>,
}

type Work = dyn FnOnce(&Reporter) -> Result<(), String> + Send;

impl Task {
    fn new(
        size: String,
        outcome: impl Outcome + 'static,
        run: impl FnOnce(&Reporter) -> Result<(), String> + Send + 'static,
    ) -> Self {
        Self {
            study: Study::new(size, Box::new(outcome)),
            run: Box::new(run),
        }
    }
}

/// Sending end of the events of a task.
type Reporter = job::Report<StudyEvent>;

/// Event of the newest task.
#[derive(Debug)]
enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// A recording has been read, with these channels.
    Problem(Arc<Problem>),
    /// A trial has finished or failed.
    Trial(Box<Finished>),
    /// The samples of a run are ready, with their noise if they are simulated, the unit for which decoding is timed, "a
    /// sample", and the origin of recorded ones.
    Samples(Option<f64>, String, Option<Box<Recorded>>),
    /// A point of a run is measured, with its setup, and the file of its network if it has one.
    Point(Box<TradeOffPoint>, Box<Setup>, Option<Arc<NetworkFile>>),
    /// A decoder cannot be used with the samples of a run, with the reason.
    Refused(String),
    /// Results of work that has none before its end.
    Report(Box<Report>),
    /// The work has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// A table and its name.
type NamedTable<'a> = (&'static str, Box<dyn Fn() -> Table + 'a>);

/// Results so far.
trait Outcome: Debug {
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

    /// Returns the export of the decoder of an item, if it has one.
    fn decoder(&self, _page: usize, _item: usize) -> Option<Exporting> {
        None
    }

    /// Returns tables for programs, with their names.
    fn tables(&self) -> Vec<NamedTable<'_>> {
        Vec::new()
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
