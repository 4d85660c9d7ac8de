//! Inspecting errors: items lit by the pointer, the section through the surfaces, and the nodes in a bar of the histogram.

use decoupler_core::{evaluation::NodeAddress, text::counted};
use decoupler_files::{
    export::format_number,
    figure::{
        ErrorBins, Ink, LineAt, LineStyle, PlotFigure, Series, pair_address, pair_sample, section_figure,
        surface::{Section, SectionLine},
    },
};
use eframe::egui::{Align, Button, Layout, Response, RichText, Ui, Vec2, WidgetInfo, accesskit::Role};
use glam::DVec2;

use crate::window::{
    plotting::DrawnPlot,
    shared::{Look, Shared},
    test_view::{Positions, RecordedTest, TestView},
    theme::{Theme, semibold, space, type_size},
    views::train::{charts_card::BottomTab, drawn::Frames, view::TrainView},
    widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, explained_options_ui},
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
    // The bars are those of the test set, not of a pressed surface.
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

/// Returns the place of one of the pairs of actual and decoded values.
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

/// Returns the actual and decoded value that are highlighted among those of the test set: those of the lit node, or for a
/// recording those of the displayed target and sample.
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

/// Returns the chart with the lit items highlighted.
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
                let line = Series::across(name, LineAt::X(decoded - actual), Ink::Orange, LineStyle::Solid);
                plot.series.push(line);
            }
            figure
        }
        BottomTab::Loss
        | BottomTab::TrainingState
        | BottomTab::Hysteresis
        | BottomTab::ErrorMap
        | BottomTab::Readings => figure,
    }
}

/// Returns the chart of all targets of a sample with the one under the pointer highlighted.
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

/// Lights up the item under the pointer in a chart, and handles a click there.
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
                // Another click clears the choice.
                view.lights.bar = plot.clicked.filter(|_| plot.clicked != view.lights.bar);
            }
        }
        BottomTab::Loss
        | BottomTab::TrainingState
        | BottomTab::Hysteresis
        | BottomTab::ErrorMap
        | BottomTab::Readings => {}
    }
}

/// The item under the pointer in one of the pictures, which lights up in all of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lighting {
    /// A node, by its number among those drawn; for a recording the target there.
    pub node: Option<usize>,
    /// A row-wire, by its place among those read: a reading is that of all its nodes.
    pub row: Option<usize>,
    /// The chosen bar of the histogram.
    pub bar: Option<usize>,
}

/// Place of a value of the test set: its snapshot, and its node among those drawn. For a recording the snapshot is a sample,
/// and a node a target: by its number on the surface through the targets, or by its own where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestPlace {
    /// From 0.
    pub snapshot: usize,
    /// `None` for what is not drawn.
    pub node: Option<usize>,
}

impl TestPlace {
    /// Place of a node of an array.
    pub fn of_node(address: NodeAddress, test: &TestView) -> Self {
        Self {
            snapshot: address.snapshot,
            node: test.node(address),
        }
    }
}

/// Returns the number of a target among the nodes drawn.
pub fn node_of_target(test: &RecordedTest, target: usize) -> Option<usize> {
    match &test.positions {
        Positions::Surface(through) => through.nodes().iter().position(|node| node.target == target),
        _ => Some(target),
    }
}

/// Returns the target of a node drawn.
pub fn target_of_node(test: &RecordedTest, node: usize) -> Option<usize> {
    match &test.positions {
        Positions::Surface(through) => Some(through.nodes().get(node)?.target),
        _ => Some(node),
    }
}

/// Returns the number of nodes that the pointer can light up.
pub fn drawn_nodes(shared: &Shared, of_frame: usize) -> usize {
    match shared.recorded_test() {
        Some(test) if !matches!(test.positions, Positions::Surface(_)) => test.set.outputs(),
        _ => of_frame,
    }
}

const fn figure<'a>(heading: &'a str, widest: &'a str) -> TableColumn<'a> {
    TableColumn::figure(heading).width(ColumnWidth::Fits(widest))
}

