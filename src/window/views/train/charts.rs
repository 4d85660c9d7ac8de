//! The charts below the surfaces. Each is a value: its name, its figure, and what the points of the figure are. The source
//! offers a list of them, and one card draws the chosen one.

use decoupler_files::figure::{
    Decoded, Figure, HeatMap, Ink, LineAt, LineStyle, Series, TimeSeries, histogram_figure, hysteresis_figure,
    loss_figure, node_figure, pair_address, pair_sample, regression_figure, training_state_figure, value_pairs,
};
use eframe::egui::{Rect, Ui, UiBuilder};

use super::{
    press::readings_ui,
    scrub::{self, scrub_bar_ui},
    section::{Along, section_bar_ui, section_of},
    surfaces::{surface_figure, surfaces_ui},
    view::TrainView,
};
use crate::window::{
    plotting::{MAX_TRACKS, SeriesView, cells_ui, plots_ui},
    shared::{Command, Effect, Offers, RunResult, RunView, Shared, SourceKind, target_choice_ui},
    test_view::TestView,
    theme::{Theme, space},
    widgets::{card_ui, dim_ui, fields::combo_ui, placeholder_ui, tabs_ui},
};

/// A chart of the displayed result.
#[derive(Debug)]
pub(super) struct Chart {
    /// Name of its tab.
    pub name: &'static str,
    /// What appears in it once a network is trained.
    hint: &'static str,
    /// True if it is one of the list next to the tabs.
    is_rare: bool,
    /// Returns false while it has nothing to do with what is displayed.
    is_offered: fn(&Shared) -> bool,
    /// Returns its figure, once there is something to draw.
    draw: fn(&TrainView, &Shared) -> Option<Figure>,
    items: Items,
    /// Shows what can be chosen in it.
    bar_ui: fn(&mut Ui, &mut TrainView, &Shared),
    /// Shows its figure in a way of its own.
    own_ui: Option<fn(&mut Ui, &mut TrainView, &Shared)>,
}

/// What the points of a chart are, which respond to the pointer.
#[derive(Clone, Copy, Debug)]
enum Items {
    /// They do not respond.
    None,
    /// Nodes, or targets of a recording: the one under the pointer lights up.
    Nodes,
    /// Values of the test set: a click goes to the snapshot and the node of one.
    Values,
}

const BARE: Chart = Chart {
    name: "",
    hint: "",
    is_rare: false,
    is_offered: |_| true,
    draw: |_, _| None,
    items: Items::None,
    bar_ui: |_, _, _| (),
    own_ui: None,
};

const LOSS: Chart = Chart {
    name: "Loss",
    hint: "The error of each epoch appears here while the network trains.",
    draw: |view, shared| {
        let (run, result) = trained(view, shared)?;
        let mut figure = loss_figure(run.outline.records(), &run.stages, result.best_epoch);
        if let (Some(epoch), Some(plot)) = (view.scrub.epoch(), figure.plots.first_mut()) {
            let at = LineAt::X(epoch as f64);
            let line = Series::across("displayed network", at, Ink::Violet, LineStyle::Solid);
            plot.series.push(line);
        }
        Some(figure.into())
    },
    ..BARE
};

const TRAINING_STATE: Chart = Chart {
    name: "Training state",
    hint: "The gradient and the method's own quantities appear here while the network trains.",
    is_rare: true,
    draw: |view, shared| {
        let (run, _) = trained(view, shared)?;
        Some(training_state_figure(run.outline.records(), &run.stages).into())
    },
    ..BARE
};

const HISTOGRAM: Chart = Chart {
    name: "Histogram",
    hint: "The distribution of the z errors in the test set appears here.",
    is_rare: true,
    draw: |view, shared| {
        let (pairs, of) = pairs(view, shared)?;
        Some(histogram_figure(&pairs, of).into())
    },
    bar_ui: |ui, view, shared| target_bar_ui(ui, view, shared, "target of the errors"),
    ..BARE
};

