use std::sync::Arc;

use decoupler_core::{dataset::Dataset, text::counted};
use eframe::egui::{Sense, Ui};
use ndarray::Array2;

use super::{
    charts::{answers_ui, charts_card_ui, readings_of_view_ui},
    configuration::configuration_ui,
    decoders::Decoders,
    exports::shown,
    press::{PressState, readings_head_ui},
    recording::{RecordingEditor, recipe_task},
    report::{self, OLD},
    scrub::ScrubState,
    section::SectionChoice,
    surfaces::surfaces_ui,
};
use crate::window::{
    job::Jobs,
    plotting::SeriesView,
    shared::{
        Command, Effect, Holdings, NetworkSource, Offers, RightCard, RunResult, Shared, Shown, SourceKind, Status,
        Unfinished, View, run_buttons_ui,
    },
    test_view::{Drawing, TestView},
    theme::space,
    widgets::{card_ui, dim_ui, snapshot_ui},
};

impl View for TrainView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.recording.take_events(shared, effects);
        self.decoders.follow_training(shared);
        self.scrub.follow(shared, effects);
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let unfinished = self.decoders.is_measuring().then(|| {
            let results = self.decoders.measured.as_deref().unwrap_or_default();
            let measured = results.iter().filter(|result| result.report.is_some()).count();
            let progress = format!("{measured} of {} measured", counted(results.len(), "decoder"));
            Unfinished::new("Train", "More decoders", progress)
        });
        Holdings {
            unfinished: Vec::from_iter(unfinished),
            files: self.recording.files_in_use(),
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.is_heard {
            let lit = self.lights.node;
            let lit = lit.and_then(|node| self.drawing()?.actual.nodes.get(node).copied());
            self.press
                .take_pointer(offers.ctx, shared.skin().map(|skin| &**skin), lit);
            self.follow(shared);
        }
        for command in [
            Command::Train,
            Command::TrainLonger,
            Command::PauseTraining,
            Command::StopTraining,
        ] {
            if offers.offer(command.clone()) {
                effects.push(Effect::Do(command));
            }
        }
        if offers.offer(Command::OpenFiles) {
            effects.push(Effect::ChooseFile(self.recording.open_task()));
        }
        if offers.offer(Command::DecodeFile)
            && let Some(run) = shared.shown_run()
        {
            effects.push(Effect::ChooseFile(NetworkSource::of(run).decode()));
        }
        if let Some(skin) = shared.skin()
            && offers.offer(Command::PressMiddle)
        {
            self.press.press_middle(skin);
        }
        let snapshots = shared.test().map_or(0, TestView::snapshots);
        if let Some(snapshot) = offers.offer_samples(self.snapshot, snapshots) {
            self.show_snapshot(snapshot);
        }
        self.offer_charts(offers, shared);
    }

    fn tools_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let what = match shared.source {
            SourceKind::Array => "snapshot",
            SourceKind::Recording => "sample",
        };
        let snapshots = shared.test().map_or(0, TestView::snapshots);
        let width = ui.ctx().content_rect().width();
        // In a narrow window the status line and the keys remain.
        if let Some(obstacle) = shared.missing_recording().filter(|_| width >= 1200.0 && snapshots == 0) {
            dim_ui(ui, obstacle);
        } else if width >= 800.0 {
            if let Some(snapshot) = snapshot_ui(ui, what, self.snapshot, snapshots) {
                self.show_snapshot(snapshot);
            }
            ui.add_space(space(4));
        }
        run_buttons_ui(ui, shared, effects);
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        let mut shown = shown(self, shared);
        shown.push(Shown::file("Recipe", recipe_task(shared)));
        shown
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        configuration_ui(ui, &mut self.recording, shared, effects);
    }

    fn report_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow(shared);
        report::report_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        if self.recording.is_on_show(shared) {
            self.recording.columns_ui(ui, shared, effects);
            return None;
        }
        self.follow(shared);
        self.workbench_ui(ui, shared, effects);
        None
    }
}

/// The item under the pointer in one of the pictures, which lights up in all of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lighting {
    /// A node, by its number among those drawn; a target of a recording.
    pub node: Option<usize>,
    /// A row-wire, by its place among those read: a reading is that of all its nodes.
    pub row: Option<usize>,
}

/// A test set, the outputs of the network on it, and a snapshot.
type DrawnOf = (Arc<Dataset>, Option<Arc<Array2<f64>>>, usize);

/// What is drawn of a snapshot of the test set, until it, the result or the snapshot changes.
#[derive(Debug, Default)]
struct Drawn {
    of: Option<DrawnOf>,
    /// Surfaces; `None` where none goes through the targets of a recording.
    surfaces: Option<Drawing>,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    drops_percent: Option<Array2<f64>>,
}

/// The Train view.
#[derive(Debug)]
pub struct TrainView {
    /// Snapshot of the test set: a frame of an array, a sample of a recording.
    pub snapshot: usize,
    /// Target of a recording whose values the charts show.
    pub(super) target: usize,
    /// Surface shown on the right-hand card.
    pub right: RightCard,
    /// Name of the chart below, and of that of the answers for a recording.
    pub tab: &'static str,
    pub(super) upper: &'static str,
    /// The part of the values over time in view.
    pub(super) series: SeriesView,
    /// Item lit by the pointer, in every picture.
    pub lights: Lighting,
    /// The wire along which the surfaces are cut.
    pub section: SectionChoice,
    /// True if each decoded node has an error bar of its root mean square error.
    pub has_error_bars: bool,
    /// Drawings of the test set.
    drawn: Drawn,
    /// The finger on the actual surface.
    pub press: PressState,
    /// The displayed past epoch.
    pub scrub: ScrubState,
    /// Editor of the recording that is trained on.
    pub(in crate::window) recording: RecordingEditor,
    /// Results of other decoders on the test set.
    pub decoders: Decoders,
}

