use std::{path::PathBuf, sync::Arc};

use eframe::egui::{self, Context, Frame as PanelFrame, Margin, Panel, Ui};

use super::{
    closing::Closing, notice::notice_ui, save_form::save_form_ui, status_line::status_line_ui, top_bar::top_bar_ui,
};
use crate::app::{
    dialogs::{DialogKind, Dialogs},
    files::Files,
    job::{Job, Wake},
    preview::PreviewEvent,
    shared::{
        State, View,
        run_list::{RunsRequest, RunsWorker},
    },
    theme::{self, Theme, space},
    training_worker::Worker,
    views::{
        compare,
        experiments::{self, ExperimentEvent},
        identifiability::{self, IdentifiabilityWorker},
        trade_off::{self, TradeEvent},
        train::{self, decoders::DecoderMeasuring, pressed_shortcuts},
    },
};

/// The window: its state, the worker, and the one place where actions are applied.
#[derive(Debug)]
pub struct DecouplerWindow {
    pub(super) state: State,
    pub(super) worker: Worker,
    pub(super) previews: Job<PreviewEvent>,
    pub(super) files: Files,
    pub(super) experiments: Job<ExperimentEvent>,
    pub(super) runs: RunsWorker,
    pub(super) identifiability: IdentifiabilityWorker,
    pub(super) trade: Job<TradeEvent>,
    pub(super) measuring: DecoderMeasuring,
    pub(super) dialogs: Dialogs,
    pub(super) closing: Option<Closing>,
    pub(super) ctx: Context,
}

impl DecouplerWindow {
    /// Opens on the default array and asks for its test set.
    ///
    /// # Errors
    /// The system gives no thread for the worker.
    pub fn new(ctx: &Context, dialogs: DialogKind) -> std::io::Result<Self> {
        let is_dark = ctx.system_theme() != Some(egui::Theme::Light);
        theme::install(ctx, is_dark);
        let wake = wake(ctx);
        let mut window = Self {
            state: State::new(is_dark),
            worker: Worker::start(Arc::clone(&wake)),
            previews: Job::new("preview", Arc::clone(&wake)),
            files: Files::new(Arc::clone(&wake)),
            experiments: Job::new("experiments", Arc::clone(&wake)),
            runs: RunsWorker::start(Arc::clone(&wake)),
            identifiability: IdentifiabilityWorker::new(Arc::clone(&wake)),
            trade: Job::new("trade-off", Arc::clone(&wake)),
            measuring: DecoderMeasuring::new(wake),
            dialogs: Dialogs::new(dialogs),
            closing: None,
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

    /// Lays out the window and applies what the user did.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        let state = &self.state;
        let is_training_view = state.view == View::Train;
        let mut actions = match state.view {
            // The question is to be answered first.
            _ if self.closing.is_some() => Vec::new(),
            View::Train => pressed_shortcuts(ui.ctx(), state),
            View::Experiments => experiments::pressed_shortcuts(ui.ctx(), state),
            View::TradeOff => trade_off::pressed_shortcuts(ui.ctx(), state),
            View::Compare | View::Identifiability => Vec::new(),
        };
        let palette = Theme::of(ui).palette;
        let panel = |margin: Margin| PanelFrame::new().fill(palette.panel).inner_margin(margin);
        let layout = train::WorkbenchLayout::of_width(ui.available_width());
        let has_report_beside = layout == train::WorkbenchLayout::ReportBeside;
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
            .show(ui, |ui| actions.extend(top_bar_ui(ui, state)));
        Panel::bottom("status line")
            .exact_size(space(7))
            .frame(panel(Margin::symmetric(12, 0)))
            .show(ui, |ui| {
                match state.view {
                    View::Train | View::Compare => status_line_ui(ui, state),
                    View::Experiments => experiments::status_ui(ui, &state.experiments),
                    View::Identifiability => identifiability::status_ui(ui, &state.identifiability),
                    View::TradeOff => trade_off::status_ui(ui, &state.trade),
                };
            });
        Panel::left("configuration")
            .exact_size(left)
            .resizable(false)
            .frame(panel(side))
            .show(ui, |ui| {
                actions.extend(match state.view {
                    View::Train => train::configuration_ui(ui, state),
                    View::Experiments => experiments::form_ui(ui, state),
                    View::Compare => compare::run_list_ui(ui, state),
                    View::Identifiability => identifiability::form_ui(ui, state),
                    View::TradeOff => trade_off::form_ui(ui, state),
                });
            });
        if has_report_beside && is_training_view {
            Panel::right("report")
                .exact_size(space(96))
                .resizable(false)
                .frame(panel(side))
                .show(ui, |ui| actions.extend(train::report_ui(ui, state)));
        }
        let background = PanelFrame::new().fill(palette.background).inner_margin(Margin::same(8));
        egui::CentralPanel::default().frame(background).show(ui, |ui| {
            actions.extend(notice_ui(ui, state));
            actions.extend(match state.view {
                View::Train => train::workbench_ui(ui, state, layout),
                View::Experiments => experiments::experiments_ui(ui, state),
                View::Compare => compare::compare_ui(ui, state),
                View::Identifiability => identifiability::identifiability_ui(ui, state),
                View::TradeOff => trade_off::trade_ui(ui, state),
            });
        });
        actions.extend(save_form_ui(ui, state));
        for action in actions {
            self.apply(action);
            self.ctx.request_repaint();
        }
        self.closing_ui(ui);
    }
}

/// Makes the window draw a frame.
pub(super) fn wake(ctx: &Context) -> Wake {
    let ctx = ctx.clone();
    Arc::new(move || ctx.request_repaint())
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
    use crate::app::{ExportKind, Notice, Phase, window::Action};

    fn window() -> DecouplerWindow {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        wait(&mut window, |state| state.test().is_some());
        let mut small = window.state.draft;
        small.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (small.hidden, small.source.samples, small.training.stopping.epochs) = (3, 40, 5);
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

        window.apply(Action::Export(ExportKind::Errors, "errors.csv".into()));
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
        window.apply(Action::Export(ExportKind::Network, path.clone()));
        wait(&mut window, |state| state.notice.is_some());
        assert_eq!(
            window.state.notice,
            Some(Notice::Done(format!("Saved {}", path.display())))
        );
        let file = crate::export::NetworkFile::load(&path).unwrap();
        assert_eq!(file.settings.hidden, shown.hidden);
    }
}
