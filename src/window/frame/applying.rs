use std::{
    path::PathBuf,
    sync::{Arc, mpsc::channel},
};

use eframe::egui::ColorImage;

use super::{DecouplerWindow, files::ToWrite, modal::Modal, remembered::is_within_limits, save_form::Saving};
use crate::window::{
    job::{JobError, caught},
    preview,
    shared::{
        Effect, FileInUse, FileTask, Look, Matter, Notice, OpenPlan, Phase, Purpose, RecordingDraft, RunsRequest,
        SourceKind, ToCopy, ViewKind,
    },
    theme,
    training_worker::{LOST, Origin, Request, RunView, TrainedRun, Worker},
    views::CHECKPOINT,
};
use decoupler_core::{evaluation::RunSettings, training::StopReason};
use decoupler_files::import::Setup;

impl DecouplerWindow {
    /// Applies an effect requested by a view.
    pub fn apply(&mut self, effect: Effect) {
        let shared = &mut self.shared;
        match effect {
            Effect::Configure(draft) if draft.simulation().is_some() => self.configure(*draft),
            Effect::Configure(settings) => {
                // Settings that the user gives are not chosen, except for those that a choice keeps.
                let RunSettings { source, seed, .. } = *settings;
                let kept = RunSettings {
                    source,
                    seed,
                    ..shared.recording.settings
                };
                shared.recording.is_auto &= *settings == kept;
                shared.recording.settings = *settings;
                self.notices.settle(Matter::Settings);
            }
            Effect::ChooseAutomatically(is_auto) => self.choose_automatically(is_auto),
            Effect::Import(plan) => shared.recording.plan = plan.map(OpenPlan),
            Effect::ChooseSource(source) if !shared.phase.is_busy() => self.choose_source(source),
            Effect::ChooseSource(_) => {}
            Effect::TakeSetup(setup) => self.take_setup(&setup),
            Effect::Do(command) => self.carry_out(&command),
            Effect::OpenRun(id) => self.open_run(id, true),
            // A training may have begun in the same frame.
            Effect::OpenTraining(_) | Effect::TakeUp(..) if shared.phase.is_busy() => {}
            Effect::OpenTraining(path) => self.begin(Origin::File(path)),
            Effect::TakeUp(setup, states) => {
                self.take_setup(&setup);
                self.begin(Origin::States(setup, states));
            }
            Effect::UseRidge => self.worker.ask(Request::UseRidge),
            Effect::Look(look) => self.look(look),
            Effect::ChooseFile(task) => {
                if !self.dialogs.ask(&task) {
                    self.type_path(task);
                }
            }
            Effect::Export(exporting) => self.modal = Some(Modal::Export(*exporting)),
            Effect::Copy(ToCopy::Text(text), notice) => {
                self.ctx.copy_text(text);
                self.notices.add(Matter::Clipboard, Notice::Done(notice));
            }
            Effect::Copy(ToCopy::Picture(figure), notice) => {
                let draw = move |_: &_| match figure.draw().pixels() {
                    Ok((size, rgba)) => Ok((ColorImage::from_rgba_unmultiplied(size, &rgba), notice)),
                    Err(error) => Err(error.to_string()),
                };
                let last = |drawn: Result<_, JobError>| drawn.map_err(|error| error.to_string()).flatten();
                self.pictures.start(draw, last);
            }
            Effect::ChangeRuns(request) => self.runs.ask(request),
            Effect::Notify(matter, notice) => self.notices.add(matter, notice),
            Effect::Settle(matter) => self.notices.settle(matter),
        }
    }

    /// Requests a training that replaces the displayed one.
    pub(super) fn begin(&mut self, origin: Origin) {
        self.opened = match &origin {
            Origin::File(path) => Some(path.clone()),
            _ => None,
        };
        self.shared.phase = Phase::Preparing;
        self.notices.settle(Matter::Training);
        self.notices.settle(Matter::Settings);
        if self.worker.has_died() {
            self.restart_worker();
        }
        self.worker.begin(origin);
    }

