use std::sync::mpsc::channel;

use super::{Action, DecouplerWindow, closing::Closing, decoupler_window::wake};
use crate::{
    app::{
        preview,
        shared::{Phase, RightCard, RunView, Saving, View, run_list},
        theme,
        training_worker::{LOST, Request, Worker},
        views::{
            compare::RunsAction,
            experiments,
            identifiability::{self, IdentifiabilityAction},
            trade_off,
            train::PaperFigure,
        },
    },
    evaluation::SimulatedSettings,
    training::StopReason,
};

impl DecouplerWindow {
    /// Does what the user meant.
    pub fn apply(&mut self, action: Action) {
        let state = &mut self.state;
        match action {
            Action::Configure(draft) => self.configure(*draft),
            Action::Train => {
                state.phase = Phase::Preparing;
                state.notice = None;
                self.worker.ask(Request::Train(Box::new(state.draft)));
            }
            Action::TakeUp(settings, states) => {
                // A training may have begun in the same frame.
                if !state.phase.is_busy() {
                    state.phase = Phase::Preparing;
                    state.notice = None;
                    self.worker.ask(Request::TakeUp(settings, states));
                }
            }
            Action::Pause => {
                state.phase = Phase::Paused;
                self.worker.ask(Request::Pause);
            }
            Action::Resume => {
                // The settings on the left are always those that are trained with.
                if let Some(run) = &mut state.run {
                    run.is_saved = false;
                    state.draft.training = run.asked.training;
                }
                state.phase = Phase::Training;
                self.measuring.forget(&mut state.decoders);
                self.worker.ask(Request::Resume);
            }
            Action::Continue if state.can_continue() => {
                state.phase = Phase::Training;
                state.notice = None;
                self.worker.ask(Request::Continue(state.draft.training));
            }
            Action::Continue => {}
            Action::Stop => {
                self.worker.ask(Request::Stop);
                // What was being prepared does not begin; the training before it stays.
                if state.phase == Phase::Preparing {
                    state.phase = state.phase_at_rest();
                }
            }
            Action::ShowSnapshot(snapshot) => {
                state.look.snapshot = snapshot;
                state.refresh_frames();
            }
            Action::GoTo(address) => {
                state.look.snapshot = address.snapshot;
                state.look.node = state.test().and_then(|test| test.node(address));
                state.refresh_frames();
            }
            Action::MoveCamera(camera) => state.look.camera = camera,
            Action::SetViewMode(mode) => state.look.mode = mode,
            Action::SetRightCard(right) => state.look.right = right,
            Action::HoverNode(node) => state.look.node = node,
            Action::ShowTab(tab) => state.look.tab = tab,
            Action::ShowErrorBars(has_error_bars) => {
                state.look.has_error_bars = has_error_bars;
                state.refresh_frames();
            }
            Action::ShowDecoders(is_open) => {
                state.decoders.is_open = is_open;
                self.measure_decoders();
            }
            Action::ShowPaperFigure(figure) => self.show_paper_figure(figure),
            Action::SetDark(is_dark) => {
                state.look.is_dark = is_dark;
                theme::apply(&self.ctx, is_dark);
            }
            Action::ChooseFile(task) => {
                if !self.dialogs.ask(task, &state.suggested_path(task), wake(&self.ctx)) {
                    self.apply(Action::TypePath(task));
                }
            }
            Action::TypePath(task) => {
                let typed = state.typed.clone().filter(|typed| typed.task == task);
                let suggested = || state.suggested_path(task).display().to_string();
                state.saving = Some(typed.unwrap_or_else(|| Saving {
                    task,
                    path: suggested(),
                }));
            }
            Action::EditPath(path) => {
                if let Some(saving) = &mut state.saving {
                    saving.path = path;
                }
            }
            Action::Export(kind, path) => {
                state.typed = state.saving.take();
                let (send, written) = channel();
                self.worker.ask(Request::Export(kind, path.clone(), send));
                if self.closing == Some(Closing::ChoosingPath) {
                    self.closing = Some(Closing::Finishing);
                }
                self.files
                    .write(path, move |_| written.recv().unwrap_or_else(|_| Err(LOST.to_owned())));
            }
            Action::ShowView(view) => {
                state.view = view;
                if view == View::Identifiability {
                    identifiability::enter(state, &mut self.identifiability);
                }
            }
            Action::Identifiability(IdentifiabilityAction::UseSensor) => {
                let settings = state.identifiability.hand_over(&state.draft);
                state.view = View::Train;
                self.configure(settings);
            }
            Action::Identifiability(action) => identifiability::apply(action, state, &mut self.identifiability),
            Action::Experiments(action) => {
                experiments::apply(action, state, &mut self.experiments, &mut self.files);
            }
            Action::ExportPicture(picture, path) => {
                state.typed = state.saving.take();
                if let Some(picture) = picture.of(state) {
                    self.files.write(path, move |path| picture.write(path));
                }
            }
            Action::Runs(RunsAction::TakeSettings(id)) => {
                if let Some(settings) = state.runs.run(id).map(|run| run.file.settings) {
                    state.view = View::Train;
                    self.configure(settings);
                }
            }
            Action::Runs(action) => run_list::apply(action, state, &self.runs),
            Action::Trade(action) => {
                if let Some(settings) = trade_off::apply(action, state, &mut self.trade, &mut self.files) {
                    state.view = View::Train;
                    self.configure(settings);
                }
            }
            Action::OpenCheckpoint(path) => {
                state.typed = state.saving.take();
                // A training may have begun while the desktop's dialog was open.
                if !state.phase.is_busy() {
                    state.phase = Phase::Preparing;
                    state.notice = None;
                    self.worker.ask(Request::Open(path));
                }
            }
            Action::CancelSave => state.saving = None,
            Action::DismissNotice => state.notice = None,
            Action::RestartWorker => {
                self.worker = Worker::start(wake(&self.ctx));
                state.phase = state.phase_at_rest();
                state.notice = None;
            }
        }
    }