/// The values of the test set whose errors the chosen bar of the histogram holds: nodes, or samples of a recording. The one
/// under the pointer lights up; a click goes to its snapshot.
pub fn bar_nodes_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let Some(bar) = view.lights.bar else { return };
    let Some(bins) = view.drawn.pairs().map(ErrorBins::new) else {
        return;
    };
    let places = places_in_bar(view, shared);
    let channel = shared
        .recorded_test()
        .and_then(|test| test.problem.targets.get(view.target_of(test)));
    let unit = match channel {
        None => Some("mm"),
        Some(channel) => channel.unit.as_deref(),
    };
    let with_unit = |text: &str| unit.map_or_else(|| text.to_owned(), |unit| format!("{text} {unit}"));
    let [low, high] = bins.range(bar).map(|end| format_number(end).replace('-', "−"));
    let last = ErrorBins::COUNT - 1;
    ui.horizontal(|ui| {
        let what = if channel.is_some() { "sample" } else { "node" };
        ui.label(RichText::new(counted(places.len(), what)).font(semibold(type_size().note)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if step_ui(ui, "›", "Next bar", "Goes to the bar on the right (]).", bar < last) {
                view.lights.bar = Some(bar + 1);
            }
            if step_ui(ui, "‹", "Previous bar", "Goes to the bar on the left ([).", bar > 0) {
                view.lights.bar = Some(bar - 1);
            }
        });
    });
    dim_ui(ui, &with_unit(&format!("{low} to {high}")));
    let palette = Theme::of(ui).palette;
    let numbers = |place: TestPlace| -> Vec<usize> {
        match (shared.test(), place.node) {
            (Some(test), Some(node)) => {
                let per_row = test.sensor.scale.nodes_per_row();
                let row = test.rows.get(node / per_row).copied().unwrap_or_default();
                vec![place.snapshot, row, node % per_row]
            }
            _ => vec![place.snapshot],
        }
    };
    let row = |at: usize| {
        let (place, error) = places[at];
        let texts = Vec::from_iter(numbers(place).into_iter().map(|number| (number + 1).to_string()));
        let error = format_number(error).replace('-', "−");
        let is_here = place.snapshot == view.snapshot;
        let label = match &texts[..] {
            [snapshot, row, node] => format!("Snapshot {snapshot}, row {row}, node {node}: {error} mm"),
            texts => with_unit(&format!("Sample {}: {error}", texts.join(" "))),
        };
        TableRow::new(texts.into_iter().chain([error]).map(TableCell::new))
            .labelled(label)
            .selected(is_here && (channel.is_some() || place.node == view.lights.node))
            .colour(if is_here { palette.text } else { palette.dim })
    };
    let error_heading = unit.map_or_else(|| "Error".to_owned(), |unit| format!("Error {unit}"));
    let error = figure(&error_heading, "−0.0123");
    let columns = match channel {
        None => vec![
            figure("Snapshot", "1000"),
            figure("Row", "100"),
            figure("Node", "100"),
            error,
        ],
        Some(_) => vec![figure("Sample", "100000"), error],
    };
    match TableView::new("nodes in bar", &columns)
        .clickable()
        .show(ui, places.len(), row)
    {
        Some(TableClick::Point(at)) => {
            let here = places.get(at).filter(|(place, _)| place.snapshot == view.snapshot);
            let node = here.and_then(|(place, _)| place.node);
            if node != view.lights.node {
                view.lights.node = node;
                ui.request_repaint();
            }
        }
        Some(TableClick::Select(at) | TableClick::Open(at)) => {
            if let Some((place, _)) = places.get(at) {
                view.go_to(*place);
                ui.request_repaint();
            }
        }
        Some(TableClick::Sort(_)) | None => {}
    }
}

/// Direction of a section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Along {
    /// Along a row-wire, through its nodes.
    #[default]
    RowWires,
    /// Along a column-wire, below the nodes.
    ColumnWires,
}

/// The wire along which the surfaces are cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SectionChoice {
    /// Kind of wire.
    pub along: Along,
    /// Place of the row-wire among those read.
    row: usize,
    column: usize,
    /// False until the user chooses a wire; before that it is the middle one.
    is_chosen: bool,
}

impl SectionChoice {
    /// Places of the row-wire and the column-wire, within the sensor.
    fn places(&self, test: &TestView) -> [usize; 2] {
        let counts = [test.rows.len(), test.sensor.scale.columns()];
        let places = if self.is_chosen {
            [self.row, self.column]
        } else {
            counts.map(|count| count / 2)
        };
        [0, 1].map(|axis| places[axis].min(counts[axis].saturating_sub(1)))
    }

    /// The place of the wire among its kind, and their number.
    fn place(&self, test: &TestView) -> (usize, usize) {
        let [row, column] = self.places(test);
        match self.along {
            Along::RowWires => (row, test.rows.len()),
            Along::ColumnWires => (column, test.sensor.scale.columns()),
        }
    }