const REGRESSION: Chart = Chart {
    name: "Regression",
    hint: "Decoded against actual z of every node in the test set appears here.",
    draw: |view, shared| {
        let (pairs, of) = pairs(view, shared)?;
        let line = view.target_of(shared.test()?).unwrap_or(0);
        let line = view.result(shared)?.charts.lines.get(line)?;
        let figure = regression_figure((pairs.len(), &|pair| pairs[pair]), line, of);
        Some(figure.lighting(|_| false, lit_value(view, shared).as_slice()).into())
    },
    items: Items::Values,
    bar_ui: |ui, view, shared| target_bar_ui(ui, view, shared, "target of the answers"),
    ..BARE
};

const HYSTERESIS: Chart = Chart {
    name: "Hysteresis",
    hint: "Mean decoded against actual values appear here, loading and unloading apart, for a target that rises and falls.",
    is_offered: |shared| {
        let result = shared.result();
        result.is_some_and(|result| result.charts.loops.iter().any(Option::is_some))
    },
    draw: |view, shared| {
        let test = shared.test()?;
        let target = view.target_of(test)?;
        let found = view.result(shared)?.charts.loops.get(target)?.as_ref()?;
        Some(hysteresis_figure(found, test.problem.targets.get(target)?).into())
    },
    bar_ui: |ui, view, shared| target_bar_ui(ui, view, shared, "target of the answers"),
    ..BARE
};

/// Actual and decoded values of each target of a recording over time.
pub(super) const SERIES: Chart = Chart {
    name: "Over time",
    hint: "Actual and decoded values of each target in the test set appear here, over time.",
    draw: |view, shared| {
        let series = series(shared.test()?, view.result(shared)?);
        Some(view.series.figure(&series, MAX_TRACKS, Some(view.snapshot)).into())
    },
    own_ui: Some(series_ui),
    ..BARE
};

/// Surfaces through the targets of a recording; always there for an array.
pub(super) const SURFACES: Chart = Chart {
    name: "Surfaces",
    is_offered: |shared| shared.test().is_some_and(|test| test.through().is_some()),
    draw: |view, shared| Some(surface_figure(view, shared).into()),
    ..BARE
};

const ERROR_MAP: Chart = Chart {
    name: "Error map",
    is_offered: |shared| shared.result().is_some_and(|result| result.charts.error_map.is_some()),
    draw: |view, shared| {
        let map = view.result(shared)?.charts.error_map.as_ref()?;
        Some(HeatMap::clone(map).coloured(shared.look.colours).into())
    },
    ..BARE
};

/// The paper's Fig. 6.
pub(super) const NODES: Chart = Chart {
    name: "Nodes",
    is_rare: true,
    draw: |view, shared| {
        let nodes_per_row = shared.skin()?.sensor.scale.nodes_per_row();
        let drawing = view.drawing()?;
        let decoded_mm = drawing.decoded.as_ref().map(|[decoded, _]| &*decoded.nodes);
        let bars_mm = view.result(shared).filter(|_| view.has_error_bars);
        let bars_mm = bars_mm.map(|result| &*result.charts.spread_mm);
        Some(node_figure(&drawing.actual.nodes, decoded_mm, bars_mm, nodes_per_row).into())
    },
    items: Items::Nodes,
    bar_ui: |ui, view, shared| {
        if shared.result().is_some() {
            let hint = "± the root mean square error of each node over all snapshots of the test set, in mm.";
            ui.checkbox(&mut view.has_error_bars, "Error bars").on_hover_text(hint);
        }
    },
    ..BARE
};

pub(super) const SECTION: Chart = Chart {
    name: "Section",
    draw: |view, shared| Some(section_of(&view.section, shared.skin()?, view.drawing()?, shared.look).into()),
    items: Items::Nodes,
    bar_ui: |ui, view, shared| {
        if let Some(skin) = shared.skin() {
            section_bar_ui(ui, &mut view.section, skin);
        }
    },
    ..BARE
};

/// The readings, if there is no room for their own card.
const READINGS: Chart = Chart {
    name: "Readings",
    own_ui: Some(readings_of_view_ui),
    ..BARE
};

/// Charts below the surfaces of an array.
const OF_ARRAY: [Chart; 7] = [LOSS, TRAINING_STATE, HISTOGRAM, REGRESSION, NODES, SECTION, READINGS];