    /// Opens a run of the list, chosen by the user or the last one after the start.
    pub(super) fn open_run(&mut self, id: u64, is_chosen: bool) {
        let runs = &self.shared.runs;
        let Some(run) = runs.run(id).cloned() else { return };
        let folder = runs.path.clone().unwrap_or_default();
        let open = move |_: &_| {
            let file = run.load(&folder).map_err(|error| error.to_string());
            let opened = file.and_then(|file| RunView::kept(run.name.clone(), file));
            let opened = opened.map_err(|error| format!("The run '{}' cannot be opened: {error}", run.name));
            (is_chosen, opened.map(Box::new))
        };
        self.opening.start(open, |opened| {
            opened.unwrap_or_else(|error| (true, Err(error.to_string())))
        });
    }

    /// Shows a run of the list: with its settings if the user chose it, otherwise if it is of those on the left.
    pub(super) fn take_opened(&mut self, is_chosen: bool, mut run: RunView) {
        let shared = &mut self.shared;
        if shared.phase.is_busy() {
            return;
        }
        if !is_chosen {
            let Ok(asked) = shared.asked() else { return };
            let has_same = match (&asked.plan, run.setup.plan()) {
                (Some(plan), Some(of_run)) => plan.files() == of_run.files(),
                _ => have_same_test_set(&asked.settings, run.settings()),
            };
            if !has_same || shared.run.is_some() {
                return;
            }
            if run.search.is_some() && shared.recording.is_automatic() {
                run.asked = asked;
            }
        }
        let reason = run.stop_reason.unwrap_or(StopReason::Stopped);
        self.show_run(run, Phase::Ended(reason), is_chosen);
        if is_chosen {
            self.opened = None;
            self.show(ViewKind::Train);
        }
    }

    /// Starts the worker again after it died.
    pub(super) fn restart_worker(&mut self) {
        self.worker = Worker::start(&self.jobs);
        self.keep_trainings();
    }

    /// Chooses settings automatically from now on, or begins with those that were chosen.
    fn choose_automatically(&mut self, is_auto: bool) {
        let chosen = self.shared.chosen_run().map(|run| run.setup.clone());
        self.shared.recording.is_auto = is_auto;
        if let (false, Some(setup)) = (is_auto, chosen) {
            self.take_setup(&setup);
            // Given by hand, these settings would have had the same result.
            let asked = self.shared.asked();
            if let (Some(run), Ok(asked)) = (&mut self.shared.run, asked) {
                run.asked = asked;
            }
        }
    }

    /// Shows a view.
    pub(super) fn show(&mut self, view: ViewKind) {
        self.shared.shown = view;
        // Another window may have changed the list.
        self.runs.ask(RunsRequest::Look);
    }

    /// Sets the look of all surfaces, and remembers the theme and the colours that the user chose.
    pub(super) fn look(&mut self, look: Look) {
        let before = std::mem::replace(&mut self.shared.look, look);
        if look.colours != before.colours {
            self.chosen.colours = Some(look.colours);
        }
        if look.is_dark != before.is_dark {
            self.chosen.is_dark = Some(look.is_dark);
            theme::apply(&self.ctx, look.is_dark);
        }
    }

    /// Asks for a path in the window itself.
    pub(super) fn type_path(&mut self, task: FileTask) {
        let path = task.suggested_path().display().to_string();
        self.modal = Some(Modal::Path(Saving::new(task, path, None)));
    }

    /// Closes the form and carries out its task on the file at `path`; `asks` whether a file there may be replaced.
    pub(super) fn take_typed(&mut self, path: PathBuf, asks: bool) {
        if let Some(Modal::Path(typed)) = self.modal.take() {
            self.answer(typed.task, path, asks);
        }
        self.ctx.request_repaint();
    }

    /// Returns the files in use, which the file of `task` must not overwrite.
    fn files_in_use(&mut self, task: &FileTask) -> Vec<FileInUse> {
        let mut used = Vec::new();
        for view in ViewKind::ALL {
            used.extend(self.views.get(view).holdings(&self.shared).files);
        }
        used.extend(self.opened.clone().map(FileInUse::Checkpoint));
        // A checkpoint may be saved over the one before it.
        let is_checkpoint = task.words.kind == CHECKPOINT.kind;
        used.retain(|used| !(is_checkpoint && matches!(used, FileInUse::Checkpoint(_))));
        used.extend(self.shared.runs.path.clone().map(FileInUse::Kept));
        used
    }

