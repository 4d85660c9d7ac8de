use crate::{
    app::{
        plotting::DrawnPlot,
        shared::Shared,
        test_view::TestView,
        views::train::{bottom_tab::BottomTab, state::TrainView},
    },
    evaluation::NodeAddress,
    figure::{ErrorBins, Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, pair_address},
};

/// Returns the nodes of the snapshot on show that are lit together: those of the row-wire that is pointed at, and those
/// whose errors the chosen bar holds.
pub fn lit_nodes(view: &TrainView, shared: &Shared) -> Vec<usize> {
    let Some(test) = shared.test() else { return Vec::new() };
    let per_row = test.sensor.scale.nodes_per_row();
    let of_row = view
        .lights
        .row
        .into_iter()
        .flat_map(|row| row * per_row..(row + 1) * per_row);
    let mut nodes: Vec<usize> = of_row.collect();
    // The bars are those of the test set, not of what is pressed.
    if view.tab == BottomTab::ErrorHistogram && !view.press.is_pressing() {
        let of_bar = addresses_in_bar(view, test).into_iter().map(|(address, _)| address);
        let of_bar = of_bar.filter(|address| address.snapshot == view.snapshot);
        nodes.extend(of_bar.filter_map(|address| test.node(address)));
    }
    nodes
}

/// Returns the nodes of the test set whose errors the chosen bar holds, with these errors in millimetres; the largest come
/// first.
pub(super) fn addresses_in_bar(view: &TrainView, test: &TestView) -> Vec<(NodeAddress, f64)> {
    let Some((bar, pairs_mm)) = view.lights.bar.zip(view.drawn.pairs_mm()) else {
        return Vec::new();
    };
    let pairs = ErrorBins::new(pairs_mm).pairs_in(bar, pairs_mm).into_iter();
    let addressed = pairs.filter_map(|pair| {
        let (actual, decoupled) = pairs_mm[pair];
        Some((pair_address(&test.set, pair)?, decoupled - actual))
    });
    addressed.collect()
}

/// Returns the chart with what is lit standing out.
pub fn with_lights(mut figure: PlotFigure, view: &TrainView, shared: &Shared) -> PlotFigure {
    let frames = view.frames();
    let node = view.lights.node;
    let actual = node.and_then(|node| frames.actual.nodes_mm.get(node));
    let decoupled = frames.decoupled.as_ref().map(|(decoupled, _)| &decoupled.nodes_mm);
    let pair_mm = actual.zip(node.and_then(|node| decoupled?.get(node)));
    match view.tab {
        BottomTab::Nodes | BottomTab::Section => {
            let lit = lit_nodes(view, shared);
            figure.lighting(|item| Some(item) == node || lit.contains(&item), &[])
        }
        BottomTab::Regression => {
            let place = pair_mm.map(|(actual, decoupled)| [actual.z, decoupled.z]);
            figure.lighting(|_| false, place.as_slice())
        }
        BottomTab::ErrorHistogram => {
            if let (Some((actual, decoupled)), Some(plot)) = (pair_mm, figure.plots.first_mut()) {
                let at = LineAt::X(decoupled.z - actual.z);
                let line = ReferenceLine::new("node under the pointer", at, Hue::Orange, LineStyle::Solid);
                plot.lines.push(line);
            }
            figure
        }
        BottomTab::Loss | BottomTab::TrainingState | BottomTab::Readings => figure,
    }
}

/// Lights up what the pointer is on in a chart, and does what a click there means.
pub fn take_pointed(view: &mut TrainView, tab: BottomTab, plots: &[DrawnPlot<'_>], shared: &Shared) {
    let Some(plot) = plots.iter().find(|plot| plot.has_pointer) else {
        return;
    };
    let address = |item: Option<usize>| pair_address(&shared.test()?.set, item?);
    match tab {
        BottomTab::Nodes | BottomTab::Section => view.lights.node = plot.hovered,
        BottomTab::Regression => {
            let here = address(plot.hovered).filter(|address| address.snapshot == view.snapshot);
            let is_of_test_set = !view.press.is_pressing();
            let node = here
                .filter(|_| is_of_test_set)
                .and_then(|address| shared.test()?.node(address));
            view.lights.node = node;
            if let Some(address) = address(plot.clicked) {
                view.go_to(address, shared);
            }
        }
        BottomTab::ErrorHistogram => {
            if plot.clicked.is_some() {
                // Another click takes it back.
                view.lights.bar = plot.clicked.filter(|_| plot.clicked != view.lights.bar);
            }
        }
        BottomTab::Loss | BottomTab::TrainingState | BottomTab::Readings => {}
    }
}