/// Charts of the answers for a recording, and of its training below.
const OF_ANSWERS: [Chart; 5] = [
    SERIES,
    SURFACES,
    Chart {
        hint: "Decoded against actual values of each target in the test set appear here.",
        ..REGRESSION
    },
    HYSTERESIS,
    ERROR_MAP,
];
const OF_TRAINING: [Chart; 3] = [
    LOSS,
    TRAINING_STATE,
    Chart {
        hint: "The distribution of the errors of each target in the test set appears here.",
        ..HISTOGRAM
    },
];

/// Returns the charts of the current source below the surfaces, including the readings unless they have their own card.
fn charts(shared: &Shared, has_readings: bool) -> impl Iterator<Item = &'static Chart> {
    let all: &'static [Chart] = match shared.source {
        SourceKind::Array => &OF_ARRAY,
        SourceKind::Recording => &OF_TRAINING,
    };
    all.iter()
        .filter(move |chart| chart.name != READINGS.name || has_readings)
}

/// Returns the charts of the answers for a recording, in the card above.
fn upper_charts(shared: &Shared) -> impl Iterator<Item = &'static Chart> {
    OF_ANSWERS.iter().filter(|chart| (chart.is_offered)(shared))
}

/// Returns the displayed chart of the answers for a recording.
pub(super) fn upper_chart(view: &TrainView, shared: &Shared) -> &'static Chart {
    upper_charts(shared)
        .find(|chart| chart.name == view.upper)
        .unwrap_or(&SERIES)
}

/// Returns the displayed chart below.
pub(super) fn lower_chart(view: &TrainView, shared: &Shared) -> &'static Chart {
    charts(shared, true)
        .find(|chart| chart.name == view.tab)
        .unwrap_or(&LOSS)
}

/// Returns the values of the test samples of a recording over time.
fn series<'a>(test: &'a TestView, result: &'a RunResult) -> TimeSeries<'a> {
    TimeSeries {
        targets: &test.problem.targets,
        axis: test.timeline.axis.clone(),
        places: &test.timeline.places,
        gaps: &test.timeline.gaps,
        decoded: result.answers.view(),
        actual: Some(test.set.targets()),
        intervals: result.intervals.as_ref(),
    }
}

/// The answers for a recording: its charts in one card, or surfaces below the choice of the chart.
pub(super) fn answers_ui(ui: &mut Ui, rect: Rect, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let chart = upper_chart(view, shared);
    let tabs = Vec::from_iter(upper_charts(shared).map(|chart| (chart.name, chart.name)));
    let show = |ui: &mut Ui, view: &mut TrainView| {
        view.upper = tabs_ui(ui, "Answers", &tabs, chart.name).unwrap_or(chart.name);
    };
    if chart.name == SURFACES.name {
        let (head, cards) = rect.split_top_bottom_at_y(rect.top() + space(12));
        card_ui(ui, head, |ui| show(ui, view));
        return surfaces_ui(ui, cards.with_min_y(cards.top() + space(2)), view, shared, effects);
    }
    card_ui(ui, rect, |ui| {
        show(ui, view);
        if let Some(Err(reason)) = shared.test().and_then(|test| test.through.as_ref()) {
            dim_ui(
                ui,
                &format!("No surface goes through the positions of the targets: {reason}."),
            );
        }
        chart.show(ui, view, shared);
    });
}

/// The values over time; a click goes to a sample.
fn series_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let targets = shared.test().map_or(0, |test| test.problem.targets.len());
    if targets > SeriesView::tracks(ui) {
        target_bar_ui(ui, view, shared, "first target");
        view.series.first = view.target;
    }
    let (Some(test), Some(result)) = (shared.test(), view.scrub.shown(shared)) else {
        return placeholder_ui(ui, SERIES.hint);
    };
    let (series, name) = (series(test, result), |sample| test.timeline.name(sample));
    let clicked = view.series.show(ui, "series", &series, Some(view.snapshot), name);
    view.snapshot = clicked.unwrap_or(view.snapshot);
}

impl Chart {
    /// Shows it in the remaining space.
    fn show(&self, ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
        (self.bar_ui)(ui, view, shared);
        if let Some(own_ui) = self.own_ui {
            own_ui(ui, view, shared);
        } else if let Some(figure) = self.figure(view, shared) {
            self.figure_ui(ui, &figure, view, shared);
        } else {
            placeholder_ui(ui, self.hint);
        }
    }

