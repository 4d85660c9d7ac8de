use eframe::egui::{RichText, Ui};

use crate::{
    app::{
        glossary,
        theme::{Theme, type_size},
        widgets::fields::{capitalised, list_ui, options_ui},
    },
    evaluation::SimulatedSettings,
    network::{Quantity, ScalingChoice, Shape},
    scene::{Movement, Rows},
    sensor::counted,
};

/// The inputs of the network, and its size; changes `draft`.
pub fn inputs_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let options = [
        (Quantity::Resistance, "Resistance", "R, as in the paper."),
        (Quantity::Conductance, "Conductance", glossary::CONDUCTANCE.hint),
        (Quantity::LogResistance, "Log-resistance", glossary::LOG_RESISTANCE.hint),
    ];
    if let Some(picked) = list_ui(ui, "Inputs", glossary::INPUTS.hint, &options, draft.inputs.quantity) {
        draft.inputs.quantity = picked;
    }
    let options = [
        (ScalingChoice::MinMax, "Min-max", glossary::MIN_MAX.hint),
        (ScalingChoice::Whitening, "Whitening", glossary::WHITENING.hint),
    ];
    if let Some(picked) = options_ui(ui, "Scaling", glossary::SCALING.hint, &options, draft.inputs.scaling) {
        draft.inputs.scaling = picked;
    }
    weights_ui(ui, draft);
}

/// Shows the size of the networks.
fn weights_ui(ui: &mut Ui, draft: &SimulatedSettings) {
    let Ok(size) = draft.source.model_size() else { return };
    let scale = draft.source.sensor.scale;
    let varying_axes = match (draft.source.scene.movement, draft.source.scene.rows) {
        (Movement::Xyz { .. }, _) => 3,
        // Without knowing the row a network must find its x, which differs from row to row; y never does.
        (Movement::Z, Rows::All) if scale.rows() > 1 => 2,
        (Movement::Z, _) => 1,
    };
    let shape = Shape {
        inputs: scale.columns(),
        hidden: draft.hidden,
        outputs: varying_axes * scale.nodes_per_row(),
    };
    let Shape { inputs, outputs, .. } = shape;
    // Components that do not vary are left out, which only the samples show.
    let at_most = match draft.inputs.scaling {
        ScalingChoice::MinMax => "",
        ScalingChoice::Whitening => "at most ",
    };
    let weights = shape.weights();
    let [inputs, outputs, of_each] =
        [(inputs, "input"), (outputs, "output"), (weights, "weight")].map(|(count, noun)| counted(count, noun));
    let text = match size.networks {
        1 => format!("{at_most}{inputs}, {outputs}, {of_each}"),
        networks => format!(
            "{networks} networks of {at_most}{inputs}, {outputs} and {of_each}: {} in total",
            networks * weights
        ),
    };
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(capitalised(&text)).size(type_size().note).color(dim))
        .on_hover_text(
            "Inputs are the resistances of a row-wire; outputs are those coordinates of its nodes that vary.",
        );
}