impl TrainView {
    /// Nothing drawn yet.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            snapshot: 0,
            target: 0,
            right: RightCard::default(),
            tab: "Loss",
            upper: "",
            series: SeriesView::default(),
            lights: Lighting::default(),
            section: SectionChoice::default(),
            has_error_bars: false,
            drawn: Drawn::default(),
            press: PressState::new(jobs),
            scrub: ScrubState::new(jobs),
            recording: RecordingEditor::new(jobs),
            decoders: Decoders::new(jobs, &[]),
        }
    }

    /// Shows both surfaces above, the charts below, and next to them the readings of an array. In a narrow window, the report
    /// takes the place of the readings, so that the surfaces keep their width.
    fn workbench_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let is_narrow = !shared.has_report(ui.ctx().content_rect().width());
        let whole = ui.available_rect_before_wrap();
        let gap = space(2);
        let (share, least) = if is_narrow {
            (0.42, space(54))
        } else {
            (0.32, space(40))
        };
        let lower_height = (share * whole.height()).clamp(least, space(75));
        let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
        let upper = upper.with_max_y(upper.max.y - gap);
        let has_sensor = shared.source == SourceKind::Array;
        let is_old = shared.shown_run().is_some_and(|run| shared.is_old(run));
        let opacity = if is_old { OLD } else { 1.0 };
        match has_sensor {
            true => surfaces_ui(ui, upper, self, shared, effects),
            false => {
                ui.scope(|ui| {
                    ui.multiply_opacity(opacity);
                    answers_ui(ui, upper, self, shared, effects);
                });
            }
        }
        let width = match is_narrow {
            true => (0.45 * lower.width())
                .clamp(space(82), space(96))
                .min(0.6 * lower.width()),
            false => (0.4 * lower.width()).floor(),
        };
        let (mut charts, right) = lower.split_left_right_at_x(lower.right() - width);
        charts.max.x -= gap;
        if is_narrow {
            card_ui(ui, right, |ui| report::report_ui(ui, self, shared, effects));
        } else if has_sensor {
            card_ui(ui, right, |ui| {
                readings_head_ui(ui, self.drops_percent());
                readings_of_view_ui(ui, self, shared);
            });
        } else {
            charts = lower;
        }
        let has_readings = is_narrow && has_sensor;
        card_ui(ui, charts, |ui| {
            ui.multiply_opacity(opacity);
            charts_card_ui(ui, self, shared, has_readings);
        });
        ui.allocate_rect(whole, Sense::hover());
    }

    /// Draws what is displayed, at the nearest snapshot that there is.
    fn follow(&mut self, shared: &Shared) {
        let (test, result) = (shared.test(), self.scrub.shown(shared));
        self.press.follow(shared, result);
        if let Some(skin) = shared.skin() {
            self.section.follow(self.press.place_mm(), skin);
        }
        self.snapshot = self
            .snapshot
            .min(test.map_or(0, |test| test.snapshots().saturating_sub(1)));
        let answers = result.map(|result| &result.answers);
        let of = test.map(|test| (Arc::clone(&test.set), answers.cloned(), self.snapshot));
        let key = |of: &Option<DrawnOf>| {
            let (set, answers, snapshot) = of.as_ref()?;
            Some((Arc::as_ptr(set), answers.as_ref().map(Arc::as_ptr), *snapshot))
        };
        if key(&of) != key(&self.drawn.of) {
            self.drawn = Drawn {
                surfaces: test.and_then(|test| test.drawing(answers.map(|answers| &**answers), self.snapshot)),
                drops_percent: test.and_then(|test| test.skin.as_ref()?.drops_percent(&test.set, self.snapshot)),
                of,
            };
        }
    }

    /// Returns the current result: that of the training so far, or of the displayed past epoch.
    pub fn result<'a>(&'a self, shared: &'a Shared) -> Option<&'a RunResult> {
        self.scrub.shown(shared)
    }

    /// Returns the displayed surfaces: those under the finger, or those of the test set.
    pub fn drawing(&self) -> Option<&Drawing> {
        let pressed = self.press.shown().map(|shown| &shown.drawing);
        pressed.or(self.drawn.surfaces.as_ref())
    }

    /// Returns the drops of the readings of the displayed surface from those at rest, in percent: rows read × M4.
    pub fn drops_percent(&self) -> Option<&Array2<f64>> {
        match self.press.shown() {
            Some(shown) => shown.drops_percent.as_ref(),
            None => self.drawn.drops_percent.as_ref(),
        }
    }

    /// Goes to a snapshot of the test set.
    fn show_snapshot(&mut self, snapshot: usize) {
        self.snapshot = snapshot;
        self.press.let_go();
    }

    /// Goes to a snapshot of the test set and marks one of its nodes, or a target of a recording.
    pub(super) fn go_to(&mut self, snapshot: usize, node: Option<usize>) {
        self.show_snapshot(snapshot);
        self.lights.node = node;
    }

    /// Returns the target whose values the charts show: the one chosen, or the last; none for the nodes of an array.
    pub(super) fn target_of(&self, test: &TestView) -> Option<usize> {
        let last = test.problem.targets.len().saturating_sub(1);
        test.skin.is_none().then(|| self.target.min(last))
    }
}
