//! The array: its scale and its geometry.

use decoupler_core::{
    evaluation::RunSettings,
    scene::Rows,
    sensor::{ArrayScale, Geometry},
    settings::{Field, Kind},
    text::counted,
};
use eframe::egui::Ui;

use super::{Fields, Row};
use crate::window::{
    glossary,
    theme::space,
    widgets::{dim_ui, fields::input_text, note_ui, segmented_ui, text_ui},
};

const LENGTH: (Kind, &str) = (Kind::Number(1e-6, 1e6), "mm");
const COORDINATE: (Kind, &str) = (Kind::Number(-1e6, 1e6), "mm");

/// Lengths and resistivity of the array.
const GEOMETRY: [Row; 9] = [
    Row::number("Height", glossary::HEIGHT.hint, LENGTH, |run| {
        Some(Field::Number(&mut geometry(run)?.height_mm))
    }),
    Row::number(
        "Row pitch",
        "Distance between row-wires, in mm (the paper's wire gap).",
        LENGTH,
        |run| Some(Field::Number(&mut geometry(run)?.row_pitch_mm)),
    ),
    Row::number(
        "Node pitch",
        "Distance between nodes on a row-wire, in mm.",
        LENGTH,
        |run| Some(Field::Number(&mut geometry(run)?.node_pitch_mm)),
    ),
    Row::number(
        "Column pitch",
        "Distance between column-wires, in mm (the paper's wire gap).",
        LENGTH,
        |run| Some(Field::Number(&mut geometry(run)?.column_pitch_mm)),
    ),
    Row::number(
        "Column node pitch",
        "Distance between nodes on a column-wire, in mm.",
        LENGTH,
        |run| Some(Field::Number(&mut geometry(run)?.column_node_pitch_mm)),
    ),
    Row::number(
        "First row at x",
        "x coordinate of the first row-wire, in mm.",
        COORDINATE,
        |run| Some(Field::Number(&mut geometry(run)?.row_x0_mm)),
    ),
    Row::number(
        "First column at y",
        "y coordinate of the first column-wire, in mm.",
        COORDINATE,
        |run| Some(Field::Number(&mut geometry(run)?.column_y0_mm)),
    ),
    Row::number(
        "First column node at x",
        "x coordinate of the first node on each column-wire, in mm. Shifting it breaks the symmetry that makes rows read \
         alike.",
        COORDINATE,
        |run| Some(Field::Number(&mut geometry(run)?.column_node_x0_mm)),
    ),
    Row::number(
        "Resistivity",
        glossary::RESISTIVITY.hint,
        (Kind::Number(1e-12, 1e12), "Ω/mm"),
        |run| Some(Field::Number(&mut run.simulation_mut()?.sensor.resistivity_ohm_per_mm)),
    ),
];

fn geometry(run: &mut RunSettings) -> Option<&mut Geometry> {
    Some(&mut run.simulation_mut()?.sensor.geometry)
}

/// The scale of the array: one of the paper's, or any other typed.
pub fn array_ui(ui: &mut Ui, settings: &mut RunSettings) {
    let Some(simulation) = settings.simulation_mut() else {
        return;
    };
    let scale = &mut simulation.sensor.scale;
    let hint = glossary::ARRAY_SCALE.hint;
    text_ui(ui, "Array scale", hint, scale, ArrayScale::default());
    let names = ArrayScale::PRESETS.map(|scale| (scale, format!("{}×{}", scale.rows(), scale.nodes_per_row())));
    let options: Vec<_> = names.iter().map(|(scale, name)| (*scale, name.as_str())).collect();
    if let Some(picked) = segmented_ui(ui, "Array scale of the paper", &options, *scale, true) {
        *scale = picked;
    }
    let text = format!(
        "{} of {} over {} of {}",
        counted(scale.rows(), "row-wire"),
        counted(scale.nodes_per_row(), "node"),
        counted(scale.columns(), "column-wire"),
        counted(scale.nodes_per_column(), "node")
    );
    let wires = [glossary::ROW_WIRE, glossary::COLUMN_WIRE, glossary::NODE];
    let wires = wires.map(|term| format!("{}: {}", term.name, term.hint)).join("\n\n");
    dim_ui(ui, &text).on_hover_text(wires);
    if let Some(note) = scale.note() {
        note_ui(ui, &note);
    }
    ui.add_space(space(1));
    // The array may have become smaller.
    if let Rows::One(row) = &mut simulation.scene.rows {
        *row = (*row).min(scale.rows() - 1);
    }
}

/// Lengths and resistivity, and the way back to the assumed ones.
pub fn geometry_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    fields.show(ui, &GEOMETRY);
    dim_ui(ui, Geometry::ASSUMPTION);
    if let Some(geometry) = geometry(fields.settings).filter(|geometry| **geometry != Geometry::default())
        && ui.button("Reset to the assumed geometry").clicked()
    {
        *geometry = Geometry::default();
    }
}

/// Height, and whether the geometry differs from the assumed one.
pub fn of_geometry(geometry: &Geometry) -> String {
    let height = input_text(geometry.height_mm);
    if *geometry == Geometry::default() {
        format!("assumed, {height} mm high")
    } else {
        format!("custom, {height} mm high")
    }
}
