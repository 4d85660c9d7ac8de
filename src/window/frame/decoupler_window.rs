use std::{ops::RangeInclusive, path::PathBuf, sync::Arc, time::Duration};

use decoupler_files::export::exit_leaving_nothing;
use eframe::egui::{self, Context, Event, Frame as PanelFrame, Key, Margin, Modifiers, Panel, Ui};

use super::{
    actions::{Overlay, Undoing},
    clipboard::{Clipboard, Copying},
    closing::Closing,
    export_dialog::{card_menu_ui, export_menu_ui},
    files::{Dialogs, Files, open_folder},
    notices::{self, Notices, notice_ui},
    remembered::{Memory, Remembered, WindowFile},
    save_form::{self, Saving, save_form_ui},
    top_bar::{Reach, edge_ui, top_bar_ui, widths_points},
    tour::{self, Tour, tour_ui},
};
use crate::signals::on_termination;
use crate::window::{
    job::{Background, Wake},
    preview::PreviewEvent,
    shared::{Action, Effect, Matter, Notice, Offers, Phase, RunsWorker, Shared},
    theme::{self, Theme, space},
    training_worker::{Request, Worker},
    views::Views,
};

/// The window: the shared state, the views, and the one place where their effects are applied.
pub struct DecouplerWindow {
    pub(super) shared: Shared,
    pub(super) views: Views,
    /// Places and names of the views.
    pub(super) names: Vec<(usize, &'static str)>,
    /// The place of the current view among all.
    pub(super) shown: usize,
    pub(super) notices: Notices,
    /// A file waiting for its path.
    pub(super) saving: Option<Saving>,
    /// The path last typed, offered again for the same file.
    pub(super) typed: Option<Saving>,
    /// The checkpoint that the training of the Train view was opened from.
    pub(super) opened: Option<PathBuf>,
    pub(super) worker: Worker,
    /// Folder for the checkpoints of running trainings, and the interval at which they are saved.
    pub(super) keeping: Option<(PathBuf, Duration)>,
    pub(super) previews: Background<PreviewEvent>,
    pub(super) runs: RunsWorker,
    pub(super) files: Files,
    pub(super) copying: Copying,
    pub(super) dialogs: Dialogs,
    pub(super) closing: Option<Closing>,
    /// Modal list over the window.
    pub(super) overlay: Overlay,
    /// The tour, unless it has ended.
    pub(super) tour: Option<Tour>,
    /// Name of the action picked from the list, which runs in the next frame.
    pub(super) picked: Option<String>,
    pub(super) undoing: Undoing,
    pub(super) remembered: Remembered,
    /// The file that keeps it, if there is one.
    pub(super) memory: Option<Memory>,
    pub(super) wake: Wake,
    pub(super) ctx: Context,
    /// Files that the window was opened with.
    pub(super) given: Vec<PathBuf>,
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
        let remembered = file.as_ref().map(|file| file.remembered.clone()).unwrap_or_default();
        let damage = file.as_ref().and_then(|file| file.damage.clone());
        let is_dark = remembered
            .is_dark
            .unwrap_or(ctx.system_theme() != Some(egui::Theme::Light));
        theme::install(ctx, is_dark);
        // Our own shortcuts keep to sizes at which everything fits.
        ctx.options_mut(|options| options.zoom_with_keyboard = false);
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
            opened: None,
            worker: Worker::start(Arc::clone(&wake)),
            keeping: None,
            previews: Background::new("preview", Arc::clone(&wake)),
            runs: RunsWorker::start(Arc::clone(&wake)),
            files: Files::new(Arc::clone(&wake)),
            copying: Copying::new(Clipboard::of(desktop), Arc::clone(&wake)),
            dialogs: Dialogs::new(desktop, Arc::clone(&wake)),
            closing: None,
            overlay: Overlay::None,
            // A window that cannot remember the end of the tour would begin it at every start.
            tour: (file.is_some() && remembered.has_toured != Some(true)).then(Tour::default),
            picked: None,
            undoing: Undoing::default(),
            memory: file.map(|file| Memory::new(file, Arc::clone(&wake))),
            remembered,
            wake,
            ctx: ctx.clone(),
            given: Vec::new(),
        };
        if let Some(damage) = damage {
            window.notices.fail(Matter::Memory, damage);
        }
        if let Some(scale) = window.remembered.scale.filter(|scale| SCALES.contains(scale)) {
            window.set_scale(scale);
        }
        if let Some(colours) = window.remembered.colours {
            window.shared.look.colours = colours;
        }
        if let Some(draft) = window.remembered.draft {
            window.shared.draft = draft;
        }
        if let Some(settings) = window.remembered.recording {
            // Files of older versions do not say it: settings that the user gave are not chosen.
            let is_usual = settings == window.shared.recording.settings;
            window.shared.recording.is_auto = window.remembered.is_auto.unwrap_or(is_usual);
            window.shared.recording.settings = settings;
        }
        window.shared.source = window.remembered.source.unwrap_or_default();
        if let Some(plan) = window.remembered.plan.clone() {
            window.views.open_plan(&plan);
            window.shared.recording.plan = Ok(Arc::new(plan));
        }
        if let Some(place) = window.place_of(window.remembered.view.as_deref()) {
            window.show(place);
        }
        window.request_preview();
        window
    }

    /// Shows the runs in the folder `path`, and keeps finished trainings there from now on. Without it they are gone when
    /// the window closes.
    #[must_use]
    pub fn keeping_runs(self, path: PathBuf) -> Self {
        self.runs.open(path);
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

    /// Saves the running training and ends the program on SIGTERM and SIGHUP, even if the window does not respond.
    pub(super) fn save_on_termination(&self) {
        let save = self.worker.saver();
        on_termination(move |status| {
            save();
            exit_leaving_nothing(i32::from(status));
        });
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
        self.names[self.shown].1
    }

    /// Newest notice that is shown to the user.
    pub fn notice(&self) -> Option<&Notice> {
        self.notices.newest()
    }

    /// Lays out the window and handles the input of the user.
    pub fn show_ui(&mut self, ui: &mut Ui) {
        // Another window may have changed the run list.
        if ui.input(|input| input.events.contains(&egui::Event::WindowFocused(true))) {
            self.runs.look();
        }
        let mut effects = Vec::new();
        let actions = self.offer_actions(ui.ctx(), &mut effects);
        self.take_dropped(ui.ctx(), &mut effects);
        let is_asked = self.is_asked();
        let can_reconnect = self.views.live.can_retry(&self.shared);
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
                    export_menu_ui(ui, || view.shown(shared), &mut effects);
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
                let remedies = match matter {
                    _ if matches!(notice, Notice::Saved(..)) => vec![notices::Reply::OpenFolder],
                    Matter::Training if shared.phase == Phase::Died => vec![notices::Reply::Restart],
                    Matter::Live if can_reconnect => vec![notices::Reply::Reconnect],
                    // From right to left.
                    Matter::CutShort if !shared.phase.is_busy() => {
                        vec![notices::Reply::Discard, notices::Reply::Resume]
                    }
                    _ => Vec::new(),
                };
                replies.extend(notice_ui(ui, notice, remedies).map(|reply| (place, reply)));
            }
            view.body_ui(ui, shared, &mut effects);
            replies
        });
        for part in [Some(&replies.response), report.as_ref().map(|report| &report.response)]
            .into_iter()
            .flatten()
        {
            card_menu_ui(part, || view.shown(shared), &mut effects);
        }
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
        // Before the layout changes.
        for (place, reply) in replies.inner {
            match reply {
                notices::Reply::Dismiss => self.notices.dismiss(place),
                notices::Reply::OpenFolder => {
                    if let Some((_, Notice::Saved(_, path))) = self.notices.iter().nth(place) {
                        open_folder(path);
                    }
                }
                notices::Reply::Restart => self.restart_worker(),
                notices::Reply::Reconnect => self.views.live.retry(&self.shared, &mut effects),
                notices::Reply::Resume => self.resume_cut_short(),
                notices::Reply::Discard => self.discard_cut_short(),
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
        self.undoing.follow(ui.input(|input| input.time), &self.shared);
        self.overlay_ui(ui, &actions);
        self.dropping_ui(ui);
        self.tour_ui(ui, &actions);
        self.ask_for_path(ui);
        self.remember();
        // Work begun in this frame must be finished too.
        self.take_close_request();
        self.closing_ui(ui);
    }

    /// Applies the effects requested by views.
    pub(super) fn apply_all(&mut self, effects: Vec<Effect>) {
        for effect in effects {
            self.apply(effect);
        }
    }

    /// Shows the tour unless a modal is open, and carries out the answer of the user.
    fn tour_ui(&mut self, ui: &Ui, actions: &[Action]) {
        let Some(tour) = self.tour.filter(|_| !self.is_asked()) else {
            return;
        };
        match tour_ui(ui, tour, actions) {
            Some(tour::Reply::Show(tour)) => self.tour = Some(tour),
            Some(tour::Reply::Do(name)) => self.picked = Some(name.to_owned()),
            Some(tour::Reply::End) => self.end_tour(),
            None => return,
        }
        self.ctx.request_repaint();
    }

    fn ask_for_path(&mut self, ui: &mut Ui) {
        match self.saving.as_mut().and_then(|saving| save_form_ui(ui, saving)) {
            Some(save_form::Reply::Path(path, asks)) => self.take_typed(path, asks),
            Some(save_form::Reply::Cancel) => self.saving = None,
            None => {}
        }
    }
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

impl eframe::App for DecouplerWindow {
    fn logic(&mut self, _ctx: &Context, _frame: &mut eframe::Frame) {
        self.take_events();
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show_ui(ui);
    }
}

/// Services of the desktop that the window uses: file dialogs and the clipboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Desktop {
    /// The desktop's own.
    Native,
    /// None: the window asks for paths itself, and copies stay within the toolkit. For tests.
    None,
}

