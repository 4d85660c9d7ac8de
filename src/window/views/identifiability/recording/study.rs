use super::work::{FoldsResult, RecordingFindings, Task, work};
use crate::window::{
    job::{Job, Wake},
    shared::{Effect, Matter, Notice, Unfinished},
};
use decoupler_core::evaluation::recorded::{FittedModel, Stage};
use decoupler_files::import::{Progress, Setup};

/// Study of a recording: the window's end of the thread, and what it has measured.
#[derive(Debug)]
pub struct RecordingStudy {
    job: Job<StudyEvent>,
    /// The work under way.
    pub(super) under_way: Option<UnderWay>,
    /// Progress of reading a file.
    pub(super) reading: Option<Progress>,
    /// Findings on the recording, once they were measured.
    pub(super) found: Option<Box<RecordingFindings>>,
    /// Errors of the last cross-validation.
    pub(super) validated: Option<Box<FoldsResult>>,
    /// Model to be fitted again and again; the better of both if none is chosen.
    pub(super) model: Option<FittedModel>,
    /// Extent of a cross-validation.
    pub(super) choice: FoldsChoice,
    /// Target of the learning curve.
    pub(super) target: usize,
}

/// Extent of a cross-validation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoldsChoice {
    /// Number of folds.
    pub folds: usize,
    /// True if the same is done with random folds, which shows how optimistic they are.
    pub compares_random: bool,
}

/// Work of the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnderWay {
    /// Findings, and their part once the files are read.
    Findings(Option<Stage>),
    /// A cross-validation.
    CrossValidation,
}

/// Event of the thread.
#[derive(Debug)]
pub enum StudyEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// A part of the work has begun.
    Began(Stage),
    /// Findings on the recording.
    Found(Box<RecordingFindings>),
    /// The result of a cross-validation.
    Validated(Box<FoldsResult>),
    /// The thread has ended, with the reason if it could not go on.
    Ended(Result<(), String>),
}

impl RecordingStudy {
    /// Nothing measured yet. `wake` is called after each event.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("recording study", wake),
            under_way: None,
            reading: None,
            found: None,
            validated: None,
            model: None,
            choice: FoldsChoice {
                folds: 5,
                compares_random: false,
            },
            target: 0,
        }
    }

    /// Returns true while the thread computes.
    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// The work under way.
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

    /// Tests on every sample of the recording of `setup`.
    pub(super) fn cross_validate(&mut self, setup: Setup) {
        self.validated = None;
        self.start(UnderWay::CrossValidation, setup, Task::CrossValidation);
    }

    fn start(&mut self, under_way: UnderWay, setup: Setup, task: Task) {
        (self.under_way, self.reading) = (Some(under_way), None);
        let choice = self.choice;
        self.job.start(
            move |report| work(setup, &task, choice, report),
            |ended| StudyEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Abandons the work under way.
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
                        Err(reason) => Effect::Tell(Matter::Identifiability, Notice::Failed(reason)),
                    });
                }
            }
        }
    }
}