    /// Asks for the networks to be measured beside other decoders, once they stand still and their table is unfolded.
    pub(super) fn measure_decoders(&mut self) {
        let state = &mut self.state;
        let is_standing = matches!(state.phase, Phase::Paused | Phase::Ended(_));
        if state.decoders.is_open && is_standing && state.decoders.measured.is_none() {
            let number = self.measuring.expect(&mut state.decoders);
            self.worker.ask(Request::Networks(number));
        }
    }

    /// Looks at a figure of the paper, and trains what it shows unless that is there.
    pub(super) fn show_paper_figure(&mut self, figure: PaperFigure) {
        // A training may have begun since the button was drawn.
        if self.state.phase.is_busy() {
            return;
        }
        let settings = figure.settings();
        self.configure(settings);
        let look = &mut self.state.look;
        look.right = RightCard::Decoupled;
        look.mode = figure.mode().unwrap_or(look.mode);
        look.tab = figure.tab().unwrap_or(look.tab);
        let is_complete = |run: &RunView| {
            let was_stopped = run.stop_reason == Some(StopReason::Stopped);
            run.asked == settings && run.stop_reason.is_some() && !was_stopped
        };
        if !self.state.shown_run().is_some_and(is_complete) {
            self.apply(Action::Train);
        }
    }

    /// Takes new settings; if they change the test set, shows that of the new ones.
    pub(super) fn configure(&mut self, draft: SimulatedSettings) {
        let before = self.state.draft;
        self.state.draft = draft;
        let run = self.state.run.as_ref();
        if run.is_some_and(|run| have_same_test_set(&run.settings, &draft)) {
            if self.state.preview.take().is_some() {
                self.state.refresh_frames();
            }
        } else if !have_same_sets(&before, &draft) {
            self.ask_for_what_is_missing();
        }
    }

    /// Asks for what the settings are to show before a training and the window does not know yet.
    pub(super) fn ask_for_what_is_missing(&mut self) {
        let state = &self.state;
        let draft = state.draft;
        match (&state.preview, &state.run) {
            (Some(preview), _) if have_same_test_set(&preview.settings, &draft) => {
                preview::compare(&mut self.previews, draft);
            }
            (None, Some(run)) if have_same_test_set(&run.settings, &draft) => {}
            _ => preview::draw(&mut self.previews, draft),
        }
    }
}

/// Whether both draw the same test set.
pub(super) fn have_same_test_set(a: &SimulatedSettings, b: &SimulatedSettings) -> bool {
    let test_set = |settings: &SimulatedSettings| {
        (
            settings.source.sensor,
            settings.source.scene,
            settings.source.test_samples,
            settings.seed,
        )
    };
    test_set(a) == test_set(b)
}

/// Whether both draw the same samples, trained on or not.
pub(super) fn have_same_sets(a: &SimulatedSettings, b: &SimulatedSettings) -> bool {
    let samples = |settings: &SimulatedSettings| (settings.source.samples, settings.source.validation_samples);
    have_same_test_set(a, b) && samples(a) == samples(b)
}
