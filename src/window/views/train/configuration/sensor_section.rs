use eframe::egui::{RichText, Ui};

use crate::window::{
    glossary,
    theme::{Theme, type_size},
    widgets::fields::{quantity_ui, usually},
};
use decoupler_core::{
    evaluation::SimulatedSettings,
    sensor::{Geometry, SensorModel},
};

/// Lengths and resistivity; changes `draft`.
pub fn geometry_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let Geometry {
        height_mm,
        row_x0_mm,
        row_pitch_mm,
        node_pitch_mm,
        column_y0_mm,
        column_pitch_mm,
        column_node_x0_mm,
        column_node_pitch_mm,
    } = &mut draft.source.sensor.geometry;
    let usual = Geometry::default();
    let lengths = [
        ("Height", glossary::HEIGHT.hint, height_mm, usual.height_mm),
        (
            "Row pitch",
            "Distance between row-wires, in mm (the paper's wire gap).",
            row_pitch_mm,
            usual.row_pitch_mm,
        ),
        (
            "Node pitch",
            "Distance between nodes on a row-wire, in mm.",
            node_pitch_mm,
            usual.node_pitch_mm,
        ),
        (
            "Column pitch",
            "Distance between column-wires, in mm (the paper's wire gap).",
            column_pitch_mm,
            usual.column_pitch_mm,
        ),
        (
            "Column node pitch",
            "Distance between nodes on a column-wire, in mm.",
            column_node_pitch_mm,
            usual.column_node_pitch_mm,
        ),
    ];
    for (name, hint, value, usual) in lengths {
        quantity_ui(ui, name, hint, value, usually(usual, 1e-6..=1e6), "mm");
    }
    let offsets = [
        (
            "First row at x",
            "x coordinate of the first row-wire, in mm.",
            row_x0_mm,
            usual.row_x0_mm,
        ),
        (
            "First column at y",
            "y coordinate of the first column-wire, in mm.",
            column_y0_mm,
            usual.column_y0_mm,
        ),
        (
            "First column node at x",
            "x coordinate of the first node on each column-wire, in mm.",
            column_node_x0_mm,
            usual.column_node_x0_mm,
        ),
    ];
    for (name, hint, value, usual) in offsets {
        quantity_ui(ui, name, hint, value, usually(usual, -1e6..=1e6), "mm");
    }
    let hint = glossary::RESISTIVITY.hint;
    quantity_ui(
        ui,
        "Resistivity",
        hint,
        &mut draft.source.sensor.resistivity_ohm_per_mm,
        usually(
            SensorModel::new(draft.source.sensor.scale).resistivity_ohm_per_mm,
            1e-12..=1e12,
        ),
        "Ω/mm",
    );
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(Geometry::ASSUMPTION).size(type_size().note).color(dim));
    if draft.source.sensor.geometry != Geometry::default() && ui.button("Reset to the assumed geometry").clicked() {
        draft.source.sensor.geometry = Geometry::default();
    }
}
