use eframe::egui::{RichText, Slider, Stroke, Ui};

use crate::{
    app::{
        theme::{Theme, space, type_size},
        widgets::{
            fields::{capitalised, count_ui, list_ui, options_ui},
            section_heading_ui, slider_style,
        },
    },
    evaluation::{SimulatedSettings, Workload},
    export::describe_workload,
    network::{HiddenSuggestions, LARGEST_HIDDEN, Quantity, ScalingChoice, Shape},
    scene::{Movement, Rows},
};

/// What the network is given, and how large it is; changes `draft`.
pub fn network_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    section_heading_ui(ui, "Network");
    inputs_ui(ui, draft);
    let hint = "Nodes of the tanh layer between resistances and coordinates.";
    count_ui(ui, "Hidden nodes", hint, &mut draft.hidden, 1..=LARGEST_HIDDEN);
    let scale = draft.source.sensor.scale;
    let suggestions = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
    let (low, high) = (*suggestions.square_root.start(), *suggestions.square_root.end());
    hidden_slider_ui(ui, &mut draft.hidden, [suggestions.logarithm, low, high]);
    let dim = Theme::of(ui).palette.dim;
    let (n, m) = (scale.columns(), scale.coordinates_per_row());
    let text = format!("Rules of thumb: {}, or {low} to {high}", suggestions.logarithm);
    ui.label(RichText::new(text).size(type_size().note).color(dim))
        .on_hover_text(format!(
            "Of the paper, for n = {n} inputs and m = {m} outputs: log₂ n (Eq. 13), or √(n + m) + a with a from 1 to 10 \
             (Eq. 12). A start, not a bound."
        ));
    weights_ui(ui, draft);
    workload_ui(ui, draft);
}

/// Memory and time of a training that takes much of either.
fn workload_ui(ui: &mut Ui, draft: &SimulatedSettings) {
    if let Ok(workload) = Workload::of(draft)
        && workload.is_large()
    {
        let warning = Theme::of(ui).palette.warning;
        let text = capitalised(&describe_workload(&workload));
        ui.label(RichText::new(text).size(type_size().note).color(warning));
    }
}

fn inputs_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let options = [
        (Quantity::Resistance, "Resistance", "R: the paper."),
        (
            Quantity::Conductance,
            "Conductance",
            "1/R. By Eq. (2) a plain sum over nodes, hence the most nearly linear in the deformation.",
        ),
        (
            Quantity::LogResistance,
            "Log-resistance",
            "ln R: relative errors become additive.",
        ),
    ];
    let hint = "What the network is given of each resistance.";
    if let Some(picked) = list_ui(ui, "Inputs", hint, &options, draft.inputs.quantity) {
        draft.inputs.quantity = picked;
    }
    let options = [
        (
            ScalingChoice::MinMax,
            "Min-max",
            "Each channel between −1 and 1: the paper.",
        ),
        (
            ScalingChoice::Whitening,
            "Whitening",
            "Principal components, each divided by √(σ² + noise²): what varies little counts as much as what varies \
             most, unless noise hides it.",
        ),
    ];
    let hint = "How the inputs are scaled.";
    if let Some(picked) = options_ui(ui, "Scaling", hint, &options, draft.inputs.scaling) {
        draft.inputs.scaling = picked;
    }
}

/// How large the networks are.
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
    let text = match size.networks {
        1 => format!("{at_most}{inputs} inputs, {outputs} outputs, {weights} weights"),
        networks => format!(
            "{networks} networks of {at_most}{inputs} inputs, {outputs} outputs and {weights} weights: {} in all",
            networks * weights
        ),
    };
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(capitalised(&text)).size(type_size().note).color(dim))
        .on_hover_text(
            "Inputs are the resistances of a row-wire; outputs are those coordinates of its nodes that vary.",
        );
}

/// A slider for small networks, with small marks at the suggestions.
fn hidden_slider_ui(ui: &mut Ui, hidden: &mut usize, suggestions: [usize; 3]) {
    const MOST: usize = 64;
    ui.scope(|ui| {
        slider_style(ui);
        ui.spacing_mut().slider_width = ui.available_width();
        let slider = Slider::new(hidden, 1..=MOST)
            .show_value(false)
            .clamping(eframe::egui::SliderClamping::Never);
        let response = ui.add(slider);
        let rail = response.rect.x_range().shrink(0.4 * response.rect.height());
        let stroke = Stroke::new(1.5, Theme::of(ui).palette.warning);
        for suggestion in suggestions.into_iter().filter(|suggestion| *suggestion <= MOST) {
            let share = (suggestion - 1) as f32 / (MOST - 1) as f32;
            let (x, bottom) = (rail.min + share * rail.span(), response.rect.bottom() + space(1));
            ui.painter().vline(x, bottom - space(1)..=bottom, stroke);
        }
        let value = *hidden as f64;
        response.widget_info(|| eframe::egui::WidgetInfo::slider(true, value, "Hidden nodes slider"));
    });
    ui.add_space(space(1));
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;

    #[test]
    fn a_large_training_tells_its_memory_and_time_before_it_begins() {
        for (hidden, is_told) in [(12, false), (512, true)] {
            let mut draft = SimulatedSettings {
                hidden,
                ..SimulatedSettings::default()
            };
            draft.source.sensor.scale = "10x10_5x512".parse().unwrap();
            let harness = Harness::new_ui(move |ui| workload_ui(ui, &draft));
            let found = harness.query_by_label_contains("of memory");
            assert_eq!(found.is_some(), is_told, "{hidden} hidden nodes");
        }
    }
}