    /// Returns its figure with the lit items highlighted.
    pub(super) fn figure(&self, view: &TrainView, shared: &Shared) -> Option<Figure> {
        let figure = (self.draw)(view, shared)?;
        Some(match (self.items, figure) {
            (Items::Nodes, Figure::Plots(plots)) => {
                let lit = lit_nodes(view, shared);
                let is_lit = |item| Some(item) == view.lights.node || lit.contains(&item);
                plots.lighting(is_lit, &[]).into()
            }
            (_, figure) => figure,
        })
    }

    /// Shows its figure in the remaining space. Lights up the item under the pointer, and handles a click there.
    fn figure_ui(&self, ui: &mut Ui, figure: &Figure, view: &mut TrainView, shared: &Shared) {
        let plots = match figure {
            Figure::Plots(plots) => plots,
            Figure::HeatMap(map) => {
                let marked = (&[][..], &[][..], Theme::of(ui).palette.warning);
                if let Some((cell, response)) = cells_ui(ui, "Error over the position", map, marked) {
                    response.on_hover_text_at_pointer(&map.notes[cell]);
                }
                return;
            }
            Figure::Surfaces(_) => return,
        };
        // Each chart is zoomed by itself.
        let drawn = plots_ui(ui, self.name, plots);
        let Some(plot) = drawn.iter().find(|plot| plot.has_pointer) else {
            return;
        };
        let place = |item: Option<usize>| place_of_value(view, shared, item?);
        match self.items {
            Items::None => {}
            Items::Nodes => view.lights.node = plot.hovered,
            Items::Values => {
                // The values are those of the test set, not of a pressed surface.
                let here = place(plot.hovered).filter(|(snapshot, _)| *snapshot == view.snapshot);
                let (here, clicked) = (here.filter(|_| !view.press.is_pressing()), place(plot.clicked));
                view.lights.node = here.and_then(|(_, node)| node);
                if let Some((snapshot, node)) = clicked {
                    view.go_to(snapshot, node);
                }
            }
        }
    }
}

fn trained<'a>(view: &'a TrainView, shared: &'a Shared) -> Option<(&'a RunView, &'a RunResult)> {
    shared.shown_run().zip(view.result(shared))
}

/// Returns actual and decoded values of the test set, and what they are: z of the nodes, or those of the displayed target.
fn pairs<'a>(view: &TrainView, shared: &'a Shared) -> Option<(Vec<(f64, f64)>, Decoded<'a>)> {
    let (test, result) = (shared.test()?, view.result(shared)?);
    let target = view.target_of(test);
    let of = match target {
        None => Decoded::Nodes,
        Some(target) => Decoded::Target(test.problem.targets.get(target)?),
    };
    Some((value_pairs(&test.set, &result.answers, target), of))
}

/// Returns the snapshot and the node of one of the values of the test set; for a recording the sample and the target.
fn place_of_value(view: &TrainView, shared: &Shared, value: usize) -> Option<(usize, Option<usize>)> {
    let test = shared.test()?;
    if let Some(skin) = &test.skin {
        let address = pair_address(&test.set, value)?;
        return Some((address.snapshot, skin.node(address)));
    }
    Some((pair_sample(&test.set, value)?, view.target_of(test)))
}

/// Returns the actual and decoded value that are highlighted among those of the test set: those of the lit node, or for a
/// recording those of the displayed target and sample.
fn lit_value(view: &TrainView, shared: &Shared) -> Option<[f64; 2]> {
    let test = shared.test()?;
    if let Some(target) = view.target_of(test) {
        let at = [view.snapshot, target];
        let answers = &view.result(shared)?.answers;
        return Some([*test.set.targets().get(at)?, *answers.get(at)?]);
    }
    let (drawing, node) = (view.drawing()?, view.lights.node?);
    let [decoded, _] = drawing.decoded.as_ref()?;
    Some([drawing.actual.nodes.get(node)?.z, decoded.nodes.get(node)?.z])
}

/// Returns the nodes of the row-wire that is pointed at, which are lit together.
pub(super) fn lit_nodes(view: &TrainView, shared: &Shared) -> Vec<usize> {
    let per_row = shared.skin().map_or(0, |skin| skin.sensor.scale.nodes_per_row());
    let row = view.lights.row.into_iter();
    row.flat_map(|row| row * per_row..(row + 1) * per_row).collect()
}

