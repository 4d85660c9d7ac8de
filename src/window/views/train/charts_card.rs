use decoupler_files::figure::{
    Decoded, Figure, HeatMap, Ink, LineAt, LineStyle, PlotFigure, RegressionLine, Series, histogram_figure,
    hysteresis_figure, loss_figure, node_figure, regression_figure, sample_figure, training_state_figure,
};
use eframe::egui::{Ui, UiBuilder};

use super::{
    inspect::{Along, bar_nodes_ui, section_bar_ui, section_of, take_pointed, with_lights},
    press::readings_ui,
    scrub::{self, scrub_bar_ui},
    view::TrainView,
};
use crate::window::{
    plotting::{Pointer, cells_ui, plots_ui},
    shared::{Command, Effect, Offers, Phase, Shared, SourceKind, target_choice_ui},
    test_view::Positions,
    theme::{Theme, space},
    widgets::{invitation_ui, tabs_ui},
};

/// Width of the list of nodes next to the histogram.
const LIST_WIDTH: f32 = space(57);

/// Width of a card below which the longest name of a tab is cut.
const NARROW: f32 = space(106);

/// The tabs with their names, shorter where the card is narrow.
fn tabs(shared: &Shared, is_narrow: bool, has_readings: bool) -> Vec<(BottomTab, &'static str)> {
    let short = |(tab, name)| match tab {
        BottomTab::TrainingState if is_narrow => (tab, "State"),
        _ => (tab, name),
    };
    let tabs = BottomTab::offered(shared, has_readings).into_iter();
    tabs.map(short).collect()
}

/// The charts below the surfaces, including the readings unless they have their own card.
pub fn charts_card_ui(
    ui: &mut Ui,
    view: &mut TrainView,
    shared: &Shared,
    has_readings: bool,
    effects: &mut Vec<Effect>,
) {
    let tabs = tabs(shared, ui.available_width() < NARROW, has_readings);
    if !tabs.iter().any(|(tab, _)| *tab == view.tab) {
        view.tab = BottomTab::default();
    }
    let chart = chart(view, shared);
    let before = (view.tab, view.has_error_bars, view.target);
    let has_choice = has_choice(view, shared);
    view.tab = tabs_ui(ui, "Charts", &tabs, view.tab).unwrap_or(view.tab);
    if has_choice {
        match shared.recorded_test() {
            None => error_bars_ui(ui, &mut view.has_error_bars),
            Some(test) => {
                let targets = &test.problem.targets;
                target_choice_ui(ui, "Target", "target of the charts", targets, &mut view.target);
            }
        }
    }
    if let (BottomTab::Section, Some(test)) = (view.tab, shared.test()) {
        section_bar_ui(ui, &mut view.section, test);
    }
    match &chart {
        Some(Chart::Plots(figure)) => plots_of_view_ui(ui, before.0, figure, view, shared),
        Some(Chart::Map(map)) => {
            let marked = (&[][..], &[][..], Theme::of(ui).palette.warning);
            if let Some(([row, column], response)) = cells_ui(ui, "Error over the position", map, marked) {
                response.on_hover_text_at_pointer(&map.notes[[row, column]]);
            }
        }
        None if view.tab == BottomTab::Readings => readings_of_view_ui(ui, view, shared),
        None => {
            let is_possible = !shared.phase.is_busy() && shared.phase != Phase::Died;
            let hint = hint_of_empty_chart(view.tab, shared.source);
            if invitation_ui(ui, hint, "Train now", is_possible) {
                effects.push(Effect::Train);
            }
        }
    }
    if (view.tab, view.has_error_bars, view.target) != before {
        ui.request_repaint();
    }
}

/// Returns true if the displayed chart offers a choice: error bars, or the target of a recording that has several.
fn has_choice(view: &TrainView, shared: &Shared) -> bool {
    let of_target = || {
        let test = shared.recorded_test();
        test.is_some_and(|test| test.set.outputs() > 1)
    };
    shared.result().is_some()
        && match view.tab {
            BottomTab::Nodes => true,
            BottomTab::ErrorHistogram | BottomTab::Regression | BottomTab::Hysteresis => of_target(),
            _ => false,
        }
}

