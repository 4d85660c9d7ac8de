//! The array: its scale and its geometry.

use decoupler_core::{
    dataset::Simulation,
    scene::Rows,
    sensor::{ArrayScale, Geometry, SensorModel},
    text::counted,
};
use eframe::egui::Ui;

use super::meaning;
use crate::window::{
    glossary,
    widgets::{
        dim_ui,
        fields::{list_ui, quantity_ui, usually},
        note_ui, text_ui,
    },
};

/// A length of the geometry, and access to it.
type Length = (&'static str, fn(&mut Geometry) -> &mut f64);

const LENGTHS: [Length; 8] = [
    ("Height", |at| &mut at.height_mm),
    ("Row pitch", |at| &mut at.row_pitch_mm),
    ("Node pitch", |at| &mut at.node_pitch_mm),
    ("Column pitch", |at| &mut at.column_pitch_mm),
    ("Column node pitch", |at| &mut at.column_node_pitch_mm),
    ("First row at x", |at| &mut at.row_x0_mm),
    ("First column at y", |at| &mut at.column_y0_mm),
    ("First column node at x", |at| &mut at.column_node_x0_mm),
];

/// Tooltip of the lengths but the height.
const PLACES: &str = "Row-wires run along y above the column-wires, which run along x. A pitch is the distance of neighbours, in \
                      mm: between wires (the paper's wire gap), or between the nodes on a wire. The first wire or node of each \
                      kind is placed by its coordinate, in mm. Shifting the nodes of the column-wires breaks the symmetry that \
                      makes rows read alike.";

/// The scale of the array: one of the paper's, or any other typed.
pub fn array_ui(ui: &mut Ui, Simulation { sensor, scene, .. }: &mut Simulation) {
    let scale = &mut sensor.scale;
    let hint = glossary::ARRAY_SCALE.hint;
    text_ui(ui, "Array scale", hint, scale, ArrayScale::default());
    let names = ArrayScale::PRESETS.map(|scale| (scale, scale.to_string()));
    let listed = Vec::from_iter(names.iter().map(|(scale, name)| (*scale, name.as_str(), "")));
    let hint = "The arrays of the paper.";
    *scale = list_ui(ui, "Paper's array", hint, &listed, *scale).unwrap_or(*scale);
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
    // The array may have become smaller.
    if let Rows::One(row) = &mut scene.rows {
        *row = (*row).min(scale.rows() - 1);
    }
}

/// Lengths and resistivity.
pub fn geometry_ui(ui: &mut Ui, sensor: &mut SensorModel) {
    for (name, length) in LENGTHS {
        let hint = meaning(name).unwrap_or(PLACES);
        let usual = *length(&mut Geometry::default());
        let range = if name.starts_with("First") {
            -1e6..=1e6
        } else {
            1e-6..=1e6
        };
        quantity_ui(
            ui,
            name,
            hint,
            length(&mut sensor.geometry),
            usually(usual, range),
            "mm",
        );
    }
    let usual = usually(SensorModel::new(sensor.scale).resistivity_ohm_per_mm, 1e-12..=1e12);
    let hint = glossary::RESISTIVITY.hint;
    quantity_ui(
        ui,
        "Resistivity",
        hint,
        &mut sensor.resistivity_ohm_per_mm,
        usual,
        "Ω/mm",
    );
    dim_ui(ui, Geometry::ASSUMPTION);
}
