use std::{path::PathBuf, sync::Arc};

use eframe::egui::{self, Context, Frame as PanelFrame, Margin, Panel, Ui};

use super::{
    action::Action,
    decoders::DecoderMeasuring,
    dialogs::{Answer, DialogKind, Dialogs},
    experiments::{self, ExperimentWorker},
    identifiability::{self, IdentifiabilityAction, IdentifiabilityWorker},
    panels,
    paper_figure::PaperFigure,
    runs::{self, RunsAction, RunsRequest, RunsWorker},
    shortcuts::pressed_shortcuts,
    state::{Notice, Phase, Preview, RightCard, RunView, Saving, State, View},
    theme::{self, Theme, space},
    trade::{self, TradeWorker},
    worker::{Event, Request, Worker},
};
use crate::{evaluation::RunSettings, training::StopReason};

/// The window: its state, the worker, and the one place where actions are applied.
#[derive(Debug)]
pub struct DecouplerWindow {
    state: State,
    worker: Worker,
    experiments: ExperimentWorker,
    runs: RunsWorker,
    measuring: DecoderMeasuring,
    identifiability: IdentifiabilityWorker,
    trade: TradeWorker,
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
            experiments: {
                let ctx = ctx.clone();
                ExperimentWorker::new(move || ctx.request_repaint())
            },
            runs: {
                let ctx = ctx.clone();
                RunsWorker::start(move || ctx.request_repaint())?
            },
            measuring: DecoderMeasuring::default(),
            identifiability: {
                let ctx = ctx.clone();
                IdentifiabilityWorker::new(move || ctx.request_repaint())
            },
            trade: {
                let ctx = ctx.clone();
                TradeWorker::new(move || ctx.request_repaint())
            },
            dialogs: Dialogs::new(dialogs),
            ctx: ctx.clone(),
        };
        window.ask_for_what_is_missing();
        Ok(window)
    }

    /// Takes up the run list in `path`, and keeps finished trainings there from now on. Without it they are gone when the
    /// window closes.
    #[must_use]
    pub fn keeping_runs(self, path: PathBuf) -> Self {
        self.runs.ask(RunsRequest::Load(path));
        self
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
        experiments::take_news(&mut self.state, &self.experiments);
        runs::take_news(&mut self.state, &self.runs);
        self.measuring.take_news(&mut self.state.decoders);
        identifiability::take_news(&mut self.state, &mut self.identifiability);
        trade::take_news(&mut self.state, &self.trade);
        while let Some(answer) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(task, path) => self.apply(task.at(path)),
                Answer::NoDialog(task) => self.apply(Action::TypePath(task)),
                Answer::Cancelled => {}
            }
        }
    }

    fn take_event(&mut self, event: Event) {
        let state = &mut self.state;
        match event {
            // Settings that have moved on meanwhile have asked for another test set, or need none.
            Event::Previewed(settings, _) if !have_same_test_set(&settings, &state.draft) => {}
            Event::Previewed(settings, Ok(test)) => {
                if !state.phase.is_busy() {
                    state.preview = Some(Preview {
                        settings: *settings,
                        test,
                        baselines: None,
                    });
                    state.refresh_frames();
                    self.ask_for_what_is_missing();
                }
            }
            Event::Previewed(_, Err(error)) => state.notice = Some(Notice::Failed(error.to_string())),
            Event::Compared(settings, baselines) => {
                if let Some(preview) = &mut state.preview
                    && have_same_sets(&settings, &state.draft)
                {
                    preview.baselines = baselines;
                }
            }
            Event::Began(Ok(began)) => {
                self.measuring.forget(&mut state.decoders);
                state.preview = None;
                state.run = Some(RunView::new(*began));
                state.phase = Phase::Training;
                state.refresh_frames();
            }
            Event::Began(Err(error)) => {
                state.phase = state.phase_at_rest();
                state.notice = Some(Notice::Failed(error.to_string()));
            }
            Event::Opened(Ok(began)) => {
                self.measuring.forget(&mut state.decoders);
                state.draft = began.settings;
                state.preview = None;
                state.run = Some(RunView::new(*began));
                state.typed = None;
                // If it has ended, the news of it say so.
                state.phase = Phase::Paused;
                state.refresh_frames();
            }
            Event::Opened(Err(error)) => {
                state.phase = state.phase_at_rest();
                state.notice = Some(Notice::Failed(error));
            }
            Event::Continued(Ok(settings)) => {
                self.measuring.forget(&mut state.decoders);
                if let Some(run) = &mut state.run {
                    run.asked = RunSettings {
                        training: state.draft.training,
                        ..run.asked
                    };
                    run.settings = *settings;
                    run.stop_reason = None;
                }
                state.phase = Phase::Training;
            }
            Event::Continued(Err(error)) => {
                state.phase = match state.phase_at_rest() {
                    Phase::Idle => Phase::Paused,
                    ended => ended,
                };
                state.notice = Some(Notice::Failed(error));
            }
            Event::Progressed(progress) => {
                if let Some(reason) = progress.stop_reason {
                    state.phase = Phase::Ended(reason);
                }
                if let Some(run) = &mut state.run {
                    run.progress(*progress);
                }
                state.refresh_frames();
                self.measure_decoders();
            }
            Event::Networks(number, networks) if self.measuring.awaits(number) => match (networks, &state.run) {
                (Ok(networks), Some(run)) => {
                    let (test, ctx) = (Arc::clone(&run.test.set), self.ctx.clone());
                    let measured = self
                        .measuring
                        .begin(run.settings, *networks, test, move || ctx.request_repaint());
                    if let Err(error) = measured {
                        state.decoders.end(&format!("no thread could be started: {error}"));
                    }
                }
                (Err(reason), _) => state.decoders.end(&reason),
                (Ok(_), None) => {}
            },
            // The network is another one by now.
            Event::Networks(..) => {}
            Event::Finished(Ok(file)) => runs::keep(state, *file, &self.runs),
            Event::Finished(Err(reason)) => state.notice = Some(Notice::Failed(reason)),
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
                if let Some(run) = &state.run {
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
                let ctx = self.ctx.clone();
                self.dialogs
                    .ask(task, &state.suggested_path(task), move || ctx.request_repaint());
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
                self.worker.ask(Request::Export(kind, path));
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
            Action::Experiments(action) => experiments::apply(action, state, &mut self.experiments),
            Action::ExportPicture(picture, path) => {
                state.typed = state.saving.take();
                if let Some(picture) = picture.of(state) {
                    self.runs.ask(RunsRequest::Write(Box::new(picture), path));
                }
            }
            Action::Runs(RunsAction::TakeSettings(id)) => {
                if let Some(settings) = state.runs.run(id).map(|run| run.file.settings) {
                    state.view = View::Train;
                    self.configure(settings);
                }
            }
            Action::Runs(action) => runs::apply(action, state, &self.runs),
            Action::Trade(action) => {
                if let Some(settings) = trade::apply(action, state, &mut self.trade) {
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
            Action::RestartWorker => match start_worker(&self.ctx) {
                Ok(worker) => {
                    self.worker = worker;
                    state.phase = state.phase_at_rest();
                    state.notice = None;
                    self.ask_for_what_is_missing();
                }
                Err(error) => state.notice = Some(Notice::Failed(format!("No thread could be started: {error}"))),
            },
        }
    }

    /// Asks for the networks to be measured beside other decoders, once they stand still and their table is unfolded.
    fn measure_decoders(&mut self) {
        let state = &mut self.state;
        let is_standing = matches!(state.phase, Phase::Paused | Phase::Ended(_));
        if state.decoders.is_open && is_standing && state.decoders.measured.is_none() {
            let number = self.measuring.expect(&mut state.decoders);
            self.worker.ask(Request::Networks(number));
        }
    }

    /// Looks at a figure of the paper, and trains what it shows unless that is there.
    fn show_paper_figure(&mut self, figure: PaperFigure) {
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
    fn configure(&mut self, draft: RunSettings) {
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
    fn ask_for_what_is_missing(&self) {
        let state = &self.state;
        let draft = Box::new(state.draft);
        match (&state.preview, &state.run) {
            (Some(preview), _) if have_same_test_set(&preview.settings, &draft) => {
                self.worker.ask(Request::Baselines(draft));
            }
            (None, Some(run)) if have_same_test_set(&run.settings, &draft) => {}
            _ => self.worker.ask(Request::Preview(draft)),
        }
    }

    /// Lays out the window and applies what the user did.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        let state = &self.state;
        let is_training_view = state.view == View::Train;
        let mut actions = match state.view {
            View::Train => pressed_shortcuts(ui.ctx(), state),
            View::Experiments => experiments::pressed_shortcuts(ui.ctx(), state),
            View::TradeOff => trade::pressed_shortcuts(ui.ctx(), state),
            View::Compare | View::Identifiability => Vec::new(),
        };
        let palette = Theme::of(ui).palette;
        let panel = |margin: Margin| PanelFrame::new().fill(palette.panel).inner_margin(margin);
        let layout = panels::WorkbenchLayout::of_width(ui.available_width());
        let has_report_beside = layout == panels::WorkbenchLayout::ReportBeside;
        let left = if has_report_beside || !is_training_view {
            space(68)
        } else {
            space(62)
        };
        // The strip of the scroll bar is the margin on the right.
        let side = Margin {
            left: 12,
            right: 2,
            top: 4,
            bottom: 4,
        };
        Panel::top("top bar")
            .exact_size(space(11))
            .frame(panel(Margin::symmetric(8, 0)))
            .show(ui, |ui| actions.extend(panels::top_bar_ui(ui, state)));
        Panel::bottom("status line")
            .exact_size(space(7))
            .frame(panel(Margin::symmetric(12, 0)))
            .show(ui, |ui| {
                match state.view {
                    View::Train | View::Compare => panels::status_line_ui(ui, state),
                    View::Experiments => experiments::status_ui(ui, &state.experiments),
                    View::Identifiability => identifiability::status_ui(ui, &state.identifiability),
                    View::TradeOff => trade::status_ui(ui, &state.trade),
                };
            });
        Panel::left("configuration")
            .exact_size(left)
            .resizable(false)
            .frame(panel(side))
            .show(ui, |ui| {
                actions.extend(match state.view {
                    View::Train => panels::configuration_ui(ui, state),
                    View::Experiments => experiments::form_ui(ui, state),
                    View::Compare => runs::run_list_ui(ui, state),
                    View::Identifiability => identifiability::form_ui(ui, state),
                    View::TradeOff => trade::form_ui(ui, state),
                });
            });
        if has_report_beside && is_training_view {
            Panel::right("report")
                .exact_size(space(96))
                .resizable(false)
                .frame(panel(side))
                .show(ui, |ui| actions.extend(panels::report_ui(ui, state)));
        }
        let background = PanelFrame::new().fill(palette.background).inner_margin(Margin::same(8));
        egui::CentralPanel::default().frame(background).show(ui, |ui| {
            actions.extend(panels::notice_ui(ui, state));
            actions.extend(match state.view {
                View::Train => panels::workbench_ui(ui, state, layout),
                View::Experiments => experiments::experiments_ui(ui, state),
                View::Compare => runs::compare_ui(ui, state),
                View::Identifiability => identifiability::identifiability_ui(ui, state),
                View::TradeOff => trade::trade_ui(ui, state),
            });
        });
        actions.extend(panels::save_form_ui(ui, state));
        for action in actions {
            self.apply(action);
            self.ctx.request_repaint();
        }
    }
}

/// Whether both draw the same test set.
fn have_same_test_set(a: &RunSettings, b: &RunSettings) -> bool {
    let test_set = |settings: &RunSettings| (settings.sensor, settings.scene, settings.test_samples, settings.seed);
    test_set(a) == test_set(b)
}

/// Whether both draw the same samples, trained on or not.
fn have_same_sets(a: &RunSettings, b: &RunSettings) -> bool {
    let samples = |settings: &RunSettings| (settings.samples, settings.validation_samples);
    have_same_test_set(a, b) && samples(a) == samples(b)
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn window() -> DecouplerWindow {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        wait(&mut window, |state| state.test().is_some());
        let mut small = window.state.draft;
        small.sensor.scale = "4x4_2x12".parse().unwrap();
        (small.hidden, small.samples, small.training.stopping.epochs) = (3, 40, 5);
        window.apply(Action::Configure(Box::new(small)));
        window.apply(Action::Train);
        wait(&mut window, |state| matches!(state.phase, Phase::Ended(_)));
        window
    }

    /// Takes news until `holds`; at most a minute.
    fn wait(window: &mut DecouplerWindow, holds: impl Fn(&State) -> bool) {
        for _ in 0..12_000 {
            window.take_news();
            if holds(&window.state) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("it never came: {:?}", window.state);
    }

    #[test]
    fn a_worker_that_died_takes_no_results_with_it_also_when_another_is_started() {
        let mut window = window();
        let ended = window.state.phase;
        window.worker = Worker::dead();
        wait(&mut window, |state| state.phase == Phase::Died);
        assert!(window.state.result().is_some());
        window.apply(Action::RestartWorker);
        std::thread::sleep(Duration::from_millis(300));
        window.take_news();
        assert_eq!((window.state.phase, &window.state.notice), (ended, &None));
        assert!(window.state.result().is_some() && window.state.frames.decoupled.is_some());

        window.apply(Action::Export(super::super::ExportKind::Errors, "errors.csv".into()));
        wait(&mut window, |state| state.notice.is_some());
        let lost = "the network was lost when the training thread ended: train again";
        assert_eq!(window.state.notice, Some(Notice::Failed(lost.to_owned())));
        window.apply(Action::DismissNotice);
        window.apply(Action::Continue);
        wait(&mut window, |state| state.notice.is_some());
        assert_eq!(window.state.notice, Some(Notice::Failed(lost.to_owned())));
        assert_eq!(window.state.phase, ended);
        window.apply(Action::Train);
        wait(&mut window, |state| matches!(state.phase, Phase::Ended(_)));
    }

    #[test]
    fn a_picture_that_died_with_the_worker_is_drawn_by_the_next() {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        window.worker = Worker::dead();
        wait(&mut window, |state| state.phase == Phase::Died);
        window.apply(Action::RestartWorker);
        wait(&mut window, |state| {
            state
                .preview
                .as_ref()
                .is_some_and(|preview| preview.baselines.is_some())
        });
    }

    #[test]
    fn a_training_that_cannot_begin_leaves_the_one_before_to_be_exported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("network.json");
        let mut window = window();
        let (ended, shown) = (window.state.phase, window.state.draft);
        let mut impossible = shown;
        impossible.training.stopping.goal_mse = f64::NAN;
        window.apply(Action::Configure(Box::new(impossible)));
        window.apply(Action::Train);
        wait(&mut window, |state| state.notice.is_some());
        assert!(matches!(window.state.notice, Some(Notice::Failed(_))));
        assert_eq!(window.state.phase, ended, "the training on show has ended so");
        assert!(window.state.result().is_some());

        window.apply(Action::DismissNotice);
        window.apply(Action::Export(super::super::ExportKind::Network, path.clone()));
        wait(&mut window, |state| state.notice.is_some());
        assert_eq!(
            window.state.notice,
            Some(Notice::Done(format!("Saved {}", path.display())))
        );
        let file = crate::export::NetworkFile::load(&path).unwrap();
        assert_eq!(file.settings.hidden, shown.hidden);
    }
}
