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
    curves::Curves,
    draft::{Draft, file_name},
    exports::CHECKPOINT,
    judging::Measuring,
    keeping::Keeping,
    model::{Trained, Validated},
    opening::{Files, Opening, ToOpen},
    planned::Planned,
    runs::Runs,
    surfaces::SurfacesChoice,
    training::{Command, Task, Trainer, ValidationChoice},
};
use crate::{
    app::{
        job::Wake,
        shared::{FileTask, Phase, Unfinished},
    },
    evaluation::{Measured, RunSettings},
    import::{Meaning, Plan, Progress},
    scene::RowModel,
    sensor::counted,
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
    /// Extent of the next cross-validation.
    pub(super) validation: ValidationChoice,
    pub(super) trainer: Trainer,
    /// State of the trainer.
    pub(super) phase: Phase,
    /// Settings of the training that is beginning, until its first news.
    pub(super) beginning: Option<RunSettings>,
    /// Progress of reading a file before a training.
    pub(super) reading: Option<Progress>,
    /// The network on show: in training, ended, or opened.
    pub(super) shown: Option<Trained>,
    /// Settings with which it was begun or last continued; the epochs are those asked for from where it stood.
    pub(super) asked: Option<RunSettings>,
    /// Epochs of the training on show when it was opened from a checkpoint: while it is held there, nothing is unsaved.
    pub(super) saved_epochs: Option<usize>,
    /// The last cross-validation.
    pub(super) validated: Option<Validated>,
    /// True while a cross-validation is under way.
    pub(super) is_validating: bool,
    /// Findings on the readings, and other decoders.
    pub(super) measuring: Measuring,
    /// Networks trained and opened.
    pub(super) runs: Runs,
    pub(super) keeping: Keeping,
    /// Card in the middle.
    pub(super) tab: Tab,
    pub(super) chart: ChartChoice,
    pub(super) surfaces: SurfacesChoice,
    /// Paths that the user chooses, in dialogs or by typing.
    pub(super) choices: Sender<PathBuf>,
    pub(super) chosen: Receiver<PathBuf>,
    /// As [`Self::choices`], for files of test samples.
    pub(super) test_choices: Sender<PathBuf>,
    pub(super) chosen_for_test: Receiver<PathBuf>,
    /// As [`Self::choices`], for the file with positions of targets.
    pub(super) positions_choices: Sender<PathBuf>,
    pub(super) chosen_positions: Receiver<PathBuf>,
    /// The checkpoint that the training on show was resumed from.
    pub(super) checkpoint: Option<PathBuf>,
    /// Row-wires told apart or not, as chosen, also while no column has their numbers.
    pub(super) rows: RowModel,
    /// The epochs of the network on show, as far as its curves need them.
    pub(super) curves: Curves,
}

/// Cards in the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Tab {
    /// The columns of the files, and what they mean.
    #[default]
    Columns,
    /// Charts of the network on show.
    Results,
    /// Findings on the readings.
    Findings,
    /// Other decoders beside the network on show.
    Decoders,
    /// The networks of this session.
    Runs,
}

impl OwnDataView {
    /// Nothing open yet. `wake` is called when there is news.
    pub fn new(wake: Wake) -> Self {
        let (choices, chosen) = channel();
        let (test_choices, chosen_for_test) = channel();
        let (positions_choices, chosen_positions) = channel();
        Self {
            draft: None,
            opening: Opening::new(Arc::clone(&wake)),
            checking: Checking::new(Arc::clone(&wake)),
            settings: RunSettings::from(Measured { rows: RowModel::Shared }),
            validation: ValidationChoice {
                folds: 5,
                compares_random: false,
            },
            trainer: Trainer::new(Arc::clone(&wake)),
            phase: Phase::Idle,
            beginning: None,
            reading: None,
            shown: None,
            asked: None,
            saved_epochs: None,
            validated: None,
            is_validating: false,
            measuring: Measuring::new(Arc::clone(&wake)),
            runs: Runs::default(),
            keeping: Keeping::new(wake),
            tab: Tab::default(),
            chart: ChartChoice::default(),
            surfaces: SurfacesChoice::default(),
            choices,
            chosen,
            test_choices,
            chosen_for_test,
            positions_choices,
            chosen_positions,
            checkpoint: None,
            rows: RowModel::Shared,
            curves: Curves::default(),
        }
    }

    /// Opens files: recordings are added to those that are open already.
    pub(super) fn open(&mut self, paths: Vec<PathBuf>) {
        if !self.phase.is_busy() {
            let open = self.draft.as_ref().map(Draft::paths).unwrap_or_default();
            self.open_with(paths, open);
        }
    }

    /// Closes a recording; without the last one there is no import.
    pub(super) fn close(&mut self, file: usize) {
        let Some(draft) = &mut self.draft else { return };
        let mut paths = draft.paths();
        paths.remove(file);
        if paths.is_empty() {
            self.draft = None;
            self.opening.cancel();
        } else {
            self.open_with(Vec::new(), paths);
        }
    }

    /// Looks at the files anew, with the layout and the missing cells of the draft.
    pub(super) fn look_again(&mut self) {
        if let Some(draft) = &self.draft {
            self.open_with(Vec::new(), draft.paths());
        }
    }

    fn open_with(&mut self, new: Vec<PathBuf>, open: Vec<PathBuf>) {
        let older = self.draft.clone().map(Box::new);
        self.opening.start(ToOpen::Files(Files { new, open, older }));
    }

