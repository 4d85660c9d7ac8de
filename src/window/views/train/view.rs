use std::{path::PathBuf, sync::Arc};

use decoupler_core::{text::counted, training::StopReason};
use decoupler_files::import::Setup;
use eframe::egui::{Context, Key, Modifiers, Sense, Ui};
use ndarray::Array2;

use super::{
    charts_card::{BottomTab, charts_card_ui, readings_of_view_ui},
    configuration::configuration_ui,
    decoders::{DecoderMeasuring, DecodersState},
    drawn::{Drawn, Frames},
    exports::{PaperFigure, checkpoint_task, shown},
    inspect::{Lighting, SectionChoice, TestPlace, drawn_nodes},
    press::{PressState, readings_head_ui},
    recording::{RecordingEditor, recipe_task},
    report::{self, report_ui},
    scrub::ScrubState,
    surfaces::surfaces_ui,
};
use crate::window::{
    job::Wake,
    shared::{
        Columns, Effect, FileInUse, Look, Matter, Notice, Offers, Phase, RightCard, RunCommand, RunResult, RunView,
        Shared, Shown, SourceKind, Unfinished, View, run_buttons_ui,
    },
    test_view::RecordedTest,
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
        let failure = self.scrub.take_failure();
        effects.extend(failure.map(|reason| Effect::Notify(Matter::Training, Notice::Failed(reason))));
    }

    fn take_files(&mut self, paths: &[PathBuf], shared: &Shared, effects: &mut Vec<Effect>) -> bool {
        if shared.phase.is_busy() {
            let text = "A training is running: stop it before you open other files.";
            effects.push(Effect::Notify(Matter::Recording, Notice::Failed(text.to_owned())));
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
        let command = run_buttons_ui(ui, shared.phase, (can_train, shared.can_continue()), hint);
        effects.extend(command.map(|command| match command {
            RunCommand::Train => Effect::Train,
            RunCommand::Continue => Effect::Continue,
            RunCommand::Pause => Effect::Pause,
            RunCommand::Resume => Effect::Resume,
            RunCommand::Stop => Effect::Stop,
        }));
        ui.add_space(space(4));
        let what = snapshot_word(shared.source);
        if let Some(snapshot) = snapshot_ui(ui, what, self.snapshot, Self::snapshots(shared)) {
            self.show_snapshot(snapshot);
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        let mut shown = shown(self, shared);
        shown.push(Shown::file("Recipe", recipe_task(shared)));
        shown
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

/// Returns the word for an item of the test set.
fn snapshot_word(source: SourceKind) -> &'static str {
    match source {
        SourceKind::Array => "snapshot",
        SourceKind::Recording => "sample",
    }
}

/// Returns the training if it is being prepared or has unsaved epochs.
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
        Phase::Training | Phase::Paused | Phase::Calibrating => {
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
    /// In its own column, right of the workbench.
    ReportBeside,
    /// On a card below the surfaces, next to the charts, so that the surfaces keep their width in narrow windows.
    ReportBelow,
}

impl WorkbenchLayout {
    /// Returns the position in a window of this width in points.
    pub fn of_width(width: f32) -> Self {
        /// Window width from which a column next to the surfaces leaves them enough room.
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

/// The Train view.
#[derive(Debug)]
pub struct TrainView {
    /// Snapshot of the test set: a frame of an array, a sample of a recording.
    pub snapshot: usize,
    /// Target of a recording whose values the charts show.
    pub(super) target: usize,
    /// Snapshot last sent to the worker.
    pub(super) watched: usize,
    /// Surface shown on the right-hand card.
    pub right: RightCard,
    /// The chart below.
    pub tab: BottomTab,
    /// Item lit by the pointer, in every picture.
    pub lights: Lighting,
    /// The wire along which the surfaces are cut.
    pub section: SectionChoice,
    /// True if each decoupled node has an error bar of its root mean square error.
    pub has_error_bars: bool,
    /// Drawings of the test set.
    pub drawn: Drawn,
    /// The finger on the actual surface.
    pub press: PressState,
    /// The displayed past epoch.
    pub scrub: ScrubState,
    /// Editor of the recording that is trained on.
    pub(in crate::window) recording: RecordingEditor,
    /// Results of other decoders on the test set.
    pub decoders: DecodersState,
    pub(super) measuring: DecoderMeasuring,
}

impl TrainView {
    /// Nothing drawn yet. `wake` is called when a decoder is measured.
    pub fn new(wake: Wake) -> Self {
        Self {
            snapshot: 0,
            target: 0,
            watched: 0,
            right: RightCard::default(),
            tab: BottomTab::default(),
            lights: Lighting::default(),
            section: SectionChoice::default(),
            has_error_bars: false,
            drawn: Drawn::default(),
            press: PressState::new(&wake),
            scrub: ScrubState::new(Arc::clone(&wake)),
            recording: RecordingEditor::new(&wake),
            decoders: DecodersState::default(),
            measuring: DecoderMeasuring::new(wake),
        }
    }

    /// Draws what is displayed.
    pub(super) fn follow(&mut self, shared: &Shared) {
        self.scrub.follow(shared);
        let result = result_of(&self.scrub, shared);
        let target = shared.recorded_test().map_or(0, |test| self.target_of(test));
        self.snapshot = self.drawn.follow(shared, result, self.snapshot, target);
        self.press.follow(shared, result);
        let nodes = drawn_nodes(shared, self.frames().actual.nodes_mm.len());
        self.lights.node = self.lights.node.filter(|&node| node < nodes);
    }

    /// Returns the current result: that of the training so far, or of the displayed past epoch.
    pub fn result<'a>(&'a self, shared: &'a Shared) -> Option<&'a RunResult> {
        result_of(&self.scrub, shared)
    }

    /// Returns the displayed surfaces: those under the finger, or those of the test set.
    pub fn frames(&self) -> &Frames {
        self.press.frames().unwrap_or(&self.drawn.frames)
    }

    /// Returns the drops of the readings of the displayed surface from those at rest, in percent: rows read × M4.
    pub fn drops_percent(&self) -> Option<&Array2<f64>> {
        match self.press.shown() {
            Some(shown) => shown.drops_percent.as_ref(),
            None => self.drawn.drops_percent.as_ref(),
        }
    }

    /// Goes to a snapshot of the test set.
    pub(super) fn show_snapshot(&mut self, snapshot: usize) {
        self.snapshot = snapshot;
        self.press.let_go();
    }

    /// Returns the number of snapshots of the current test set: frames of an array, samples of a recording.
    pub(super) fn snapshots(shared: &Shared) -> usize {
        let of_recording = || shared.recorded_test().map(|test| test.set.samples());
        let of_array = shared.test().map(|test| test.snapshots.len());
        of_array.or_else(of_recording).unwrap_or(0)
    }

    /// Returns the target of `test` whose values the charts show: the one chosen, or the last.
    pub(super) fn target_of(&self, test: &RecordedTest) -> usize {
        self.target.min(test.set.outputs().saturating_sub(1))
    }

    /// Returns the root mean square error of each node, where error bars are on and there is a result.
    pub fn error_bars_mm(&self) -> Option<&[f64]> {
        self.has_error_bars.then(|| self.drawn.spread_mm()).flatten()
    }

    /// Goes to this value of the test set and marks its node.
    pub(super) fn go_to(&mut self, place: TestPlace) {
        self.show_snapshot(place.snapshot);
        self.lights.node = place.node;
    }

    /// Displays a figure of the paper, and trains its network unless that is the current one.
    pub(super) fn show_paper_figure(&mut self, figure: PaperFigure, shared: &Shared, effects: &mut Vec<Effect>) {
        let settings = figure.settings();
        effects.push(Effect::Configure(Box::new(settings)));
        self.right = RightCard::Decoupled;
        match figure.mode {
            Some(mode) => effects.push(Effect::Look(Look { mode, ..shared.look })),
            None => self.tab = BottomTab::Nodes,
        }
        let is_complete = |run: &RunView| {
            let was_stopped = run.stop_reason == Some(StopReason::Stopped);
            run.asked == Setup::from(settings) && run.stop_reason.is_some() && !was_stopped
        };
        if !shared.run.as_ref().is_some_and(is_complete) {
            effects.push(Effect::Train);
        }
    }
}

fn result_of<'a>(scrub: &'a ScrubState, shared: &'a Shared) -> Option<&'a RunResult> {
    let latest = shared.result()?;
    Some(scrub.result().unwrap_or(latest))
}
