use std::{
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
};

use super::{
    charts::ChartChoice,
    checking::Checking,
    draft::{Draft, file_name},
    model::{Trained, Validated},
    opening::{Opened, Opening, ToOpen},
    remarks::in_window,
    runs::RunsOfSession,
    training::{Command, Task, Trainer, TrainingEvent},
};
use crate::{
    app::{
        job::Wake,
        shared::{Effect, Matter, Notice, Phase},
    },
    evaluation::{Measured, RunSettings},
    import::{DialectChoice, Meaning, Progress},
    scene::RowModel,
};

/// The Own data view.
#[derive(Debug)]
pub struct OwnDataView {
    /// The import, once files are open.
    pub(super) draft: Option<Draft>,
    pub(super) opening: Opening,
    pub(super) checking: Checking,
    /// Settings of the next training.
    pub(super) settings: RunSettings,
    /// Number of folds of a cross-validation.
    pub(super) folds: usize,
    trainer: Trainer,
    /// State of the trainer.
    pub(super) phase: Phase,
    /// How far a file is read before a training.
    pub(super) reading: Option<Progress>,
    /// The network on show: in training, ended, or opened.
    pub(super) shown: Option<Trained>,
    /// Settings with which it was begun or last continued; the epochs are those asked for from where it stood.
    pub(super) asked: Option<RunSettings>,
    /// The last cross-validation.
    pub(super) validated: Option<Validated>,
    /// True while a cross-validation is under way.
    pub(super) is_validating: bool,
    pub(super) runs: RunsOfSession,
    /// Card in the middle.
    pub(super) tab: Tab,
    pub(super) chart: ChartChoice,
    /// Paths that the user chooses, in dialogs or by typing.
    pub(super) choices: Sender<PathBuf>,
    chosen: Receiver<PathBuf>,
    /// As [`Self::choices`], for files of test samples.
    pub(super) test_choices: Sender<PathBuf>,
    chosen_for_test: Receiver<PathBuf>,
}

/// Cards in the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Tab {
    /// The columns of the files, and what they mean.
    #[default]
    Columns,
    /// Charts of the network on show.
    Results,
    /// The networks of this session.
    Runs,
}

/// Settings of a new training: those of the library for measured samples with the starts and the stopping rules of the
/// terminal's.
fn settings() -> RunSettings {
    let mut settings = RunSettings::from(Measured { rows: RowModel::Shared });
    settings.starts = 3;
    settings.training.stopping.epochs = 150;
    settings.training.stopping.max_fail = 30;
    settings
}

impl OwnDataView {
    /// Nothing open yet. `wake` is called when there is news.
    pub fn new(wake: Wake) -> Self {
        let (choices, chosen) = channel();
        let (test_choices, chosen_for_test) = channel();
        Self {
            draft: None,
            opening: Opening::new(Arc::clone(&wake)),
            checking: Checking::new(Arc::clone(&wake)),
            settings: settings(),
            folds: 5,
            trainer: Trainer::new(wake),
            phase: Phase::Idle,
            reading: None,
            shown: None,
            asked: None,
            validated: None,
            is_validating: false,
            runs: RunsOfSession::default(),
            tab: Tab::default(),
            chart: ChartChoice::default(),
            choices,
            chosen,
            test_choices,
            chosen_for_test,
        }
    }

    /// Opens the files that the user has chosen.
    pub(super) fn take_chosen(&mut self) {
        let paths: Vec<PathBuf> = self.chosen.try_iter().collect();
        if !paths.is_empty() {
            self.open(paths);
        }
        let paths: Vec<PathBuf> = self.chosen_for_test.try_iter().collect();
        if let (Some(draft), false) = (&mut self.draft, self.phase.is_busy()) {
            paths.into_iter().for_each(|path| draft.add_test_file(path));
        }
    }

    /// Opens files: recordings are added to those that are open already.
    pub(super) fn open(&mut self, mut paths: Vec<PathBuf>) {
        if self.phase.is_busy() {
            return;
        }
        let mut dialect = DialectChoice::default();
        if let Some(draft) = &self.draft {
            let is_document = |path: &PathBuf| crate::export::DocumentKind::of_file(path).is_some();
            if !paths.iter().any(is_document) {
                let mut all = draft.paths();
                paths.retain(|path| !all.contains(path));
                all.append(&mut paths);
                paths = all;
                dialect = draft.plan.import.dialect;
            }
        }
        if !paths.is_empty() {
            self.opening.start(ToOpen::Files(paths, dialect));
        }
    }

