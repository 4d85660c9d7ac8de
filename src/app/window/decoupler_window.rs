use std::{path::PathBuf, sync::Arc, time::Duration};

use eframe::egui::{self, Context, Frame as PanelFrame, Margin, Panel, Ui};

use super::{
    actions::Overlay,
    closing::Closing,
    columns::{edge_ui, widths_points},
    dialogs::{DialogKind, Dialogs},
    export_menu::export_menu_ui,
    files::Files,
    frames::changes_something,
    memory::Memory,
    notice::{self, notice_ui},
    notices::Notices,
    remembered::Remembered,
    save_form::{self, Saving, save_form_ui},
    top_bar::{Reach, top_bar_ui},
    undoing::Undoing,
};
use crate::app::{
    job::{Job, Wake},
    preview::PreviewEvent,
    shared::{Effect, Matter, Notice, Phase, RunsWorker, Shared},
    theme::{self, Theme, space},
    training_worker::Worker,
    views::Views,
};

/// The window: what is shared, the views, and the one place where what they ask for is done.
pub struct DecouplerWindow {
    pub(super) shared: Shared,
    pub(super) views: Views,
    /// Their places and names.
    pub(super) names: Vec<(usize, &'static str)>,
    /// The place of the view on show among all.
    pub(super) shown: usize,
    pub(super) notices: Notices,
    /// A file waiting for its path.
    pub(super) saving: Option<Saving>,
    /// The path last typed, offered again for the same file.
    pub(super) typed: Option<Saving>,
    pub(super) worker: Worker,
    pub(super) previews: Job<PreviewEvent>,
    pub(super) runs: RunsWorker,
    pub(super) files: Files,
    pub(super) dialogs: Dialogs,
    pub(super) closing: Option<Closing>,
    /// A list that lies over the window.
    pub(super) overlay: Overlay,
    /// The name of the action picked from the list, to be done in the next frame.
    pub(super) picked: Option<String>,
    pub(super) undoing: Undoing,
    pub(super) remembered: Remembered,
    /// Where that is kept, if it is.
    pub(super) memory: Option<Memory>,
    pub(super) wake: Wake,
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
        // Ours keep to sizes at which the window is whole.
        ctx.options_mut(|options| options.zoom_with_keyboard = false);
        let wake: Wake = {
            let ctx = ctx.clone();
            Arc::new(move || ctx.request_repaint())
        };
        let mut views = Views::new(&wake);
        let names = views.all().into_iter().map(|view| view.name()).enumerate();
        let mut window = Self {
            names: names.collect(),
            shared: Shared::new(is_dark),
            views,
            shown: 0,
            notices: Notices::default(),
            saving: None,
            typed: None,
            worker: Worker::start(Arc::clone(&wake)),
            previews: Job::new("preview", Arc::clone(&wake)),
            runs: RunsWorker::start(Arc::clone(&wake)),
            files: Files::new(Arc::clone(&wake)),
            dialogs: Dialogs::new(dialogs),
            closing: None,
            overlay: Overlay::None,
            picked: None,
            undoing: Undoing::default(),
            remembered: Remembered::default(),
            memory: None,
            wake,
            ctx: ctx.clone(),
        };
        window.ask_for_what_is_missing();
        Ok(window)
    }

    /// Shows the runs in the folder `path`, and keeps finished trainings there from now on. Without it they are gone when
    /// the window closes.
    #[must_use]
    pub fn keeping_runs(self, path: PathBuf) -> Self {
        self.runs.open(path);
        self
    }

