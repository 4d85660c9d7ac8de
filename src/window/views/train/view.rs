use std::path::PathBuf;

use decoupler_core::text::counted;
use eframe::egui::{Context, Key, Modifiers, Sense, Ui};

use super::{
    charts_card::{charts_card_ui, readings_of_view_ui},
    configuration::configuration_ui,
    exports::{checkpoint_task, train_exports},
    press::readings_head_ui,
    recording::recipe_export,
    report::{self, report_ui},
    state::TrainView,
    surfaces::surfaces_ui,
};
use crate::window::{
    shared::{
        Columns, Effect, Export, FileInUse, Matter, Notice, Offers, Phase, RunWish, Shared, SourceKind, Unfinished,
        View, run_buttons_ui,
    },
    theme::space,
    widgets::{card_ui, snapshot_ui},
};

impl View for TrainView {
    fn name(&self) -> &'static str {
        "Train"
    }

    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.recording.take_events(shared, effects);
        self.measuring.follow(shared, &mut self.decoders);
    }

    fn take_files(&mut self, paths: &[PathBuf], shared: &Shared, effects: &mut Vec<Effect>) -> bool {
        if shared.phase.is_busy() {
            let text = "A training is running: stop it before you open other files.";
            effects.push(Effect::Tell(Matter::Recording, Notice::Failed(text.to_owned())));
        } else {
            self.recording.open(paths.to_vec());
        }
        true
    }

    fn files_in_use(&self) -> Vec<FileInUse> {
        self.recording.files_in_use()
    }

    fn unfinished(&self, shared: &Shared) -> Vec<Unfinished> {
        let mut unfinished = Vec::from_iter(unfinished_training(shared));
        if self.decoders.is_measuring() {
            let results = self.decoders.measured.as_deref().unwrap_or_default();
            let measured = results.iter().filter(|result| result.report.is_some()).count();
            let progress = format!("{measured} of {} measured", counted(results.len(), "decoder"));
            unfinished.push(Unfinished::discarded("More decoders", progress));
        }
        unfinished
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        let phase = shared.phase;
        let is_idle = !phase.is_busy() && phase != Phase::Died;
        if offers.offer_keys("Train", Modifiers::COMMAND, Key::Enter, is_idle) {
            effects.push(Effect::Train);
        }
        if offers.offer("Continue training", shared.can_continue()) {
            effects.push(Effect::Continue);
        }
        let (name, effect) = if phase == Phase::Paused {
            ("Resume training", Effect::Resume)
        } else {
            ("Pause training", Effect::Pause)
        };
        let can_pause = matches!(phase, Phase::Training | Phase::Paused);
        if offers.offer_keys(name, Modifiers::COMMAND, Key::P, can_pause) {
            effects.push(effect);
        }
        if offers.offer_keys("Stop training", Modifiers::COMMAND, Key::Period, phase.is_busy()) {
            effects.push(Effect::Stop);
        }
        if offers.offer("Open files", !phase.is_busy()) {
            effects.push(Effect::ChooseFile(self.recording.open_task()));
        }
        if shared.source == SourceKind::Array
            && offers.offer("Press the middle of the surface", shared.test().is_some())
            && let Some(test) = shared.test()
        {
            self.press.press_middle(test);
        }
        let what = snapshot_word(shared.source);
        let has_next = self.snapshot + 1 < Self::snapshots(shared);
        if offers.offer_keys(format!("Next test {what}"), Modifiers::NONE, Key::PageDown, has_next) {
            self.show_snapshot(self.snapshot + 1);
        }
        let name = format!("Previous test {what}");
        if offers.offer_keys(name, Modifiers::NONE, Key::PageUp, self.snapshot > 0) {
            self.show_snapshot(self.snapshot - 1);
        }
        self.offer_charts(offers, shared);
    }

    fn take_pointer(&mut self, ctx: &Context, shared: &Shared) {
        let frames = self.frames().clone();
        self.press.take_pointer(ctx, shared.test(), &frames, self.lights.node);
        self.follow(shared);
    }

    fn columns(&self, window_width: f32) -> Columns {
        let has_report = WorkbenchLayout::of_width(window_width) == WorkbenchLayout::ReportBeside;
        Columns {
            form_width: if has_report { space(68) } else { space(62) },
            has_report,
        }
    }

    fn tools_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let can_train = shared.phase != Phase::Died;
        let hint = match shared.source {
            SourceKind::Array => "draws the sets and trains the network",
            SourceKind::Recording => "reads the recording and trains the network",
        };
        let wish = run_buttons_ui(ui, shared.phase, (can_train, shared.can_continue()), hint);
        effects.extend(wish.map(|wish| match wish {
            RunWish::Train => Effect::Train,
            RunWish::Continue => Effect::Continue,
            RunWish::Pause => Effect::Pause,
            RunWish::Resume => Effect::Resume,
            RunWish::Stop => Effect::Stop,
        }));
        ui.add_space(space(4));
        let what = snapshot_word(shared.source);
        if let Some(snapshot) = snapshot_ui(ui, what, self.snapshot, Self::snapshots(shared)) {
            self.show_snapshot(snapshot);
        }
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        let mut exports = train_exports(self, shared);
        exports.push(recipe_export(shared));
        exports
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        if let Some(figure) = configuration_ui(ui, &mut self.recording, shared, effects) {
            self.show_paper_figure(figure, shared, effects);
        }
    }

    fn report_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow(shared);
        report::report_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        if self.recording.is_on_show(shared) {
            return self.recording.columns_ui(ui, shared, effects);
        }
        self.follow(shared);
        if self.watched != self.snapshot {
            self.watched = self.snapshot;
            effects.push(Effect::Watch(self.snapshot));
        }
        workbench_ui(ui, self, shared, effects);
    }
}