/// The plots of the chart `tab`, what belongs below or next to them, and what the pointer does there.
fn plots_of_view_ui(ui: &mut Ui, tab: BottomTab, figure: &PlotFigure, view: &mut TrainView, shared: &Shared) {
    let past = shared.shown_run().map(|run| &run.past);
    let past = past.filter(|past| tab == BottomTab::Loss && past.epochs().len() > 1);
    let mut plots = ui.available_rect_before_wrap();
    if past.is_some() {
        plots.max.y -= scrub::HEIGHT;
    }
    let has_list = tab == BottomTab::ErrorHistogram && view.lights.bar.is_some();
    let list = plots.split_left_right_at_x(plots.right() - LIST_WIDTH).1;
    if has_list {
        plots.max.x = list.left() - space(3);
    }
    let lights = (view.lights.node, view.lights.bar);
    // Each tab is zoomed by itself.
    ui.scope_builder(UiBuilder::new().max_rect(plots), |ui| {
        let drawn = plots_ui(ui, tab.file_word(), figure, Pointer::Moves);
        take_pointed(view, tab, &drawn, shared);
    });
    if has_list {
        ui.scope_builder(UiBuilder::new().max_rect(list), |ui| bar_nodes_ui(ui, view, shared));
    }
    if (view.lights.node, view.lights.bar) != lights {
        ui.request_repaint();
    }
    if let Some(past) = past {
        scrub_bar_ui(ui, &mut view.scrub, past);
    }
}

/// Readings of the displayed surface. The one under the pointer lights up its nodes; a click cuts the surfaces along its
/// wires.
pub fn readings_of_view_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
    let row = view.lights.row.or(view.lights.node.map(|node| node / per_row));
    let pointed = readings_ui(ui, view.drops_percent(), shared.test(), row, shared.look.colours);
    let lit = pointed.as_ref().map(|pointed| pointed.cell[0]);
    if lit != view.lights.row {
        view.lights.row = lit;
        ui.request_repaint();
    }
    if let Some(pointed) = pointed.filter(|pointed| pointed.is_clicked) {
        view.section.choose_wires(pointed.cell[0], pointed.cell[1]);
        view.tab = BottomTab::Section;
        ui.request_repaint();
    }
}

impl TrainView {
    /// Offers each chart, and the steps through sections and bars.
    pub(super) fn offer_charts(&mut self, offers: &mut Offers<'_>, shared: &Shared) {
        // The readings have their own card if there is room.
        for (tab, name) in BottomTab::offered(shared, false) {
            if offers.offer(Command::Chart(name), tab != self.tab) {
                self.tab = tab;
            }
        }
        match (self.tab, shared.test()) {
            (BottomTab::Section, Some(test)) => {
                for (by, command) in [(-1, Command::PreviousSection), (1, Command::NextSection)] {
                    if offers.offer(command, self.section.can_step(by, test)) {
                        self.section.step(by, test);
                    }
                }
                let (command, other) = match self.section.along {
                    Along::RowWires => (Command::SectionAlongColumns, Along::ColumnWires),
                    Along::ColumnWires => (Command::SectionAlongRows, Along::RowWires),
                };
                if offers.offer(command, true) {
                    self.section.along = other;
                }
            }
            _ => {}
        }
    }
}

/// Shows the choice of error bars on the nodes.
fn error_bars_ui(ui: &mut Ui, has_bars: &mut bool) {
    let hint = "± the root mean square error of each node over all snapshots of the test set, in mm.";
    ui.checkbox(has_bars, "Error bars").on_hover_text(hint);
}

