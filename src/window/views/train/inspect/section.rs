use eframe::egui::{Button, Response, Ui, Vec2, WidgetInfo, accesskit::Role};
use glam::DVec2;

use crate::window::{
    shared::Look,
    test_view::{Frame, HeightScale, TestView},
    theme::space,
    views::train::drawn::Frames,
    widgets::{dim_ui, explained_options_ui},
};
use decoupler_files::figure::{
    PlotFigure, SectionNodes, section_figure,
    surface::{Section, SectionLine},
};

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
    /// False until somebody chose a wire: before, it is the middle one.
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

    /// True if there is a wire before this one (`by` −1) or after it (+1).
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
    fn cut(frame: &Frame) -> SectionNodes<'_> {
        SectionNodes {
            values_mm: &frame.grid_mm,
            nodes_mm: &frame.nodes_mm,
        }
    }
    let decoupled = frames.decoupled.as_ref().map(|(decoupled, _)| decoupled);
    let fitted = || {
        let both = [Some(&frames.actual), decoupled]
            .into_iter()
            .flatten()
            .filter_map(Frame::range_mm);
        both.reduce(|one, other| one.start().min(*other.start())..=one.end().max(*other.end()))
    };
    let heights_mm = match look.heights {
        HeightScale::Stroke => None,
        HeightScale::Fitted => fitted(),
    };
    section_figure(
        &choice.section(test),
        &test.surface,
        &test.rows,
        cut(&frames.actual),
        decoupled.map(cut),
        heights_mm.unwrap_or_else(|| test.z_range_mm()),
    )
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
            "Cuts along the wire before ([).",
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