    /// Returns the section through the sensor of `test`.
    pub fn section(&self, test: &TestView) -> Section {
        let ([place, column], geometry) = (self.places(test), &test.sensor.geometry);
        match self.along {
            Along::RowWires => {
                let row = test.rows.get(place).copied().unwrap_or(0);
                Section {
                    line: SectionLine::RowWire(row),
                    at_mm: geometry.row_x_mm(row),
                }
            }
            Along::ColumnWires => Section {
                line: SectionLine::ColumnWire(column),
                at_mm: geometry.column_node_mm(column, 0).y,
            },
        }
    }

    /// Returns true if there is a wire before this one (`by` −1) or after it (+1).
    pub fn can_step(&self, by: isize, test: &TestView) -> bool {
        let (place, count) = self.place(test);
        place.checked_add_signed(by).is_some_and(|place| place < count)
    }

    /// Goes to the wire before (`by` −1) or after (+1).
    pub fn step(&mut self, by: isize, test: &TestView) {
        if self.can_step(by, test) {
            let [row, column] = self.places(test);
            self.choose_wires(row, column);
            let place = match self.along {
                Along::RowWires => &mut self.row,
                Along::ColumnWires => &mut self.column,
            };
            *place = place.saturating_add_signed(by);
        }
    }

    /// Cuts along these wires: the row-wire by its place among those read.
    pub fn choose_wires(&mut self, row: usize, column: usize) {
        (self.row, self.column, self.is_chosen) = (row, column, true);
    }

    /// Cuts along the wires nearest to a place.
    pub fn choose_at(&mut self, place_mm: DVec2, test: &TestView) {
        let geometry = &test.sensor.geometry;
        let nearest = |places_mm: &mut dyn Iterator<Item = f64>, at_mm: f64| {
            let distances = places_mm.map(|place_mm| (place_mm - at_mm).abs()).enumerate();
            distances
                .min_by(|one, other| one.1.total_cmp(&other.1))
                .map_or(0, |(place, _)| place)
        };
        let mut rows = test.rows.iter().map(|&row| geometry.row_x_mm(row));
        let mut columns = (0..test.sensor.scale.columns()).map(|column| geometry.column_node_mm(column, 0).y);
        self.choose_wires(nearest(&mut rows, place_mm.x), nearest(&mut columns, place_mm.y));
    }
}

/// Returns the figure of the section through the displayed surfaces.
pub fn section_of(choice: &SectionChoice, test: &TestView, frames: &Frames, look: Look) -> PlotFigure {
    let surface = |frame| test.heights("", frame, look.style());
    let decoupled = frames.decoupled.as_ref().map(|(decoupled, _)| surface(decoupled));
    let (section, actual) = (choice.section(test), surface(&frames.actual));
    section_figure(&section, &test.rows, &actual, decoupled.as_ref())
}

const DIRECTIONS: [(Along, &str, &str); 2] = [
    (
        Along::RowWires,
        "Row-wire",
        "Cuts the surfaces along a row-wire, through its nodes.",
    ),
    (
        Along::ColumnWires,
        "Column-wire",
        "Cuts the surfaces above a column-wire, across all row-wires.",
    ),
];

/// The choice of the section.
pub fn section_bar_ui(ui: &mut Ui, choice: &mut SectionChoice, test: &TestView) {
    let before = *choice;
    ui.horizontal(|ui| {
        let picked = explained_options_ui(ui, "Section along", &DIRECTIONS, choice.along, false);
        choice.along = picked.unwrap_or(choice.along);
        ui.add_space(space(1));
        if step_ui(
            ui,
            "‹",
            "Previous section",
            "Cuts along the previous wire ([).",
            choice.can_step(-1, test),
        ) {
            choice.step(-1, test);
        }
        let (place, count) = choice.place(test);
        ui.label(format!("{} of {count}", place + 1));
        if step_ui(
            ui,
            "›",
            "Next section",
            "Cuts along the next wire (]).",
            choice.can_step(1, test),
        ) {
            choice.step(1, test);
        }
        let hint = "or click a surface or a reading";
        let font = eframe::egui::TextStyle::Body.resolve(ui.style());
        let galley = ui
            .painter()
            .layout_no_wrap(hint.to_owned(), font, eframe::egui::Color32::WHITE);
        if galley.size().x < ui.available_width() {
            dim_ui(ui, hint);
        }
    });
    if *choice != before {
        ui.request_repaint();
    }
}

/// An arrow to a neighbour. Returns true if it was clicked.
pub(super) fn step_ui(ui: &mut Ui, text: &str, name: &str, hint: &str, is_possible: bool) -> bool {
    let arrow: Response = ui.add_enabled(is_possible, Button::new(text).min_size(Vec2::splat(space(6))));
    arrow.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, name));
    arrow.on_hover_text(hint).clicked()
}
