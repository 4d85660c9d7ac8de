//! The section through the surfaces along a wire.

use decoupler_files::figure::{
    PlotFigure,
    surface::{Section, SectionLine, section_figure},
};
use eframe::egui::{DragValue, Ui};
use glam::DVec2;

use crate::window::{
    shared::Look,
    test_view::{Drawing, Skin},
    theme::space,
    widgets::explained_options_ui,
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SectionChoice {
    /// Kind of wire.
    pub along: Along,
    /// Places of the row-wire among those read, and of the column-wire; the middle ones until the user chooses.
    wires: Option<[usize; 2]>,
    /// Pressed place that it has followed last.
    followed_mm: Option<DVec2>,
}

/// Numbers of row-wires read and of column-wires.
fn counts(skin: &Skin) -> [usize; 2] {
    [skin.rows.len(), skin.sensor.scale.columns()]
}

impl SectionChoice {
    /// Places of the row-wire and the column-wire, within the sensor.
    fn wires(&self, skin: &Skin) -> [usize; 2] {
        let counts = counts(skin);
        let wires = self.wires.unwrap_or(counts.map(|count| count / 2));
        [0, 1].map(|axis| wires[axis].min(counts[axis].saturating_sub(1)))
    }

    /// Returns the section through the sensor of `skin`.
    pub fn section(&self, skin: &Skin) -> Section {
        let ([place, column], geometry) = (self.wires(skin), &skin.sensor.geometry);
        let row = skin.rows.get(place).copied().unwrap_or(0);
        let (line, at_mm) = match self.along {
            Along::RowWires => (SectionLine::RowWire(row), geometry.row_x_mm(row)),
            Along::ColumnWires => (SectionLine::ColumnWire(column), geometry.column_node_mm(column, 0).y),
        };
        Section { line, at_mm }
    }

    /// Returns the choice of the wire before this one (`by` −1) or after it (+1), if there is one.
    pub fn stepped(&self, by: isize, skin: &Skin) -> Option<Self> {
        let (axis, mut wires) = (self.along as usize, self.wires(skin));
        let place = wires[axis].checked_add_signed(by);
        wires[axis] = place.filter(|place| *place < counts(skin)[axis])?;
        let wires = Some(wires);
        Some(Self { wires, ..*self })
    }

    /// Cuts along these wires: the row-wire by its place among those read, and the column-wire.
    pub fn choose(&mut self, wires: [usize; 2]) {
        self.wires = Some(wires);
    }

    /// Cuts along the wires nearest to the pressed place whenever it moves.
    pub fn follow(&mut self, pressed_mm: Option<DVec2>, skin: &Skin) {
        if let Some(place_mm) = pressed_mm.filter(|_| self.followed_mm != pressed_mm) {
            self.choose_at(place_mm, skin);
        }
        self.followed_mm = pressed_mm;
    }

    /// Cuts along the wires nearest to a place.
    pub fn choose_at(&mut self, place_mm: DVec2, skin: &Skin) {
        fn nearest(places_mm: impl Iterator<Item = f64>, at_mm: f64) -> usize {
            let distances = places_mm.map(|place_mm| (place_mm - at_mm).abs()).enumerate();
            let nearest = distances.min_by(|one, other| one.1.total_cmp(&other.1));
            nearest.map_or(0, |(place, _)| place)
        }
        let geometry = &skin.sensor.geometry;
        let rows = skin.rows.iter().map(|&row| geometry.row_x_mm(row));
        let columns = (0..skin.sensor.scale.columns()).map(|column| geometry.column_node_mm(column, 0).y);
        self.choose([nearest(rows, place_mm.x), nearest(columns, place_mm.y)]);
    }
}

/// Returns the figure of the section through the displayed surfaces.
pub fn section_of(choice: &SectionChoice, skin: &Skin, drawing: &Drawing, look: Look) -> PlotFigure {
    let dressed = |surface| look.dressed(surface, String::new());
    let decoded = drawing.decoded.as_ref().map(|[decoded, _]| dressed(decoded));
    let (section, actual) = (choice.section(skin), dressed(&drawing.actual));
    section_figure(&section, &skin.rows, &actual, decoded.as_ref())
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
pub fn section_bar_ui(ui: &mut Ui, choice: &mut SectionChoice, skin: &Skin) {
    ui.horizontal(|ui| {
        let picked = explained_options_ui(ui, "Section along", &DIRECTIONS, choice.along, false);
        choice.along = picked.unwrap_or(choice.along);
        ui.add_space(space(1));
        let (axis, mut wires) = (choice.along as usize, choice.wires(skin));
        let (count, mut number) = (counts(skin)[axis], wires[axis] + 1);
        let field = DragValue::new(&mut number)
            .range(1..=count)
            .suffix(format!(" of {count}"));
        let field = ui.add(field);
        ui.ctx()
            .accesskit_node_builder(field.id, |node| node.set_label("Wire of the section"));
        let hint = "Type a number, drag, press [ or ], or click a surface or a reading.";
        field.on_hover_text(hint);
        if number != wires[axis] + 1 {
            wires[axis] = number - 1;
            choice.choose(wires);
        }
    });
}
