use std::sync::Arc;

use eframe::egui::{self, Context, Frame as PanelFrame, Key, KeyboardShortcut, Margin, Modifiers, Panel, Ui};

use super::{
    action::Action,
    dialogs::{Answer, DialogKind, Dialogs},
    panels,
    state::{Notice, Phase, RunView, Saving, State},
    theme::{self, Theme, space},
    worker::{Event, Request, Worker},
};
use crate::evaluation::RunSettings;

/// The window: its state, the worker, and the one place where actions are applied.
#[derive(Debug)]
pub struct DecouplerWindow {
    state: State,
    worker: Worker,
    dialogs: Dialogs,
    ctx: Context,
}

impl DecouplerWindow {
    /// Opens on the default array and asks for its test set.
    ///
    /// # Errors
    /// The system gives no thread for the worker.
    pub fn new(ctx: &Context, dialogs: DialogKind) -> std::io::Result<Self> {
        let is_dark = ctx.system_theme() != Some(egui::Theme::Light);
        theme::install(ctx, is_dark);
        let window = Self {
            state: State::new(is_dark),
            worker: start_worker(ctx)?,
            dialogs: Dialogs::new(dialogs),
            ctx: ctx.clone(),
        };
        window.worker.ask(Request::Preview(Box::new(window.state.draft)));
        Ok(window)
    }

