//! Settings of a recording that are chosen automatically: displayed, but not changed by the user.

use decoupler_core::evaluation::{RunSettings, auto::AutoRecord};
use decoupler_files::import::Setup;
use eframe::egui::{Align, Align2, Response, TextEdit, Ui, vec2};

use super::form::{of_inputs, of_method, of_stopping};
use crate::window::{
    glossary,
    shared::{Effect, Phase, Shared, combination_name},
    theme::space,
    widgets::{
        dim_ui,
        fields::{capitalised, field_ui, input_text},
        fold_ui,
    },
};

/// Tooltip of every setting that is chosen automatically.
const REASON: &str = "Chosen by cross-validation when you press Train. To set it yourself, untick “Choose settings \
                      automatically”.";

/// Value of a setting that has not been chosen yet.
const NOT_YET: &str = "automatic";

/// Shows the check box for the choice, and what is known about it.
pub(super) fn automatic_choice_ui(ui: &mut Ui, shared: &Shared, has_one_network: bool, effects: &mut Vec<Effect>) {
    let mut is_auto = shared.recording.is_auto && has_one_network;
    let reason = if has_one_network {
        "The training must end first."
    } else {
        "Settings are chosen for one network for all row-wires: choose it under “Network inputs”, Rows."
    };
    let is_enabled = has_one_network && !shared.phase.is_busy();
    ui.add_enabled_ui(is_enabled, |ui| {
        let choice = ui.checkbox(&mut is_auto, "Choose settings automatically");
        let choice = choice.on_hover_text(glossary::AUTO.hint).on_disabled_hover_text(reason);
        if choice.changed() {
            effects.push(Effect::ChooseAutomatically(is_auto));
        }
    });
    if is_auto {
        dim_ui(ui, &note(shared));
    }
}

fn note(shared: &Shared) -> String {
    let search = shared.chosen_run().and_then(|run| run.search.as_ref());
    match search.and_then(AutoRecord::choice) {
        Some(choice) => format!("Chosen: {}; {}.", choice.model, choice.features()),
        None if shared.phase == Phase::Preparing => "Settings are being chosen.".to_owned(),
        None => "Train tries several settings, and keeps those with the lowest error in cross-validation.".to_owned(),
    }
}

/// Shows hidden nodes and method; `chosen` is the setup that was chosen, if any.
pub(super) fn chosen_network_ui(ui: &mut Ui, chosen: Option<&Setup>) {
    let settings = chosen.map(Setup::settings);
    chosen_ui(ui, "Hidden nodes", settings.map(|settings| settings.hidden.to_string()));
    let method = settings.map(|settings| settings.training.method.name().to_owned());
    wide_ui(ui, "Method", method);
}

/// Shows the scaling of the inputs.
pub(super) fn chosen_inputs_ui(ui: &mut Ui, chosen: Option<&RunSettings>) {
    wide_ui(
        ui,
        "Inputs and scaling",
        chosen.map(|settings| capitalised(&of_inputs(&settings.inputs))),
    );
}

/// Shows the folded settings of the training.
pub(super) fn chosen_training_ui(ui: &mut Ui, chosen: Option<&RunSettings>) {
    let summary = |text: Option<String>| text.unwrap_or_else(|| NOT_YET.to_owned());
    let stopping = chosen.map(|settings| of_stopping(&settings.training));
    fold_ui(ui, "When to stop", &summary(stopping), |ui| {
        let epochs = chosen.map(|settings| settings.training.stopping.epochs.to_string());
        chosen_ui(ui, "Epochs", epochs);
    });
    fold_ui(ui, "Method settings", &summary(chosen.map(of_method)), |ui| {
        if let Some(settings) = chosen {
            let method = settings.training.method;
            for setting in method.settings() {
                chosen_ui(ui, &capitalised(setting.name), setting.number(&method).map(input_text));
            }
        }
        chosen_ui(ui, "Starts", chosen.map(|settings| settings.starts.to_string()));
        let combination = chosen.map(|settings| combination_name(settings.combine).to_owned());
        wide_ui(ui, "Combine starts", combination);
    });
}

/// Width of a field with a chosen number, in points: room for [`NOT_YET`].
const WIDTH: f32 = space(21);

/// Field with a chosen value.
fn chosen_ui(ui: &mut Ui, name: &str, value: Option<String>) {
    field_ui(ui, name, REASON, |ui| value_ui(ui, value, WIDTH, Align::Center));
}

/// As [`chosen_ui`], with the value below the name.
fn wide_ui(ui: &mut Ui, name: &str, value: Option<String>) {
    let label = ui.label(name).on_hover_text(REASON);
    value_ui(ui, value, f32::INFINITY, Align::Min).labelled_by(label.id);
}

fn value_ui(ui: &mut Ui, value: Option<String>, width: f32, align: Align) -> Response {
    let mut text = value.unwrap_or_else(|| NOT_YET.to_owned());
    let edit = TextEdit::singleline(&mut text)
        .align(Align2([align, Align::Center]))
        .margin(vec2(space(2), space(1)))
        .desired_width(width);
    ui.add_enabled(false, edit).on_disabled_hover_text(REASON)
}
