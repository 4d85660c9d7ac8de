use std::{path::PathBuf, sync::Arc, time::Duration};

use eframe::egui::{
    self, ColorImage, Context, Event, Frame as PanelFrame, Margin, Panel, Rangef, Ui, UiBuilder, ViewportCommand, vec2,
};

use super::{
    commands::{DraftsUndoer, SCALES, drafts},
    export_dialog::{card_menu_ui, export_menu_ui},
    files::{Dialogs, Files},
    modal::Modal,
    notices::Notices,
    remembered::{Memory, Remembered, WindowFile},
    top_bar::top_bar_ui,
};
use crate::window::{
    job::{Background, Jobs, Wake},
    preview::PreviewEvent,
    shared::{Command, Effect, Matter, Notice, RunView, RunsRequest, RunsWorker, Shared, ViewKind, training_status},
    theme::{self, Theme, space},
    training_worker::{Request, Worker},
    views::Views,
    widgets::focus_ring_ui,
};

/// A picture to be copied, and the message for the user.
pub(super) type Drawn = Result<(ColorImage, String), String>;

/// The window: the shared state, the views, and the one place where their effects are applied.
pub struct DecouplerWindow {
    pub(super) shared: Shared,
    pub(super) views: Views,
    pub(super) notices: Notices,
    /// The card over the window that must be answered first.
    pub(super) modal: Option<Modal>,
    /// The checkpoint that the training of the Train view was opened from.
    pub(super) opened: Option<PathBuf>,
    pub(super) worker: Worker,
    /// Folder for the checkpoints of running trainings, and the interval at which they are saved.
    pub(super) keeping: Option<(PathBuf, Duration)>,
    pub(super) previews: Background<PreviewEvent>,
    pub(super) runs: RunsWorker,
    /// The run of the list that is being opened, the last one after the start if not one that the user chose.
    pub(super) opening: Background<(bool, Result<Box<RunView>, String>)>,
    pub(super) files: Files,
    /// Pictures that are drawn to be copied; the newest wins.
    pub(super) pictures: Background<Drawn>,
    pub(super) dialogs: Dialogs,
    /// Command picked from the list or by a button, which is carried out in the next frame.
    pub(super) picked: Option<Command>,
    pub(super) undoer: DraftsUndoer,
    /// What the user has chosen and the shared state does not hold: theme, size, scale, and widths of columns.
    pub(super) chosen: Remembered,
    /// The file that keeps what is restored at the next start, if there is one.
    pub(super) memory: Option<Memory>,
    pub(super) jobs: Jobs,
    pub(super) ctx: Context,
    /// Files that the window was opened with.
    pub(super) given: Vec<PathBuf>,
    /// True until the first frame.
    is_new: bool,
    /// True while the column on the left is shown in a narrow window too.
    pub(super) shows_form: bool,
}

impl DecouplerWindow {
    /// Opens with the state remembered in `file`, and keeps that file up to date. Without a file it opens on the default
    /// array.
    pub fn new(ctx: &Context, desktop: Desktop, file: Option<WindowFile>) -> Self {
        let woken = ctx.clone();
        Self::woken_by(Arc::new(move || woken.request_repaint()), ctx, desktop, file)
    }