    /// Closes a file; without the last one there is no import.
    pub(super) fn close(&mut self, file: usize) {
        let Some(draft) = &self.draft else { return };
        let mut paths = draft.paths();
        if file < paths.len() {
            paths.remove(file);
        }
        if paths.is_empty() {
            self.draft = None;
            self.opening.cancel();
        } else {
            let dialect = draft.plan.import.dialect;
            self.opening.start(ToOpen::Files(paths, dialect));
        }
    }

    /// Looks at the files anew, with the layout and the missing cells of the draft.
    pub(super) fn look_again(&mut self) {
        if let Some(plan) = self.draft.as_ref().and_then(|draft| draft.plan().ok()) {
            self.opening.start(ToOpen::Plan(Box::new(plan)));
        }
    }

    /// Reason for which no training can begin, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        match &self.draft {
            None => Some("Open a recording first: drop files on the window.".to_owned()),
            Some(_) if self.opening.under_way.is_some() => Some("Files are being opened.".to_owned()),
            Some(draft) => draft.obstacle(),
        }
    }

    /// Begins a training.
    pub(super) fn train(&mut self) {
        if self.phase.is_busy() || self.obstacle().is_some() {
            return;
        }
        let Some(plan) = self.draft.as_ref().and_then(|draft| draft.plan().ok()) else {
            return;
        };
        self.shown = None;
        self.asked = Some(self.settings);
        self.begin(Task::Train(Box::new(plan), self.settings));
    }

    /// Begins a cross-validation.
    pub(super) fn validate(&mut self) {
        if self.phase.is_busy() || self.obstacle().is_some() {
            return;
        }
        if let Some(plan) = self.draft.as_ref().and_then(|draft| draft.plan().ok()) {
            self.is_validating = true;
            // The thread that could go on is gone.
            self.asked = None;
            self.begin(Task::Validate(Box::new(plan), self.settings, self.folds));
        }
    }

    fn begin(&mut self, task: Task) {
        self.reading = None;
        self.phase = Phase::Preparing;
        self.trainer.start(task);
    }

    /// Holds the training, or goes on with it.
    pub(super) fn toggle_pause(&mut self) {
        if self.phase == Phase::Paused {
            self.trainer.command(Command::Resume);
        } else {
            self.trainer.command(Command::Pause);
        }
    }

    /// Ends the training; what is still being prepared does not begin.
    pub(super) fn stop(&mut self) {
        if self.phase == Phase::Preparing {
            self.trainer.cancel();
            self.is_validating = false;
            self.phase = self.phase_at_rest();
        } else {
            self.trainer.command(Command::Stop);
        }
    }

    /// Tells whether the training on show can go on with the settings as they are now.
    pub(super) fn can_continue(&self) -> bool {
        let (Some(shown), Some(asked)) = (&self.shown, self.asked) else {
            return false;
        };
        let is_there = match self.phase {
            Phase::Paused => self.settings.training != asked.training,
            Phase::Ended(reason) => reason != crate::training::StopReason::Diverged,
            _ => false,
        };
        let is_same_plan = || {
            self.draft
                .as_ref()
                .and_then(|draft| draft.plan().ok())
                .map(|plan| plan.absolute())
        };
        let fixed = RunSettings {
            training: asked.training,
            ..self.settings
        };
        is_there && fixed == asked && shown.checkpoint.is_some() && is_same_plan().as_ref() == Some(&shown.file.plan)
    }

    /// Goes on from the present weights.
    pub(super) fn go_on(&mut self) {
        if self.can_continue() {
            self.asked = Some(self.settings);
            self.trainer.command(Command::Continue(self.settings.training));
        }
    }

    fn phase_at_rest(&self) -> Phase {
        self.shown.as_ref().map_or(Phase::Idle, |shown| match shown.phase {
            ended @ Phase::Ended(_) => ended,
            _ => Phase::Idle,
        })
    }

    /// Shows a run of the list; its settings and plan become those of the form.
    pub(super) fn show_run(&mut self, place: usize) {
        if self.phase.is_busy() {
            return;
        }
        if let Some(run) = self.runs.get(place) {
            self.settings = run.file.settings.into();
            self.opening.start(ToOpen::Plan(Box::new(run.file.plan.clone())));
            self.show(run.clone(), None);
            self.tab = Tab::Results;
        }
    }

    fn show(&mut self, trained: Trained, asked: Option<RunSettings>) {
        self.trainer.cancel();
        self.phase = trained.phase;
        self.asked = asked;
        self.chart.fit(&trained.file.targets);
        self.shown = Some(trained);
    }

    /// Takes what the threads have to tell.
    pub(super) fn follow(&mut self, effects: &mut Vec<Effect>) {
        if let Some(opened) = self.opening.next_opened() {
            match opened {
                Ok(opened) => {
                    effects.push(Effect::Settle(Matter::OwnData));
                    self.take(opened);
                }
                Err(reason) => effects.push(failed(&reason)),
            }
        }
        while let Some(event) = self.trainer.next_event() {
            self.take_training(event, effects);
        }
        let draft = self.draft.as_ref().filter(|draft| draft.obstacle().is_none());
        let plan = draft.and_then(|draft| draft.plan().ok());
        // The machine is for the training then.
        if !self.phase.is_busy() {
            self.checking.follow(plan, self.settings.seed);
        }
    }

    fn take(&mut self, opened: Opened) {
        match opened {
            Opened::Recordings(draft) => {
                let draft = match &self.draft {
                    Some(older) => draft.keeping(older),
                    None => *draft,
                };
                self.tab = Tab::Columns;
                self.draft = Some(draft);
                self.set_held_out();
            }
            Opened::Import(draft) => {
                self.draft = Some(*draft);
            }
            Opened::Network(trained, draft) => {
                self.draft = draft.map(|draft| *draft).or(self.draft.take());
                self.settings = trained.file.settings.into();
                self.runs.keep(&trained);
                self.show(*trained, None);
                self.tab = Tab::Results;
            }
            Opened::Checkpoint(path, file, draft) => {
                self.draft = draft.map(|draft| *draft).or(self.draft.take());
                self.settings = file.settings.into();
                self.shown = None;
                self.asked = Some(self.settings);
                self.tab = Tab::Results;
                self.begin(Task::Resume(path, file));
            }
        }
    }

    /// Holds out for validation what the method needs.
    pub(super) fn set_held_out(&mut self) {
        let fraction = self.settings.validation_fraction();
        if let Some(draft) = &mut self.draft {
            draft.plan.division.validation_fraction = fraction;
        }
    }

    fn take_training(&mut self, event: TrainingEvent, effects: &mut Vec<Effect>) {
        match event {
            TrainingEvent::Reading(progress) => self.reading = Some(progress),
            TrainingEvent::Progressed(mut trained) => {
                let is_first = self.shown.is_none();
                trained.name = self.runs.name_of(&trained);
                self.phase = trained.phase;
                if is_first {
                    effects.push(Effect::Settle(Matter::OwnData));
                    self.tab = Tab::Results;
                    self.chart.fit(&trained.file.targets);
                }
                if let Phase::Ended(_) = trained.phase {
                    self.runs.keep(&trained);
                }
                self.shown = Some(*trained);
            }
            TrainingEvent::Validated(validated) => {
                self.validated = Some(*validated);
                self.tab = Tab::Results;
            }
            TrainingEvent::Refused(reason) => effects.push(failed(&reason)),
            TrainingEvent::Ended(ended) => {
                if let Err(reason) = ended {
                    effects.push(failed(&reason));
                }
                self.is_validating = false;
                if self.phase.is_busy() {
                    self.phase = self.phase_at_rest();
                }
            }
        }
    }

    /// Name of the recording, for names of files.
    pub(super) fn stem(&self) -> String {
        let draft = self.draft.as_ref();
        let name = draft
            .map(|draft| file_name(&draft.plan.import.data))
            .unwrap_or_default();
        match name.rsplit_once('.') {
            Some((stem, _)) => stem.to_owned(),
            None => name,
        }
    }

    /// Tells whether there is a column of row-wires.
    pub(super) fn has_row_wires(&self) -> bool {
        self.draft.as_ref().is_some_and(|draft| draft.has(Meaning::RowWire))
    }
}

fn failed(reason: &str) -> Effect {
    Effect::Tell(Matter::OwnData, Notice::Failed(in_window(reason)))
}
