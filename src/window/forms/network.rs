//! The network: hidden nodes, inputs, and its size.

use decoupler_core::{
    evaluation::{RunSettings, TrainingSize, Workload},
    network::{ScalingChoice, Shape, suggested_hidden},
    text::counted,
};
use decoupler_files::export::{describe_recorded_workload, describe_workload};
use eframe::egui::{RichText, Ui};

use super::{Fields, Look, Row, SetBy};
use crate::window::{
    theme::{Theme, type_size},
    widgets::{dim_ui, fields::capitalised},
};

const HIDDEN: Row = Row("hidden", "Hidden nodes", Look::Number(""));

pub(super) const INPUTS: [Row; 2] = [
    Row(
        "inputs",
        "Inputs",
        Look::List(&[
            ("resistance", "Resistance"),
            ("conductance", "Conductance"),
            ("log", "Log-resistance"),
        ]),
    ),
    Row(
        "scaling",
        "Scaling",
        Look::List(&[("minmax", "Min-max"), ("whiten", "Whitening")]),
    ),
];

/// Row-wires that are read; a recording has no choice of one.
pub(super) const ROWS: Row = Row(
    "rows",
    "Rows",
    Look::List(&[("all", "All"), ("known", "Known"), ("1", "One")]),
);

/// Hidden nodes, with the rules of thumb for these numbers of inputs and outputs.
pub fn hidden_ui(ui: &mut Ui, fields: &mut Fields<'_>, channels: Option<(usize, usize)>) {
    fields.show(ui, &[HIDDEN]);
    if let SetBy::Choice(_) = fields.set_by {
        return;
    }
    let Some((n, m)) = channels else { return };
    let (square_root, logarithm) = suggested_hidden(n, m);
    let (low, high) = (*square_root.start(), *square_root.end());
    let text = format!("Rules of thumb: {logarithm}, or {low} to {high}");
    dim_ui(ui, &text).on_hover_text(format!(
        "Rules of the paper for n = {n} inputs and m = {m} outputs: log₂ n (Eq. 13), or √(n + m) + a with a from 1 to 10 \
         (Eq. 12). A starting point, not a limit."
    ));
}

/// Notes the memory and time of a training of this size that needs much of either.
pub fn workload_ui(ui: &mut Ui, settings: &RunSettings, size: TrainingSize) {
    let workload = Workload::of(settings, size);
    let text = match settings.simulation() {
        Some(_) => workload.is_large().then(|| describe_workload(&workload)),
        None => describe_recorded_workload(settings, size),
    };
    if let Some(text) = text {
        let warning = Theme::of(ui).palette.warning;
        ui.label(RichText::new(capitalised(&text)).size(type_size().note).color(warning));
    }
}

/// Quantity and scaling of the inputs, rows of a recording that has several, and the size of the network.
pub(super) fn inputs_ui(ui: &mut Ui, fields: &mut Fields<'_>, has_recorded_rows: bool, size: Option<TrainingSize>) {
    fields.show(ui, &INPUTS);
    if has_recorded_rows {
        ROWS.ui(ui, fields.settings, &fields.usual);
    }
    if let (SetBy::User, Some(size)) = (fields.set_by, size) {
        weights_ui(ui, fields.settings, size);
    }
}

/// Quantity and scaling of the inputs in a line.
pub(super) fn of_inputs(settings: &RunSettings) -> String {
    let texts = INPUTS.iter().filter_map(|row| row.text(settings));
    texts.map(|text| text.to_lowercase()).collect::<Vec<_>>().join(", ")
}

/// Shows the size of the networks.
fn weights_ui(ui: &mut Ui, settings: &RunSettings, size: TrainingSize) {
    let shape = Shape {
        inputs: size.inputs,
        hidden: settings.hidden,
        outputs: size.targets,
    };
    // Components that do not vary are left out, which is known only from the samples.
    let at_most = match settings.inputs.scaling {
        ScalingChoice::MinMax => "",
        ScalingChoice::Whitening => "at most ",
    };
    let weights = shape.weights();
    let [inputs, outputs, of_each] = [(shape.inputs, "input"), (shape.outputs, "output"), (weights, "weight")]
        .map(|(count, noun)| counted(count, noun));
    let text = match size.networks {
        1 => format!("{at_most}{inputs}, {outputs}, {of_each}"),
        networks => format!(
            "{networks} networks of {at_most}{inputs}, {outputs} and {of_each}: {} in total",
            networks * weights
        ),
    };
    dim_ui(ui, &capitalised(&text)).on_hover_text("Inputs are readings; outputs are the targets that vary.");
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;

    #[test]
    fn a_large_training_states_its_memory_and_time_before_it_begins() {
        for (hidden, is_shown) in [(12, false), (512, true)] {
            let mut settings = RunSettings {
                hidden,
                ..RunSettings::default()
            };
            settings.simulation_mut().unwrap().sensor.scale = "10x10_5x512".parse().unwrap();
            let size = TrainingSize::drawn(&settings).unwrap();
            let harness = Harness::new_ui(move |ui| workload_ui(ui, &settings, size));
            let found = harness.query_by_label_contains("of memory");
            assert_eq!(found.is_some(), is_shown, "{hidden} hidden nodes");
        }
    }
}