    /// As [`Self::new`]; `wake` is called whenever there is an event to handle.
    pub(super) fn woken_by(wake: Wake, ctx: &Context, desktop: Desktop, file: Option<WindowFile>) -> Self {
        let mut remembered = file.as_ref().map(|file| file.remembered.clone()).unwrap_or_default();
        let damage = file.as_ref().and_then(|file| file.damage.clone());
        let is_usually_dark = ctx.system_theme() != Some(egui::Theme::Light);
        let is_dark = remembered.is_dark.unwrap_or(is_usually_dark);
        theme::install(ctx, is_dark);
        // Our own shortcuts keep to sizes at which everything fits.
        ctx.options_mut(|options| options.zoom_with_keyboard = false);
        let mut shared = Shared::new(is_dark);
        let jobs = Jobs::new(wake);
        let mut views = Views::new(&jobs);
        shared.look.colours = remembered.colours.unwrap_or(shared.look.colours);
        shared.draft = remembered.draft.unwrap_or(shared.draft);
        if let Some(settings) = remembered.recording {
            // Files of older versions do not say it: settings that the user gave are not chosen.
            let is_usual = settings == shared.recording.settings;
            shared.recording.is_auto = remembered.is_auto.unwrap_or(is_usual);
            shared.recording.settings = settings;
        }
        shared.source = remembered.source.unwrap_or_default();
        if let Some(plan) = remembered.plan.take() {
            views.open_plan(&plan);
            shared.recording.plan = Ok(plan);
        }
        let shown = ViewKind::ALL
            .into_iter()
            .find(|view| Some(view.name()) == remembered.view.as_deref());
        shared.shown = shown.unwrap_or_default();
        let mut window = Self {
            shared,
            views,
            notices: Notices::default(),
            modal: None,
            opened: None,
            worker: Worker::start(&jobs),
            keeping: None,
            previews: Background::new("preview", &jobs),
            runs: RunsWorker::start(&jobs),
            opening: Background::new("opened run", &jobs),
            files: Files::new(jobs.clone()),
            pictures: Background::prompt("picture", &jobs),
            dialogs: Dialogs::new(desktop, jobs.clone()),
            picked: None,
            undoer: DraftsUndoer::default(),
            memory: file.map(|file| Memory::new(file, &jobs)),
            chosen: remembered,
            jobs,
            ctx: ctx.clone(),
            given: Vec::new(),
            is_new: true,
            shows_form: false,
        };
        if let Some(damage) = damage {
            window.notices.fail(Matter::Memory, damage);
        }
        if let Some(scale) = window.chosen.scale.filter(|scale| SCALES.contains(scale)) {
            window.set_scale(scale);
        }
        window.request_preview();
        window
    }

    /// Shows the runs in the folder `path`, and keeps finished trainings there from now on. Without it they are gone when
    /// the window closes.
    #[must_use]
    pub fn keeping_runs(self, path: PathBuf) -> Self {
        self.runs.ask(RunsRequest::Open(path));
        self
    }

    /// Keeps checkpoints of running trainings in `folder`, saved every `interval`, and offers those that were cut short when
    /// the program ended.
    #[must_use]
    pub fn keeping_trainings(mut self, folder: PathBuf, interval: Duration) -> Self {
        self.keeping = Some((folder, interval));
        self.keep_trainings();
        self
    }

    /// Keeps checkpoints of the worker's trainings, if they are to be kept.
    pub(super) fn keep_trainings(&self) {
        if let Some((folder, interval)) = &self.keeping {
            self.worker.ask(Request::Keep(folder.clone(), *interval));
        }
    }