/// Returns the hint shown in an empty chart.
fn hint_of_empty_chart(tab: BottomTab, source: SourceKind) -> &'static str {
    match (tab, source) {
        (BottomTab::Loss, _) => "The error of each epoch appears here while the network trains.",
        (BottomTab::TrainingState, _) => {
            "The gradient and the method's own quantities appear here while the network trains."
        }
        (BottomTab::ErrorHistogram, SourceKind::Array) => {
            "The distribution of the z errors in the test set appears here."
        }
        (BottomTab::ErrorHistogram, SourceKind::Recording) => {
            "The distribution of the errors of each target in the test set appears here."
        }
        (BottomTab::Regression, SourceKind::Array) => {
            "Decoupled against actual z of every node in the test set appears here."
        }
        (BottomTab::Regression, SourceKind::Recording) => {
            "Decoded against actual values of each target in the test set appear here."
        }
        (BottomTab::Hysteresis, _) => {
            "Mean decoded against actual values appear here, loading and unloading apart, for a target that rises and \
             falls."
        }
        (BottomTab::Sample | BottomTab::ErrorMap | BottomTab::Nodes | BottomTab::Section | BottomTab::Readings, _) => {
            ""
        }
    }
}

/// A chart below the surfaces.
#[expect(clippy::large_enum_variant, reason = "only one is displayed")]
pub(super) enum Chart {
    Plots(PlotFigure),
    Map(HeatMap),
}

impl From<Chart> for Figure {
    fn from(chart: Chart) -> Self {
        match chart {
            Chart::Plots(plots) => plots.into(),
            Chart::Map(map) => map.into(),
        }
    }
}

/// Returns the displayed chart with the lit items highlighted; `None` before there is anything to draw.
pub(super) fn chart(view: &TrainView, shared: &Shared) -> Option<Chart> {
    if view.tab == BottomTab::ErrorMap {
        let charts = view.result(shared)?.charts.as_ref()?;
        let map = charts.error_map.as_ref().ok()?;
        return Some(Chart::Map(HeatMap::clone(map).coloured(shared.look.colours)));
    }
    Some(Chart::Plots(with_lights(figure(view, shared)?, view, shared)))
}

fn figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let trained = || shared.shown_run().zip(view.result(shared));
    Some(match view.tab {
        BottomTab::Loss => {
            let (run, result) = trained()?;
            let mut figure = loss_figure(run.outline.records(), &run.stages, result.best_epoch);
            if let (Some(epoch), Some(plot)) = (view.scrub.epoch(), figure.plots.first_mut()) {
                let at = LineAt::X(epoch as f64);
                let line = Series::across("displayed network", at, Ink::Orange, LineStyle::Solid);
                plot.series.push(line);
            }
            figure
        }
        BottomTab::TrainingState => {
            let (run, _) = trained()?;
            training_state_figure(run.outline.records(), &run.stages)
        }
        BottomTab::ErrorHistogram => {
            let of = match shared.recorded_test() {
                None => Decoded::Nodes,
                Some(test) => Decoded::Target(test.problem.targets.get(view.target_of(test))?),
            };
            histogram_figure(view.drawn.pairs()?, view.lights.bar, of)
        }
        BottomTab::Regression => {
            let pairs = view.drawn.pairs()?;
            let (line, of) = match shared.recorded_test() {
                None => (RegressionLine::of(pairs.iter().copied()), Decoded::Nodes),
                Some(test) => {
                    let target = view.target_of(test);
                    let line = view.result(shared)?.charts.as_ref()?.lines.get(target)?;
                    (*line, Decoded::Target(test.problem.targets.get(target)?))
                }
            };
            regression_figure((pairs.len(), &|pair| pairs[pair]), &line, of)
        }
        BottomTab::Hysteresis => {
            let test = shared.recorded_test()?;
            let target = view.target_of(test);
            let found = view.result(shared)?.charts.as_ref()?.loops.get(target)?;
            hysteresis_figure(found.as_ref()?, test.problem.targets.get(target)?)
        }
        BottomTab::Sample => all_targets_figure(view, shared)?,
        BottomTab::Nodes => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            let frames = view.frames();
            let decoupled_mm = frames.decoupled.as_ref().map(|(decoupled, _)| &*decoupled.nodes_mm);
            let bars_mm = view.error_bars_mm();
            node_figure(&frames.actual.nodes_mm, decoupled_mm, bars_mm, nodes_per_row)
        }
        BottomTab::Section => section_of(&view.section, shared.test()?, view.frames(), shared.look),
        BottomTab::ErrorMap | BottomTab::Readings => return None,
    })
}