    /// What the panels read.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Takes what the worker and the dialogs have to tell.
    pub fn take_news(&mut self) {
        loop {
            match self.worker.next_event() {
                Ok(Some(event)) => self.take_event(event),
                Ok(None) => break,
                Err(_) => {
                    if self.state.phase != Phase::Died {
                        self.state.phase = Phase::Died;
                        let text = "The training thread ended unexpectedly. What is shown can still be looked at.";
                        self.state.notice = Some(Notice::Failed(text.to_owned()));
                    }
                    break;
                }
            }
        }
        while let Some(answer) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(kind, path) => self.apply(Action::Export(kind, path)),
                Answer::NoDialog(kind) => self.apply(Action::TypePath(kind)),
                Answer::Cancelled => {}
            }
        }
    }

    fn take_event(&mut self, event: Event) {
        let state = &mut self.state;
        match event {
            // Settings that have moved on meanwhile have asked for another test set, or need none.
            Event::Previewed(settings, _) if !have_same_test_set(&settings, &state.draft) => {}
            Event::Previewed(_, Ok(test)) => {
                if !state.phase.is_busy() {
                    state.preview = Some(test);
                    state.refresh_frames();
                }
            }
            Event::Previewed(_, Err(error)) => state.notice = Some(Notice::Failed(error.to_string())),
            Event::Began(Ok(began)) => {
                state.preview = None;
                state.run = Some(RunView::new(*began));
                state.phase = Phase::Training;
                state.refresh_frames();
            }
            Event::Began(Err(error)) => {
                state.phase = Phase::Idle;
                state.notice = Some(Notice::Failed(error.to_string()));
            }
            Event::Progressed(progress) => {
                if let Some(reason) = progress.stop_reason {
                    state.phase = Phase::Ended(reason);
                }
                if let Some(run) = &mut state.run {
                    run.progress(*progress);
                }
                state.refresh_frames();
            }
            Event::Exported(Ok(path)) => {
                state.typed = None;
                state.notice = Some(Notice::Done(format!("Saved {}", path.display())));
            }
            Event::Exported(Err(error)) => state.notice = Some(Notice::Failed(error)),
        }
    }

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
            Action::Pause => {
                state.phase = Phase::Paused;
                self.worker.ask(Request::Pause);
            }
            Action::Resume => {
                state.phase = Phase::Training;
                self.worker.ask(Request::Resume);
            }
            Action::Stop => self.worker.ask(Request::Stop),
            Action::ShowSnapshot(snapshot) => {
                state.look.snapshot = snapshot;
                state.refresh_frames();
            }
            Action::GoTo(address) => {
                state.look.snapshot = address.snapshot;
                let per_row = state.test().map_or(0, |test| test.sensor.scale.nodes_per_row());
                state.look.node = Some(address.row * per_row + address.node);
                state.refresh_frames();
            }
            Action::MoveCamera(camera) => state.look.camera = camera,
            Action::SetViewMode(mode) => state.look.mode = mode,
            Action::SetRightCard(right) => state.look.right = right,
            Action::HoverNode(node) => state.look.node = node,
            Action::ShowTab(tab) => state.look.tab = tab,
            Action::SetDark(is_dark) => {
                state.look.is_dark = is_dark;
                theme::apply(&self.ctx, is_dark);
            }
            Action::ChooseFile(kind) => {
                let ctx = self.ctx.clone();
                self.dialogs
                    .ask(kind, &state.suggested_path(kind), move || ctx.request_repaint());
            }
            Action::TypePath(kind) => {
                let typed = state.typed.clone().filter(|typed| typed.kind == kind);
                let suggested = || state.suggested_path(kind).display().to_string();
                state.saving = Some(typed.unwrap_or_else(|| Saving {
                    kind,
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
                self.worker.ask(Request::Export(kind, path));
            }
            Action::CancelSave => state.saving = None,
            Action::DismissNotice => state.notice = None,
            Action::RestartWorker => match start_worker(&self.ctx) {
                Ok(worker) => {
                    self.worker = worker;
                    state.phase = Phase::Idle;
                    state.notice = None;
                    self.worker.ask(Request::Preview(Box::new(state.draft)));
                }
                Err(error) => state.notice = Some(Notice::Failed(format!("No thread could be started: {error}"))),
            },
        }
    }

    /// Takes new settings; if they change the test set, shows that of the new ones.
    fn configure(&mut self, draft: RunSettings) {
        let before = self.state.draft;
        self.state.draft = draft;
        if have_same_test_set(&before, &draft) {
            return;
        }
        let ran = self
            .state
            .run
            .as_ref()
            .filter(|run| have_same_test_set(&run.settings, &draft));
        if ran.is_some() {
            self.state.preview = None;
            self.state.refresh_frames();
        } else {
            self.worker.ask(Request::Preview(Box::new(draft)));
        }
    }

    /// Lays out the window and applies what the user did.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        let mut actions = self.pressed_shortcuts(ui.ctx());
        let state = &self.state;
        let palette = Theme::of(ui).palette;
        let panel = |margin: Margin| PanelFrame::new().fill(palette.panel).inner_margin(margin);
        // Narrow windows give the side panels less, so that the surfaces keep most of the room.
        let width = ui.available_width();
        let (left, right) = if width < 1200.0 {
            (space(60), space(84))
        } else {
            (space(68), space(94))
        };
        Panel::top("top bar")
            .exact_size(space(11))
            .frame(panel(Margin::symmetric(8, 0)))
            .show(ui, |ui| actions.extend(panels::top_bar_ui(ui, state)));
        Panel::bottom("status line")
            .exact_size(space(7))
            .frame(panel(Margin::symmetric(12, 0)))
            .show(ui, |ui| panels::status_line_ui(ui, state));
        Panel::left("configuration")
            .exact_size(left)
            .resizable(false)
            .frame(panel(Margin::symmetric(12, 4)))
            .show(ui, |ui| actions.extend(panels::configuration_ui(ui, state)));
        Panel::right("report")
            .exact_size(right)
            .resizable(false)
            .frame(panel(Margin::symmetric(12, 4)))
            .show(ui, |ui| actions.extend(panels::report_ui(ui, state)));
        let background = PanelFrame::new().fill(palette.background).inner_margin(Margin::same(8));
        egui::CentralPanel::default().frame(background).show(ui, |ui| {
            actions.extend(panels::notice_ui(ui, state));
            actions.extend(panels::workbench_ui(ui, state));
        });
        actions.extend(panels::save_form_ui(ui, state));
        for action in actions {
            self.apply(action);
            self.ctx.request_repaint();
        }
    }

    fn pressed_shortcuts(&self, ctx: &Context) -> Vec<Action> {
        let state = &self.state;
        // The question for a path is to be answered first.
        if state.saving.is_some() {
            return Vec::new();
        }
        let snapshots = state.test().map_or(0, |test| test.set.snapshots());
        let shown = state.look.snapshot;
        let pressed =
            |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
        let mut actions = Vec::new();
        if pressed(Modifiers::COMMAND, Key::Enter) && !state.phase.is_busy() && state.phase != Phase::Died {
            actions.push(Action::Train);
        }
        if pressed(Modifiers::COMMAND, Key::P) {
            match state.phase {
                Phase::Training => actions.push(Action::Pause),
                Phase::Paused => actions.push(Action::Resume),
                _ => {}
            }
        }
        if pressed(Modifiers::COMMAND, Key::Period) && state.phase.is_busy() {
            actions.push(Action::Stop);
        }
        if pressed(Modifiers::NONE, Key::PageDown) && shown + 1 < snapshots {
            actions.push(Action::ShowSnapshot(shown + 1));
        }
        if pressed(Modifiers::NONE, Key::PageUp) && shown > 0 {
            actions.push(Action::ShowSnapshot(shown - 1));
        }
        actions
    }
}

/// Whether both draw the same test set.
fn have_same_test_set(a: &RunSettings, b: &RunSettings) -> bool {
    let test_set = |settings: &RunSettings| (settings.sensor, settings.scene, settings.test_samples, settings.seed);
    test_set(a) == test_set(b)
}

fn start_worker(ctx: &Context) -> std::io::Result<Worker> {
    let ctx = Arc::new(ctx.clone());
    Worker::start(move || ctx.request_repaint())
}

impl eframe::App for DecouplerWindow {
    fn logic(&mut self, _ctx: &Context, _frame: &mut eframe::Frame) {
        self.take_news();
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show_ui(ui);
    }
}