    /// State that all views read.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// The views, displayed or not.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// The name of the current view.
    pub fn shown(&self) -> &'static str {
        self.shared.shown.name()
    }

    /// Newest notice that is shown to the user.
    pub fn notice(&self) -> Option<&Notice> {
        self.notices.newest()
    }

    /// Lays out the window and handles the input of the user.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        // Another window may have changed the run list.
        if ui.input(|input| input.events.contains(&Event::WindowFocused(true))) {
            self.runs.ask(RunsRequest::Look);
        }
        if std::mem::take(&mut self.is_new) {
            self.fit_the_screen();
        }
        let mut effects = Vec::new();
        self.take_commands(ui.ctx(), &mut effects);
        self.take_dropped(ui.ctx());
        let (kind, shared) = (self.shared.shown, &self.shared);
        let view = self.views.get(kind);
        let palette = Theme::of(ui).palette;
        let panel = |margin: Margin| PanelFrame::new().fill(palette.panel).inner_margin(margin);
        // Widths of the columns at which their names do not touch their values, and at which the table fits.
        let [form_min, report_min] = [space(62), space(82)];
        let has_report = shared.has_report(ui.available_width());
        // Wider columns must leave the middle this width.
        let within = |min: f32, max: f32, room: f32| Rangef::new(min, (room - space(176)).clamp(min, max));
        let for_form = ui.available_width() - if has_report { report_min } else { 0.0 };
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
            .show(ui, |ui| {
                top_bar_ui(ui, shared, &mut effects, |ui, effects| {
                    view.tools_ui(ui, shared, effects);
                    export_menu_ui(ui, || view.shown(shared), effects);
                });
            });
        let status_line = Panel::bottom("status line")
            .exact_size(space(7))
            .frame(panel(Margin::symmetric(12, 0)))
            .show(ui, |ui| ui.max_rect());
        // A narrow window does not change the width in a wide one.
        let is_narrow = ui.available_width() < 1400.0;
        let shows_form = self.shows_form || shared.obstacle(&Command::Form).is_some();
        let form = shows_form.then(|| {
            Panel::left(if is_narrow { "narrow form" } else { "form" })
                .default_size(self.chosen.form_points.unwrap_or(space(68)))
                .size_range(within(form_min, space(110), for_form))
                .frame(panel(side))
                .show(ui, |ui| view.form_ui(&mut inside(ui), shared, &mut effects))
        });
        if let Some(form) = form.filter(|_| !is_narrow) {
            self.chosen.form_points = Some(form.response.rect.width());
        }
        let report = has_report.then(|| {
            let for_report = ui.available_width();
            Panel::right("report")
                .default_size(self.chosen.report_points.unwrap_or(space(96)))
                .size_range(within(report_min, space(140), for_report))
                .frame(panel(side))
                .show(ui, |ui| view.report_ui(&mut inside(ui), shared, &mut effects))
        });
        if let Some(report) = &report {
            self.chosen.report_points = Some(report.response.rect.width());
        }
        let background = PanelFrame::new().fill(palette.background).inner_margin(Margin::same(8));
        let middle = egui::CentralPanel::default()
            .frame(background)
            .show(ui, |ui| view.body_ui(ui, shared, &mut effects));
        let status = middle.inner.unwrap_or_else(|| training_status(shared));
        status.show(&mut ui.new_child(UiBuilder::new().max_rect(status_line.inner)));
        let parts = [Some(&middle.response), report.as_ref().map(|report| &report.response)];
        for part in parts.into_iter().flatten() {
            card_menu_ui(part, || view.shown(shared), &mut effects);
        }
        let focused = ui.memory(|memory| memory.focused());
        let focused = focused.and_then(|id| ui.ctx().read_response(id));
        // The edge of a column.
        if let Some(edge) = focused.filter(|focused| focused.rect.height() >= middle.response.rect.height()) {
            focus_ring_ui(ui, &edge);
        }
        if changes_something(ui.ctx()) || !effects.is_empty() {
            self.ctx.request_repaint();
        }
        self.notices_ui(ui, middle.response.rect);
        self.apply_all(effects);
        self.undoer
            .feed_state(ui.input(|input| input.time), &drafts(&self.shared));
        self.modal_ui(ui);
        self.dropping_ui(ui);
        self.remember();
        // Work begun in this frame must be finished too.
        self.take_close_request();
    }

    /// Fills the screen if the window would reach beyond it with its title bar: its status line would be out of sight.
    fn fit_the_screen(&self) {
        let size = self.ctx.content_rect().size() + vec2(0.0, space(18));
        let screen = self.ctx.input(|input| input.viewport().monitor_size);
        if screen.is_some_and(|screen| size.x > screen.x || size.y > screen.y) {
            self.ctx.send_viewport_cmd(ViewportCommand::Maximized(true));
        }
    }

    /// Applies the effects requested by views.
    pub(super) fn apply_all(&mut self, effects: Vec<Effect>) {
        for effect in effects {
            self.apply(effect);
        }
    }
}

/// Returns a part of a column that does not widen it.
fn inside(column: &mut Ui) -> Ui {
    column.set_min_size(column.available_size());
    column.new_child(UiBuilder::new().max_rect(column.max_rect()))
}

/// Returns `true` if the user did something in this frame that parts of the window already drawn may depend on: one
/// frame more shows it everywhere. Merely moving the pointer does not count.
pub(super) fn changes_something(ctx: &Context) -> bool {
    ctx.input(|input| {
        let is_change = |event: &Event| match event {
            Event::PointerMoved(_) | Event::MouseMoved(_) => input.pointer.any_down(),
            Event::PointerGone | Event::WindowFocused(_) => false,
            _ => true,
        };
        input.events.iter().any(is_change)
    })
}

impl Drop for DecouplerWindow {
    /// Asks all jobs to end, before each is waited for.
    fn drop(&mut self) {
        self.jobs.cancel_all();
    }
}

impl eframe::App for DecouplerWindow {
    fn logic(&mut self, _ctx: &Context, _frame: &mut eframe::Frame) {
        self.take_events();
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show_ui(ui);
    }
}

/// The file dialogs that the window uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Desktop {
    /// The desktop's own.
    Native,
    /// None: the window asks for paths itself. For tests.
    None,
}