/// Returns the chart of all displayed targets of the sample of a recording, actual and decoded.
pub(super) fn all_targets_figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let (test, result) = (shared.recorded_test()?, view.result(shared)?);
    if view.snapshot >= test.set.samples() {
        return None;
    }
    let actual = test.set.targets().row(view.snapshot).to_vec();
    let decoded = result.answers.row(view.snapshot).to_vec();
    Some(sample_figure(&test.problem.targets, &actual, &decoded, &test.ranges))
}

/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// Distribution of the errors of z, or of a target.
    ErrorHistogram,
    /// Decoupled against actual z, or decoded against actual values of a target.
    Regression,
    /// Mean decoded against actual values of a target of a recording, loading and unloading.
    Hysteresis,
    /// All targets of a sample of a recording, if surfaces are shown above.
    Sample,
    /// Error over the position, if targets of a recording are a position.
    ErrorMap,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
    /// A section through the surfaces of the snapshot.
    Section,
    /// Readings of the snapshot, if there is no room for their own card.
    Readings,
}

impl BottomTab {
    /// Returns the word for the chart in file names.
    pub(super) fn file_word(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::TrainingState => "training-state",
            Self::ErrorHistogram => "histogram",
            Self::Regression => "regression",
            Self::Hysteresis => "hysteresis",
            Self::Sample => "sample",
            Self::ErrorMap => "error-map",
            Self::Nodes => "nodes",
            Self::Section => "section",
            Self::Readings => "readings",
        }
    }

    const OF_ARRAY: [(Self, &'static str); 7] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Nodes, "Nodes"),
        (Self::Section, "Section"),
        (Self::Readings, "Readings"),
    ];

    const OF_RECORDING: [(Self, &'static str); 7] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Hysteresis, "Hysteresis"),
        (Self::Sample, "Sample"),
        (Self::ErrorMap, "Error map"),
    ];

    /// Returns the charts of the current source with their names, including the readings unless they have their own card.
    pub(super) fn offered(shared: &Shared, has_readings: bool) -> Vec<(Self, &'static str)> {
        let all = match shared.source {
            SourceKind::Array => &Self::OF_ARRAY[..],
            SourceKind::Recording => &Self::OF_RECORDING,
        };
        let is_offered = |tab: Self| match tab {
            Self::Readings => has_readings,
            // Without surfaces the sample takes their place.
            Self::Sample => has_target_surface(shared),
            Self::ErrorMap => has_error_map(shared),
            Self::Hysteresis => has_loop(shared),
            _ => true,
        };
        all.iter().copied().filter(|(tab, _)| is_offered(*tab)).collect()
    }
}

fn has_error_map(shared: &Shared) -> bool {
    let charts = shared.result().and_then(|result| result.charts.as_ref());
    charts.is_some_and(|charts| charts.error_map.is_ok())
}

/// Returns true if a target rises and falls in the test samples.
fn has_loop(shared: &Shared) -> bool {
    let charts = shared.result().and_then(|result| result.charts.as_ref());
    charts.is_some_and(|charts| charts.loops.iter().any(Option::is_some))
}

/// Returns true if a surface goes through the displayed targets of the recording.
pub(super) fn has_target_surface(shared: &Shared) -> bool {
    let test = shared.recorded_test();
    test.is_some_and(|test| matches!(test.positions, Positions::Surface(_)))
}