/// The choice of the target, where there are several.
fn target_bar_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, id: &str) {
    if let Some(test) = shared
        .test()
        .filter(|test| test.skin.is_none() && shared.result().is_some())
    {
        let targets = &test.problem.targets;
        target_choice_ui(ui, "Target", id, targets, &mut view.target);
    }
}

/// The charts below the surfaces, including the readings unless they have their own card, and the bar that goes through
/// past epochs.
pub fn charts_card_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, has_readings: bool) {
    let offered = Vec::from_iter(charts(shared, has_readings));
    let chart = offered.iter().find(|chart| chart.name == view.tab);
    let chart = *chart.unwrap_or(&&LOSS);
    let (rare, usual): (Vec<&Chart>, Vec<&Chart>) = offered.iter().copied().partition(|chart| chart.is_rare);
    let tabs = Vec::from_iter(usual.iter().map(|chart| (chart.name, chart.name)));
    let listed = Vec::from_iter(rare.iter().map(|chart| (chart.name, chart.name, "")));
    ui.horizontal_wrapped(|ui| {
        let mut picked = tabs_ui(ui, "Charts", &tabs, chart.name);
        let list = combo_ui(ui, "More charts", space(24), &listed, chart.name, &mut picked);
        ui.ctx()
            .accesskit_node_builder(list.id, |node| node.set_label("More charts"));
        view.tab = picked.unwrap_or(chart.name);
    });
    let past = shared.shown_run().map(|run| &run.past);
    let past = past.filter(|past| past.epochs().len() > 1);
    let mut place = ui.available_rect_before_wrap();
    if past.is_some() {
        place.max.y -= scrub::HEIGHT;
    }
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        chart.show(ui, view, shared);
    });
    if let Some(past) = past {
        scrub_bar_ui(ui, &mut view.scrub, past);
    }
}

/// Readings of the displayed surface. The one under the pointer lights up its nodes; a click cuts the surfaces along its
/// wires.
pub fn readings_of_view_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let per_row = shared.skin().map_or(1, |skin| skin.sensor.scale.nodes_per_row());
    let row = view.lights.row.or(view.lights.node.map(|node| node / per_row));
    let pointed = readings_ui(
        ui,
        view.drops_percent(),
        shared.skin().map(|skin| &**skin),
        row,
        shared.look.colours,
    );
    view.lights.row = pointed.as_ref().map(|pointed| pointed.cell[0]);
    if let Some(pointed) = pointed.filter(|pointed| pointed.is_clicked) {
        view.section.choose(pointed.cell);
        view.tab = SECTION.name;
    }
}

impl TrainView {
    /// Offers each chart, and the steps through sections.
    pub(super) fn offer_charts(&mut self, offers: &mut Offers<'_>, shared: &Shared) {
        const SHOWN: &str = "It is the displayed chart.";
        // The readings have their own card if there is room.
        let has_readings = !shared.has_report(offers.ctx.content_rect().width());
        for chart in charts(shared, has_readings) {
            if offers.offer_unless(Command::Chart(chart.name), (chart.name == self.tab).then_some(SHOWN)) {
                self.tab = chart.name;
            }
        }
        let is_recording = shared.source == SourceKind::Recording;
        for chart in upper_charts(shared).filter(|_| is_recording) {
            if offers.offer_unless(Command::Chart(chart.name), (chart.name == self.upper).then_some(SHOWN)) {
                self.upper = chart.name;
            }
        }
        let Some(skin) = shared.skin().filter(|_| self.tab == SECTION.name) else {
            return;
        };
        for (by, command) in [(-1, Command::PreviousSection), (1, Command::NextSection)] {
            let stepped = self.section.stepped(by, skin);
            if offers.offer_unless(command, stepped.is_none().then_some("There is none in this direction.")) {
                self.section = stepped.unwrap_or(self.section);
            }
        }
        if offers.offer(Command::TurnSection) {
            self.section.along = match self.section.along {
                Along::RowWires => Along::ColumnWires,
                Along::ColumnWires => Along::RowWires,
            };
        }
    }
}