/// Interface scales offered to the user, relative to the default.
pub(super) const SCALES: RangeInclusive<f32> = 0.8..=2.0;

/// Step between scales.
const STEP: f32 = 0.1;

impl DecouplerWindow {
    /// Offers larger and smaller text and controls.
    pub(super) fn offer_scales(&mut self, offers: &mut Offers<'_>) {
        let scale = self.ctx.zoom_factor();
        let can_grow = scale < *SCALES.end() - 0.5 * STEP;
        let can_shrink = scale > *SCALES.start() + 0.5 * STEP;
        // On many keyboards plus is the shifted equals sign.
        let is_equals = can_grow
            && self
                .ctx
                .input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Equals));
        if offers.offer_keys("Larger interface", Modifiers::COMMAND, Key::Plus, can_grow) || is_equals {
            self.set_scale(scale + STEP);
        }
        if offers.offer_keys("Smaller interface", Modifiers::COMMAND, Key::Minus, can_shrink) {
            self.set_scale(scale - STEP);
        }
        let is_usual = (scale - 1.0).abs() < 0.5 * STEP;
        if offers.offer_keys("Reset the interface size", Modifiers::COMMAND, Key::Num0, !is_usual) {
            self.set_scale(1.0);
        }
    }

    /// Sets the interface scale, rounded to whole steps and limited to [`SCALES`].
    pub(super) fn set_scale(&mut self, scale: f32) {
        let scale = ((scale / STEP).round() * STEP).clamp(*SCALES.start(), *SCALES.end());
        self.ctx.set_zoom_factor(scale);
        self.remembered.scale = Some(scale);
    }
}