    /// Carries out `task` on the file at `path`; `asks` whether a file there may be replaced. A dialog of the desktop has
    /// asked, but does not know which files are in use.
    pub(super) fn answer(&mut self, task: FileTask, path: PathBuf, asks: bool) {
        match &task.purpose {
            Purpose::Save(contents) | Purpose::Decode(contents) => {
                let (send, taken) = channel();
                let (run, contents) = (contents.run, contents.clone());
                let take = move |trained: Result<Option<&TrainedRun>, &str>| {
                    // The training continues if this panics.
                    let taken = caught("training", || {
                        trained
                            .map_err(str::to_owned)
                            .and_then(|trained| contents.take(trained))
                    });
                    // The thread that writes the file is waiting for it.
                    let _ = send.send(taken.map_err(|error| error.to_string()).flatten());
                };
                match run {
                    Some(run) => {
                        let inspection = Box::new(move |trained: Result<&TrainedRun, &str>| take(trained.map(Some)));
                        self.worker.ask(Request::Inspect(run, inspection));
                    }
                    None => take(Ok(None)),
                }
                let used = if task.is_read() {
                    Vec::new()
                } else {
                    self.files_in_use(&task)
                };
                self.files.write(ToWrite { task, path, asks }, used, move |path| {
                    let taken = taken.recv().unwrap_or_else(|_| Err(LOST.to_owned()));
                    taken?(path)
                });
            }
            Purpose::Choose(chosen) => {
                // A view that has asked for another file since has no use for this one.
                let _ = chosen.send(path);
                self.ctx.request_repaint();
            }
        }
    }

    /// Takes new settings; if they change the test set, shows that of the new ones.
    pub(super) fn configure(&mut self, draft: RunSettings) {
        let before = std::mem::replace(&mut self.shared.draft, draft);
        self.notices.settle(Matter::Preview);
        if is_within_limits(&draft) {
            self.notices.settle(Matter::Settings);
        }
        if !have_same_sets(&before, &draft) {
            self.request_preview();
        }
    }

    /// Selects the kind of source to train on.
    pub(super) fn choose_source(&mut self, source: SourceKind) {
        self.shared.source = source;
        self.notices.settle(Matter::Settings);
        if source == SourceKind::Array {
            self.request_preview();
        }
    }

    /// Uses the setup of another run for the next training.
    pub(super) fn take_setup(&mut self, setup: &Setup) {
        match setup.plan() {
            None => {
                self.shared.source = SourceKind::Array;
                self.configure(*setup.settings());
            }
            Some(plan) => {
                self.shared.source = SourceKind::Recording;
                let plan = plan.absolute();
                self.views.open_plan(&plan);
                self.shared.recording = RecordingDraft {
                    settings: *setup.settings(),
                    is_auto: false,
                    plan: Ok(OpenPlan(Arc::new(plan))),
                };
            }
        }
    }

    /// Requests the test set and baselines shown before a training, unless the current training has them.
    pub(super) fn request_preview(&mut self) {
        let shared = &mut self.shared;
        let draft = shared.draft;
        if shared
            .run
            .as_ref()
            .is_some_and(|run| have_same_test_set(run.settings(), &draft))
        {
            shared.preview = None;
            return self.previews.abandon();
        }
        let preview = shared.preview.as_ref();
        let is_known = preview.is_some_and(|preview| have_same_test_set(&preview.settings, &draft));
        preview::request(&mut self.previews, draft, is_known);
    }
}

/// Returns true if both draw the same test set.
fn have_same_test_set(a: &RunSettings, b: &RunSettings) -> bool {
    let test_set = |settings: &RunSettings| {
        let simulation = settings.simulation()?;
        Some((
            simulation.sensor,
            simulation.scene,
            simulation.test_samples,
            settings.seed,
        ))
    };
    test_set(a).is_some() && test_set(a) == test_set(b)
}

/// Returns true if both draw the same samples, trained on or not.
fn have_same_sets(a: &RunSettings, b: &RunSettings) -> bool {
    (a.source, a.seed) == (b.source, b.seed)
}