/// The word for what the test set consists of.
fn snapshot_word(source: SourceKind) -> &'static str {
    match source {
        SourceKind::Array => "snapshot",
        SourceKind::Recording => "sample",
    }
}

/// The training that is being prepared, or has epochs that are nowhere saved.
fn unfinished_training(shared: &Shared) -> Option<Unfinished> {
    let training = |progress, saving| Unfinished {
        work: "Training",
        progress,
        saving,
        is_kept: shared.runs.path.is_some(),
    };
    let run = shared.run.as_ref();
    match shared.phase {
        Phase::Preparing => {
            let progress = match shared.source {
                SourceKind::Array => "its samples are being drawn",
                SourceKind::Recording => "its files are being read",
            };
            Some(training(progress.to_owned(), None))
        }
        Phase::Training | Phase::Paused => {
            let run = run.filter(|run| !run.is_saved)?;
            let epochs = run.settings().training.stopping.epochs;
            let epoch = run.latest().map_or(0, |latest| latest.epoch);
            Some(training(
                format!("epoch {epoch} of {epochs}"),
                Some(checkpoint_task(run)),
            ))
        }
        Phase::Idle | Phase::Ended(_) | Phase::Died => None,
    }
}

/// Position of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkbenchLayout {
    /// In a column of its own, right of the workbench.
    ReportBeside,
    /// On a card below the surfaces, next to the charts: narrow windows leave the surfaces their width.
    ReportBelow,
}

impl WorkbenchLayout {
    /// That of a window this many points wide.
    pub fn of_width(width: f32) -> Self {
        /// A column next to the surfaces must leave them this window.
        const MIN_FOR_COLUMN: f32 = 1400.0;
        if width < MIN_FOR_COLUMN {
            Self::ReportBelow
        } else {
            Self::ReportBeside
        }
    }
}

/// The middle of the window: both surfaces above, the charts below, and next to them the readings of an array.
pub fn workbench_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let layout = WorkbenchLayout::of_width(ui.ctx().content_rect().width());
    let whole = ui.available_rect_before_wrap();
    let gap = space(2);
    let (share, least) = match layout {
        WorkbenchLayout::ReportBeside => (0.32, space(40)),
        WorkbenchLayout::ReportBelow => (0.42, space(54)),
    };
    let lower_height = (share * whole.height()).clamp(least, space(75));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    surfaces_ui(ui, upper.with_max_y(upper.max.y - gap), view, shared, effects);
    let has_sensor = shared.source == SourceKind::Array;
    let (charts, has_readings) = match layout {
        WorkbenchLayout::ReportBeside if !has_sensor => (lower, false),
        WorkbenchLayout::ReportBeside => {
            let width = (0.4 * lower.width()).floor();
            let (charts, readings) = lower.split_left_right_at_x(lower.right() - width);
            card_ui(ui, readings, |ui| {
                readings_head_ui(ui, view.drops_percent());
                readings_of_view_ui(ui, view, shared);
            });
            (charts.with_max_x(charts.max.x - gap), false)
        }
        WorkbenchLayout::ReportBelow => {
            let width = (0.45 * lower.width()).clamp(space(82), space(96));
            let (charts, report) = lower.split_left_right_at_x(lower.right() - width);
            card_ui(ui, report, |ui| report_ui(ui, view, shared, effects));
            (charts.with_max_x(charts.max.x - gap), has_sensor)
        }
    };
    card_ui(ui, charts, |ui| {
        charts_card_ui(ui, view, shared, has_readings, effects);
    });
    ui.allocate_rect(whole, Sense::hover());
}
