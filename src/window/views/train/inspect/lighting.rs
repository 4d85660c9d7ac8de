use super::place::{TestPlace, node_of_target, target_of_node};
use crate::window::{
    plotting::DrawnPlot,
    shared::Shared,
    views::train::{bottom_tab::BottomTab, state::TrainView},
};
use decoupler_files::figure::{
    ErrorBins, Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, pair_address, pair_sample,
};

/// Returns the displayed nodes of the snapshot that are lit together: those of the row-wire that is pointed at, and those
/// whose errors the chosen bar holds.
pub fn lit_nodes(view: &TrainView, shared: &Shared) -> Vec<usize> {
    let per_row = shared.test().map_or(0, |test| test.sensor.scale.nodes_per_row());
    let of_row = view
        .lights
        .row
        .into_iter()
        .flat_map(|row| row * per_row..(row + 1) * per_row);
    let mut nodes: Vec<usize> = of_row.collect();
    // The bars are those of the test set, not of what is pressed.
    if view.tab == BottomTab::ErrorHistogram && !view.press.is_pressing() {
        let of_bar = places_in_bar(view, shared).into_iter().map(|(place, _)| place);
        let of_bar = of_bar.filter(|place| place.snapshot == view.snapshot);
        nodes.extend(of_bar.filter_map(|place| place.node));
    }
    nodes
}

/// Returns the values of the test set whose errors the chosen bar holds, with these errors (in millimetres, or in the unit
/// of the target); the largest come first.
pub(super) fn places_in_bar(view: &TrainView, shared: &Shared) -> Vec<(TestPlace, f64)> {
    let Some((bar, pairs)) = view.lights.bar.zip(view.drawn.pairs()) else {
        return Vec::new();
    };
    let in_bar = ErrorBins::new(pairs).pairs_in(bar, pairs).into_iter();
    let placed = in_bar.filter_map(|pair| {
        let (actual, decoded) = pairs[pair];
        Some((place_of_pair(view, shared, pair)?, decoded - actual))
    });
    placed.collect()
}

/// Place of one of the pairs of actual and decoded values.
fn place_of_pair(view: &TrainView, shared: &Shared, pair: usize) -> Option<TestPlace> {
    match (shared.test(), shared.recorded_test()) {
        (Some(test), _) => Some(TestPlace::of_node(pair_address(&test.set, pair)?, test)),
        (None, test) => {
            let test = test?;
            Some(TestPlace {
                snapshot: pair_sample(&test.set, pair)?,
                node: node_of_target(test, view.target_of(test)),
            })
        }
    }
}

/// Actual and decoded value that stand out among those of the test set: of the node that is lit, or of the target and the
/// sample displayed of a recording.
fn lit_pair(view: &TrainView, shared: &Shared) -> Option<(f64, f64)> {
    if let Some(test) = shared.recorded_test() {
        let at = [view.snapshot, view.target_of(test)];
        let answers = &view.result(shared)?.answers;
        return Some((*test.set.targets().get(at)?, *answers.get(at)?));
    }
    let (frames, node) = (view.frames(), view.lights.node?);
    let (decoupled, _) = frames.decoupled.as_ref()?;
    Some((frames.actual.nodes_mm.get(node)?.z, decoupled.nodes_mm.get(node)?.z))
}

/// Returns the chart with what is lit standing out.
pub fn with_lights(mut figure: PlotFigure, view: &TrainView, shared: &Shared) -> PlotFigure {
    match view.tab {
        BottomTab::Nodes | BottomTab::Section => {
            let (node, lit) = (view.lights.node, lit_nodes(view, shared));
            figure.lighting(|item| Some(item) == node || lit.contains(&item), &[])
        }
        BottomTab::Sample => with_lit_targets(figure, view, shared),
        BottomTab::Regression => {
            let place = lit_pair(view, shared).map(|(actual, decoded)| [actual, decoded]);
            figure.lighting(|_| false, place.as_slice())
        }
        BottomTab::ErrorHistogram => {
            if let (Some((actual, decoded)), Some(plot)) = (lit_pair(view, shared), figure.plots.first_mut()) {
                let name = if shared.recorded_test().is_some() {
                    "displayed sample"
                } else {
                    "node under the pointer"
                };
                let line = ReferenceLine::new(name, LineAt::X(decoded - actual), Hue::Orange, LineStyle::Solid);
                plot.lines.push(line);
            }
            figure
        }
        BottomTab::Loss | BottomTab::TrainingState | BottomTab::ErrorMap | BottomTab::Readings => figure,
    }
}

/// Returns the chart of all targets of a sample with the one under the pointer standing out.
pub fn with_lit_targets(figure: PlotFigure, view: &TrainView, shared: &Shared) -> PlotFigure {
    let target = shared
        .recorded_test()
        .zip(view.lights.node)
        .and_then(|(test, node)| target_of_node(test, node));
    figure.lighting(|item| Some(item) == target, &[])
}

/// Lights up the target under the pointer in a chart of all targets of a sample.
pub fn take_pointed_target(view: &mut TrainView, plots: &[DrawnPlot<'_>], shared: &Shared) {
    if let (Some(plot), Some(test)) = (plots.iter().find(|plot| plot.has_pointer), shared.recorded_test()) {
        view.lights.node = plot.hovered.and_then(|target| node_of_target(test, target));
    }
}

/// Lights up what the pointer is on in a chart, and does what a click there means.
pub fn take_pointed(view: &mut TrainView, tab: BottomTab, plots: &[DrawnPlot<'_>], shared: &Shared) {
    let Some(plot) = plots.iter().find(|plot| plot.has_pointer) else {
        return;
    };
    match tab {
        BottomTab::Nodes | BottomTab::Section => view.lights.node = plot.hovered,
        BottomTab::Sample => take_pointed_target(view, plots, shared),
        BottomTab::Regression => {
            let place = |view: &TrainView, item: Option<usize>| place_of_pair(view, shared, item?);
            let here = place(view, plot.hovered).filter(|place| place.snapshot == view.snapshot);
            let is_of_test_set = !view.press.is_pressing();
            view.lights.node = here.filter(|_| is_of_test_set).and_then(|place| place.node);
            if let Some(place) = place(view, plot.clicked) {
                view.go_to(place);
            }
        }
        BottomTab::ErrorHistogram => {
            if plot.clicked.is_some() {
                // Another click takes it back.
                view.lights.bar = plot.clicked.filter(|_| plot.clicked != view.lights.bar);
            }
        }
        BottomTab::Loss | BottomTab::TrainingState | BottomTab::ErrorMap | BottomTab::Readings => {}
    }
}