    /// Reason for which no training can begin, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        match &self.draft {
            None => Some("Open a recording first: drop files on the window.".to_owned()),
            Some(_) if self.opening.under_way.is_some() => Some("Files are being opened.".to_owned()),
            Some(_) if self.measuring.is_under_way() => {
                Some("Something is being measured: wait for its end, or stop it in its card.".to_owned())
            }
            Some(draft) => draft.obstacle(),
        }
    }

    /// Begins a training.
    pub(super) fn train(&mut self) {
        if self.phase.is_busy() || self.obstacle().is_some() {
            return;
        }
        let Some(planned) = self.planned() else { return };
        self.checkpoint = None;
        let plan = Box::new(planned.plan.clone());
        self.begin(Task::Train(plan, self.settings), Some(self.settings));
    }

    /// Begins a cross-validation.
    pub(super) fn validate(&mut self) {
        if self.phase.is_busy() || self.obstacle().is_some() {
            return;
        }
        if let Some(planned) = self.planned() {
            self.is_validating = true;
            let plan = Box::new(planned.plan.clone());
            self.begin(Task::Validate(plan, self.settings, self.validation), None);
        }
    }

    /// Begins a task; with these settings, if it is a training.
    pub(super) fn begin(&mut self, task: Task, settings: Option<RunSettings>) {
        self.reading = None;
        self.beginning = settings;
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
            self.beginning = None;
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
        let is_there = !self.measuring.is_under_way()
            && match self.phase {
                Phase::Paused => self.settings.training != asked.training,
                Phase::Ended(reason) => reason != crate::training::StopReason::Diverged,
                _ => false,
            };
        let fixed = RunSettings {
            training: asked.training,
            ..self.settings
        };
        is_there && fixed == asked && shown.checkpoint.is_some() && self.is_planned(&shown.file.plan)
    }

    /// Goes on from the present weights.
    pub(super) fn go_on(&mut self) {
        if !self.can_continue() {
            return;
        }
        if self.trainer.is_there() {
            self.asked = Some(self.settings);
        } else if let Some(file) = self.shown.as_ref().and_then(|shown| shown.checkpoint.clone()) {
            // Another task has taken the place of its thread since.
            self.begin(Task::TakeUp(file), Some(self.settings));
        }
        self.trainer.command(Command::Continue(self.settings.training));
    }

    /// The plan of the import, if it is complete.
    pub(super) fn planned(&self) -> Option<Arc<Planned>> {
        self.draft.as_ref()?.planned().ok()
    }

    /// Tells whether the import is still this one, whose paths are absolute.
    pub(super) fn is_planned(&self, plan: &Plan) -> bool {
        self.planned().is_some_and(|planned| planned.absolute == *plan)
    }

    pub(super) fn phase_at_rest(&self) -> Phase {
        self.shown.as_ref().map_or(Phase::Idle, |shown| match shown.phase {
            ended @ Phase::Ended(_) => ended,
            _ => Phase::Idle,
        })
    }

    /// Shows a network of the list; its settings and plan become those of the form.
    pub(super) fn show_run(&mut self, place: usize) {
        let Some((trained, path)) = self.runs.get(place).filter(|_| !self.phase.is_busy()) else {
            return;
        };
        match (&trained.tested, path) {
            // Its test samples are read again.
            (None, Some(path)) => {
                let new = vec![path.clone()];
                self.opening.start(ToOpen::Files(Files {
                    new,
                    ..Files::default()
                }));
            }
            _ => {
                let trained = trained.clone();
                self.take_settings(trained.file.settings.into());
                self.opening.start(ToOpen::Plan(Box::new(trained.file.plan.clone())));
                self.show(trained);
                self.tab = Tab::Results;
            }
        }
    }

    pub(super) fn show(&mut self, trained: Trained) {
        self.trainer.cancel();
        self.phase = trained.phase;
        self.asked = Some(trained.file.settings.into());
        self.saved_epochs = None;
        self.chart.fit(&trained);
        self.put_on_show(trained);
    }

    /// Shows a network, or how it stands by now.
    pub(super) fn put_on_show(&mut self, trained: Trained) {
        self.curves.follow(&trained.file.training.history);
        self.shown = Some(trained);
    }

    /// Takes the settings of a network.
    pub(super) fn take_settings(&mut self, settings: RunSettings) {
        self.rows = settings.source.row_model();
        self.settings = settings;
    }

    /// The training or cross-validation that closing would lose.
    pub(super) fn unfinished_work(&self) -> Option<Unfinished> {
        let training = |progress, saving| Unfinished {
            work: "Training",
            progress,
            saving,
            is_kept: self.keeping.folder.is_some(),
        };
        match (self.phase, &self.shown) {
            (Phase::Preparing, _) if self.is_validating => {
                let progress = counted(self.validation.folds, "fold");
                Some(Unfinished::discarded("Cross-validation", progress))
            }
            (Phase::Preparing, _) => Some(training("the files are being read".to_owned(), None)),
            (Phase::Paused, Some(shown)) if self.saved_epochs == Some(shown.epochs_run) => None,
            (Phase::Training | Phase::Paused, Some(shown)) => {
                let epochs = shown.file.settings.training.stopping.epochs;
                Some(training(
                    format!("epoch {} of {epochs}", shown.epochs_run),
                    self.checkpoint_task(),
                ))
            }
            _ => None,
        }
    }

    /// Task of saving the training that the thread has.
    pub(super) fn checkpoint_task(&self) -> Option<FileTask> {
        let contents = self.trainer.checkpoint()?;
        Some(FileTask::save(
            CHECKPOINT,
            &format!("{}-training", self.stem()),
            contents,
        ))
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
