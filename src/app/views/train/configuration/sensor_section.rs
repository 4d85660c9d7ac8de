use eframe::egui::{self, CollapsingHeader, RichText, TextEdit, Ui};

use crate::{
    app::{
        theme::{Theme, space, type_size},
        widgets::{fields::quantity_ui, note_ui, section_heading_ui, segmented_ui},
    },
    evaluation::SimulatedSettings,
    sensor::{ArrayScale, Geometry},
};

/// Array scale, geometry and resistivity; changes `draft`.
pub fn sensor_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    section_heading_ui(ui, "Sensor array");
    let names = ArrayScale::PRESETS.map(|scale| (scale, format!("{}×{}", scale.rows(), scale.nodes_per_row())));
    let options: Vec<_> = names.iter().map(|(scale, name)| (*scale, name.as_str())).collect();
    if let Some(scale) = segmented_ui(
        ui,
        "Array scale of the paper",
        &options,
        draft.source.sensor.scale,
        true,
    ) {
        draft.source.sensor.scale = scale;
    }
    array_scale_ui(ui, &mut draft.source.sensor.scale);
    let scale = draft.source.sensor.scale;
    let dim = Theme::of(ui).palette.dim;
    let text = format!(
        "{} row-wires of {} nodes over {} column-wires of {} nodes",
        scale.rows(),
        scale.nodes_per_row(),
        scale.columns(),
        scale.nodes_per_column()
    );
    ui.label(RichText::new(text).size(type_size().note).color(dim));
    if let Some(note) = scale.note() {
        note_ui(ui, &note);
    }
    CollapsingHeader::new("Geometry")
        .id_salt("geometry")
        .show(ui, |ui| geometry_ui(ui, draft));
}

/// The scale as text, taken over when it parses; until then the reason it does not stands below.
fn array_scale_ui(ui: &mut Ui, scale: &mut ArrayScale) {
    let id = ui.scope_id().with("array scale text");
    let typed = ui.data(|data| data.get_temp::<String>(id));
    let mut text = typed.clone().unwrap_or_else(|| scale.to_string());
    let response = ui
        .horizontal(|ui| {
            let label = ui.label("Array scale");
            let edit = TextEdit::singleline(&mut text)
                .desired_width(f32::INFINITY)
                .margin(egui::vec2(space(2), space(1)));
            ui.add(edit).labelled_by(label.id)
        })
        .inner
        .on_hover_text("M1×M2_M3×M4: row-wires × nodes on each, nodes on each column-wire × column-wires. Any sizes.");
    let parsed = text.parse::<ArrayScale>();
    if response.changed() {
        ui.data_mut(|data| data.insert_temp(id, text));
        if let Ok(parsed) = parsed {
            *scale = parsed;
        }
    } else if !response.has_focus() && typed.is_some() && parsed.is_ok() {
        ui.data_mut(|data| data.remove_temp::<String>(id));
    } else if let (Some(_), Err(error)) = (typed, parsed) {
        note_ui(ui, &error.to_string());
    }
}

fn geometry_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
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
    let lengths = [
        ("Height", "Row-wires above column-wires, undeformed.", height_mm),
        ("Row pitch", "Between row-wires (the paper's wire gap).", row_pitch_mm),
        ("Node pitch", "Between nodes on a row-wire.", node_pitch_mm),
        (
            "Column pitch",
            "Between column-wires (the paper's wire gap).",
            column_pitch_mm,
        ),
        (
            "Column node pitch",
            "Between nodes on a column-wire.",
            column_node_pitch_mm,
        ),
    ];
    for (name, hint, value) in lengths {
        quantity_ui(ui, name, hint, value, 1e-6..=1e6, "mm");
    }
    let offsets = [
        ("First row at x", "x of the first row-wire.", row_x0_mm),
        ("First column at y", "y of the first column-wire.", column_y0_mm),
        (
            "First column node at x",
            "x of the first node on each column-wire.",
            column_node_x0_mm,
        ),
    ];
    for (name, hint, value) in offsets {
        quantity_ui(ui, name, hint, value, -1e6..=1e6, "mm");
    }
    let hint = "g, resistance of a millimetre of rubber. It scales all resistances alike.";
    quantity_ui(
        ui,
        "Resistivity",
        hint,
        &mut draft.source.sensor.resistivity_ohm_per_mm,
        1e-12..=1e12,
        "Ω/mm",
    );
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(Geometry::ASSUMPTION).size(type_size().note).color(dim));
    if draft.source.sensor.geometry != Geometry::default() && ui.button("Back to the assumed geometry").clicked() {
        draft.source.sensor.geometry = Geometry::default();
    }
}
