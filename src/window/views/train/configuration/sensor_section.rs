use decoupler_core::{
    evaluation::{Measured, RunSettings, SimulatedSettings},
    network::{Quantity, ScalingChoice, Shape},
    scene::{Movement, RowModel, Rows},
    sensor::{Geometry, SensorModel},
    text::counted,
};
use eframe::egui::{RichText, Ui};

use crate::window::{
    glossary,
    theme::{Theme, type_size},
    widgets::{
        dim_ui,
        fields::{capitalised, list_ui, options_ui, quantity_ui, usually},
    },
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

/// The inputs of the network of an array, and its size; changes `draft`.
pub fn array_inputs_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let options = [
        (Quantity::Resistance, "Resistance", "R, as in the paper."),
        (Quantity::Conductance, "Conductance", glossary::CONDUCTANCE.hint),
        (Quantity::LogResistance, "Log-resistance", glossary::LOG_RESISTANCE.hint),
    ];
    if let Some(picked) = list_ui(ui, "Inputs", glossary::INPUTS.hint, &options, draft.inputs.quantity) {
        draft.inputs.quantity = picked;
    }
    scaling_ui(ui, &mut draft.inputs.scaling);
    let Ok(size) = draft.source.model_size() else { return };
    let scale = draft.source.sensor.scale;
    let varying_axes = match (draft.source.scene.movement, draft.source.scene.rows) {
        (Movement::Xyz { .. }, _) => 3,
        // Without knowing the row a network must find its x, which differs from row to row; y never does.
        (Movement::Z, Rows::All) if scale.rows() > 1 => 2,
        (Movement::Z, _) => 1,
    };
    let channels = (scale.columns(), varying_axes * scale.nodes_per_row());
    weights_ui(ui, draft, channels, size.networks);
}

/// The inputs of the network of a recording with these numbers of inputs and targets, and its size; changes `settings`. One
/// network per row-wire is offered if a column has their numbers.
pub fn recording_inputs_ui(
    ui: &mut Ui,
    settings: &mut RunSettings,
    channels: Option<(usize, usize)>,
    has_row_wires: bool,
) {
    scaling_ui(ui, &mut settings.inputs.scaling);
    let rows = settings.source.row_model();
    if has_row_wires {
        let options = [
            (RowModel::Shared, "All", "One network for all row-wires."),
            (
                RowModel::Each,
                "Known",
                "One network per row-wire, for electronics that know which row they address.",
            ),
        ];
        if let Some(rows) = options_ui(ui, "Rows", glossary::ROWS.hint, &options, rows) {
            settings.source = Measured { rows }.into();
        }
    }
    if let (Some(channels), RowModel::Shared) = (channels, rows) {
        weights_ui(ui, settings, channels, 1);
    }
}

fn scaling_ui(ui: &mut Ui, scaling: &mut ScalingChoice) {
    let options = [
        (ScalingChoice::MinMax, "Min-max", glossary::MIN_MAX.hint),
        (ScalingChoice::Whitening, "Whitening", glossary::WHITENING.hint),
    ];
    if let Some(picked) = options_ui(ui, "Scaling", glossary::SCALING.hint, &options, *scaling) {
        *scaling = picked;
    }
}

/// Shows the size of the networks with these numbers of inputs and outputs.
fn weights_ui<S>(ui: &mut Ui, settings: &RunSettings<S>, (inputs, outputs): (usize, usize), networks: usize) {
    let shape = Shape {
        inputs,
        hidden: settings.hidden,
        outputs,
    };
    // Components that do not vary are left out, which only the samples show.
    let at_most = match settings.inputs.scaling {
        ScalingChoice::MinMax => "",
        ScalingChoice::Whitening => "at most ",
    };
    let weights = shape.weights();
    let [inputs, outputs, of_each] =
        [(inputs, "input"), (outputs, "output"), (weights, "weight")].map(|(count, noun)| counted(count, noun));
    let text = match networks {
        1 => format!("{at_most}{inputs}, {outputs}, {of_each}"),
        networks => format!(
            "{networks} networks of {at_most}{inputs}, {outputs} and {of_each}: {} in total",
            networks * weights
        ),
    };
    dim_ui(ui, &capitalised(&text)).on_hover_text("Inputs are readings; outputs are the targets that vary.");
}