    /// State that all views read.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// The views, on show or not.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// The name of the view on show.
    pub fn shown(&self) -> &'static str {
        self.names[self.shown].1
    }

    /// Newest notice that is shown to the user.
    pub fn notice(&self) -> Option<&Notice> {
        self.notices.newest()
    }

    /// Lays out the window and does what the user meant.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        // Another window may have been at work.
        if ui.input(|input| input.events.contains(&egui::Event::WindowFocused(true))) {
            self.runs.look();
        }
        let mut effects = Vec::new();
        let actions = self.offer_actions(ui.ctx(), &mut effects);
        let is_asked = self.is_asked();
        let (view, shared) = (&mut *self.views.all()[self.shown], &self.shared);
        if !is_asked {
            view.take_pointer(ui.ctx(), shared);
        }
        let palette = Theme::of(ui).palette;
        let panel = |margin: Margin| PanelFrame::new().fill(palette.panel).inner_margin(margin);
        let window_width = ui.available_width();
        let columns = view.columns(window_width);
        let [form_width, report_width] = widths_points(&columns, &self.remembered, window_width);
        // The strip of the scroll bar is the margin on the right.
        let side = Margin {
            left: 12,
            right: 2,
            top: 4,
            bottom: 4,
        };
        let top_bar = Panel::top("top bar")
            .exact_size(space(11))
            .frame(panel(Margin::symmetric(8, 0)))
            .show(ui, |ui| {
                top_bar_ui(ui, &self.names, self.shown, &actions, |ui| {
                    export_menu_ui(ui, || view.exports(shared), &mut effects);
                    view.tools_ui(ui, shared, &mut effects);
                })
            });
        Panel::bottom("status line")
            .exact_size(space(7))
            .frame(panel(Margin::symmetric(12, 0)))
            .show(ui, |ui| view.status_ui(ui, shared));
        let form = Panel::left("configuration")
            .exact_size(form_width)
            .resizable(false)
            .frame(panel(side))
            .show(ui, |ui| view.form_ui(ui, shared, &mut effects));
        let report = columns.has_report.then(|| {
            Panel::right("report")
                .exact_size(report_width)
                .resizable(false)
                .frame(panel(side))
                .show(ui, |ui| view.report_ui(ui, shared, &mut effects))
        });
        if let Some(seconds) = self.notices.pass(ui.input(|input| input.time)) {
            ui.ctx().request_repaint_after(Duration::from_secs_f64(seconds));
        }
        let background = PanelFrame::new().fill(palette.background).inner_margin(Margin::same(8));
        let replies = egui::CentralPanel::default().frame(background).show(ui, |ui| {
            let mut replies = Vec::new();
            for (place, (matter, notice)) in self.notices.iter().enumerate() {
                let can_restart = matter == Matter::Training && shared.phase == Phase::Died;
                replies.extend(notice_ui(ui, notice, can_restart).map(|reply| (place, reply)));
            }
            view.body_ui(ui, shared, &mut effects);
            replies
        });
        let remembered = &mut self.remembered;
        let (form, report) = (form.response.rect, report.map(|report| report.response.rect));
        edge_ui(ui, "Width of the left column", form, true, &mut remembered.form_points);
        if let Some(report) = report {
            edge_ui(
                ui,
                "Width of the right column",
                report,
                false,
                &mut remembered.report_points,
            );
        }
        if changes_something(ui.ctx()) || !effects.is_empty() {
            self.ctx.request_repaint();
        }
        // Before anything changes the places.
        for (place, reply) in replies.inner {
            match reply {
                notice::Reply::Dismiss => self.notices.dismiss(place),
                notice::Reply::Restart => self.restart_worker(),
            }
        }
        self.apply_all(effects);
        match top_bar.inner {
            Some(Reach::View(place)) => self.show(place),
            Some(Reach::Action(name)) => {
                self.picked = Some(name);
                self.ctx.request_repaint();
            }
            None => {}
        }
        self.undoing.follow(ui.input(|input| input.time), &self.shared.draft);
        self.overlay_ui(ui, &actions);
        self.ask_for_path(ui);
        self.remember();
        // What was begun in this frame must be finished too.
        self.take_close_request();
        self.closing_ui(ui);
    }

    /// Does what views ask for.
    pub(super) fn apply_all(&mut self, effects: Vec<Effect>) {
        for effect in effects {
            self.apply(effect);
        }
    }

    fn ask_for_path(&mut self, ui: &mut Ui) {
        match self.saving.as_mut().and_then(|saving| save_form_ui(ui, saving)) {
            Some(save_form::Reply::Path(path)) => {
                self.typed = self.saving.take();
                if let Some(typed) = self.typed.clone() {
                    self.answer(typed.task, path);
                }
            }
            Some(save_form::Reply::Cancel) => self.saving = None,
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        app::{
            shared::{Contents, FileTask, FileWords},
            test_view::TestView,
        },
        export::NetworkFile,
    };

    fn window() -> DecouplerWindow {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        wait(&mut window, |window| window.shared.test().is_some());
        let mut small = window.shared.draft;
        small.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (small.hidden, small.source.samples, small.training.stopping.epochs) = (3, 40, 5);
        window.apply(Effect::Configure(Box::new(small)));
        window.apply(Effect::Train);
        wait(&mut window, |window| matches!(window.shared.phase, Phase::Ended(_)));
        window
    }

    /// Saves the network on show.
    fn export(window: &mut DecouplerWindow, path: PathBuf) {
        let task = save_task(window);
        window.answer(task, path);
    }

    /// Returns the task of saving the network on show.
    fn save_task(window: &DecouplerWindow) -> FileTask {
        let words = FileWords {
            kind: "network",
            description: "",
            extensions: &["json"],
        };
        let run = window.shared.run.as_ref().unwrap().id;
        FileTask::save_run(words, "network", run, |run| {
            let file = NetworkFile::from_run(run).map_err(|error| error.to_string())?;
            Ok(Contents::new(move |path| file.save(path)))
        })
    }

    /// Takes news until `holds`; at most a minute.
    fn wait(window: &mut DecouplerWindow, holds: impl Fn(&DecouplerWindow) -> bool) {
        for _ in 0..12_000 {
            window.take_news();
            if holds(window) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("it never came: {:?}", window.shared);
    }

    #[test]
    fn a_worker_that_died_takes_no_results_with_it_also_when_another_is_started() {
        let mut window = window();
        let ended = window.shared.phase;
        window.worker = Worker::dead();
        wait(&mut window, |window| window.shared.phase == Phase::Died);
        assert!(window.shared.result().is_some());
        window.restart_worker();
        std::thread::sleep(Duration::from_millis(300));
        window.take_news();
        assert_eq!((window.shared.phase, window.notice()), (ended, None));
        assert!(window.shared.result().is_some());

        export(&mut window, "network.json".into());
        wait(&mut window, |window| window.notice().is_some());
        let lost = "the network was lost when the training thread ended: train again";
        assert_eq!(window.notice(), Some(&Notice::Failed(lost.to_owned())));
        window.apply(Effect::Settle(Matter::File));
        window.apply(Effect::Continue);
        wait(&mut window, |window| window.notice().is_some());
        assert_eq!(window.notice(), Some(&Notice::Failed(lost.to_owned())));
        assert_eq!(window.shared.phase, ended);
        window.apply(Effect::Train);
        wait(&mut window, |window| matches!(window.shared.phase, Phase::Ended(_)));
    }

    #[test]
    fn a_picture_that_died_with_the_worker_is_drawn_by_the_next() {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        window.worker = Worker::dead();
        wait(&mut window, |window| window.shared.phase == Phase::Died);
        window.restart_worker();
        wait(&mut window, |window| {
            window
                .shared
                .preview
                .as_ref()
                .is_some_and(|preview| preview.baselines.is_some())
        });
    }

    #[test]
    fn a_test_set_drawn_late_does_not_hide_the_training_that_shows_it() {
        let mut window = window();
        let settings = window.shared.draft;
        let drawn = TestView::draw(&settings);
        window.take_preview(PreviewEvent::Drawn(Box::new(settings), drawn));
        assert!(window.shared.preview.is_none() && window.shared.result().is_some());
    }

    #[test]
    fn a_training_that_cannot_begin_leaves_the_one_before_to_be_exported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("network.json");
        let mut window = window();
        let (ended, shown) = (window.shared.phase, window.shared.draft);
        let mut impossible = shown;
        impossible.training.stopping.goal_mse = f64::NAN;
        window.apply(Effect::Configure(Box::new(impossible)));
        window.apply(Effect::Train);
        wait(&mut window, |window| window.notice().is_some());
        assert!(matches!(window.notice(), Some(Notice::Failed(_))));
        assert_eq!(window.shared.phase, ended, "the training on show has ended so");
        assert!(window.shared.result().is_some());

        window.apply(Effect::Settle(Matter::Settings));
        export(&mut window, path.clone());
        wait(&mut window, |window| window.notice().is_some());
        assert_eq!(
            window.notice(),
            Some(&Notice::Done(format!("Saved {}", path.display())))
        );
        let file = NetworkFile::load(&path).unwrap();
        assert_eq!(file.settings.hidden, shown.hidden);
    }

    #[test]
    fn a_file_asked_for_before_another_training_began_is_refused_not_written_about_the_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("network.json");
        let mut window = window();
        // The desktop's dialog is open.
        let task = save_task(&window);
        let mut other = window.shared.draft;
        other.hidden = 4;
        window.apply(Effect::Configure(Box::new(other)));
        window.apply(Effect::Train);
        wait(&mut window, |window| {
            matches!(window.shared.phase, Phase::Ended(_)) && window.shared.run.as_ref().unwrap().settings.hidden == 4
        });
        window.answer(task, path.clone());
        wait(&mut window, |window| window.notice().is_some());
        let Some(Notice::Failed(reason)) = window.notice() else {
            panic!("{:?}", window.notice())
        };
        assert!(reason.contains("another training has replaced"), "{reason}");
        assert!(!path.exists());
    }

    #[test]
    fn a_training_that_cannot_begin_leaves_the_settings_own_test_set_on_show() {
        let mut window = DecouplerWindow::new(&Context::default(), DialogKind::None).unwrap();
        wait(&mut window, |window| window.shared.test().is_some());
        let mut impossible = window.shared.draft;
        impossible.source.sensor.scale = "4x4_2x12".parse().unwrap();
        impossible.training.stopping.goal_mse = f64::NAN;
        window.apply(Effect::Configure(Box::new(impossible)));
        // Before the new test set is there.
        window.apply(Effect::Train);
        wait(&mut window, |window| window.notice().is_some());
        wait(&mut window, |window| {
            window
                .shared
                .test()
                .is_some_and(|test| test.sensor == impossible.source.sensor)
        });
    }
}
