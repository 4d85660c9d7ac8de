//! The configuration of the next training: what it is trained on, hidden nodes and method first, the rest folded below them
//! in the order of the pipeline.

use decoupler_core::{
    evaluation::{Outlook, TrainingSize, auto::AutoRecord},
    scene::RowModel,
};
use eframe::egui::Ui;

use super::recording::RecordingEditor;
use crate::window::{
    forms::{self, Fields, SetBy},
    glossary,
    shared::{Effect, Phase, Shared, SourceKind},
    theme::space,
    widgets::{dim_ui, fields::capitalised, fold_ui, note_ui, scrolled_ui, segmented_ui},
};

/// The source and the settings of the next training.
pub fn configuration_ui(ui: &mut Ui, recording: &mut RecordingEditor, shared: &Shared, effects: &mut Vec<Effect>) {
    let before = match shared.source {
        SourceKind::Array => shared.draft,
        SourceKind::Recording => shared.recording.settings,
    };
    let mut settings = before;
    scrolled_ui(ui, "configuration", |ui| {
        ui.add_space(space(2));
        let sources = [
            (SourceKind::Array, "Simulated array"),
            (SourceKind::Recording, "Recording"),
        ];
        ui.add_enabled_ui(!shared.phase.is_busy(), |ui| {
            let picked = segmented_ui(ui, "Source", &sources, shared.source, true);
            effects.extend(picked.map(Effect::ChooseSource));
        });
        ui.add_space(space(2));
        let mut fields = Fields::new(&mut settings);
        if shared.source == SourceKind::Recording && shared.recording.is_automatic() {
            fields.set_by = SetBy::Choice(shared.chosen_run().map(|run| run.settings()));
        }
        settings_ui(ui, &mut fields, recording, shared, effects);
        ui.add_space(space(4));
    });
    forms::follow_preset(&before, &mut settings);
    if settings != before {
        effects.push(match shared.source {
            SourceKind::Array => Effect::Configure(Box::new(settings)),
            SourceKind::Recording => Effect::ConfigureRecording(Box::new(settings)),
        });
    }
}

/// The settings of either source.
fn settings_ui(
    ui: &mut Ui,
    fields: &mut Fields<'_>,
    recording: &mut RecordingEditor,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let (is_recording, phase) = (shared.source == SourceKind::Recording, shared.phase);
    let (is_new, is_open) = (!phase.is_busy(), !phase.is_busy() || phase == Phase::Paused);
    ui.add_enabled_ui(is_new, |ui| match is_recording {
        true => recording.files_ui(ui, shared, effects),
        false => forms::preset_ui(ui, fields.settings),
    });
    if let Some(simulation) = fields.settings.simulation_mut() {
        ui.add_enabled_ui(is_new, |ui| forms::array_ui(ui, simulation));
    }
    if is_recording {
        recording.columns_button_ui(ui, shared);
        ui.add_space(space(2));
        ui.separator();
        automatic_choice_ui(ui, shared, effects);
    }
    let (channels, size) = match fields.settings.simulation() {
        Some(simulation) => {
            let scale = simulation.sensor.scale;
            let channels = (scale.columns(), scale.coordinates_per_row());
            (Some(channels), TrainingSize::drawn(fields.settings).ok())
        }
        None => (recording.channels(), recording.training_size(fields.settings)),
    };
    ui.add_enabled_ui(is_new, |ui| forms::hidden_ui(ui, fields, channels));
    ui.add_space(space(1));
    // A paused training can be continued with another method.
    ui.add_enabled_ui(is_open, |ui| forms::method_ui(ui, fields));
    if let (SetBy::User, Some(size)) = (fields.set_by, size) {
        forms::workload_ui(ui, fields.settings, size);
    }
    ui.add_enabled_ui(is_new, |ui| {
        if is_recording {
            ui.add_space(space(2));
            ui.separator();
            recording.folds_ui(ui, fields.settings, shared, effects);
        } else {
            array_ui(ui, fields, shared.skin().and_then(|skin| skin.outlook.as_ref()));
        }
    });
    let has_recorded_rows = is_recording && recording.has_row_wires();
    ui.add_enabled_ui(is_open, |ui| {
        forms::advanced_ui(ui, fields, is_new, has_recorded_rows, size);
    });
}

/// Scene and samples of a simulated array.
fn array_ui(ui: &mut Ui, fields: &mut Fields<'_>, outlook: Option<&Outlook>) {
    let Some(&simulation) = fields.settings.simulation() else {
        return;
    };
    ui.add_space(space(2));
    ui.separator();
    // They stay visible while the scene is folded away.
    for warning in outlook.iter().flat_map(|outlook| &outlook.warnings) {
        note_ui(ui, &capitalised(&format!("{warning}.")));
    }
    fold_ui(ui, "Scene", &forms::of_scene(&simulation.scene), |ui| {
        forms::scene_ui(ui, fields);
        forms::size_ui(ui, &simulation, outlook);
    });
    fold_ui(ui, "Samples", &forms::of_samples(fields.settings), |ui| {
        fields.show(ui, &forms::SAMPLES);
    });
}

/// The check box that leaves the settings of a recording to a choice by cross-validation, and what is known about it.
fn automatic_choice_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    let has_one_network = shared.recording.settings.source.row_model() == RowModel::Shared;
    let mut is_automatic = shared.recording.is_automatic();
    let reason = if has_one_network {
        "The training must end first."
    } else {
        "Settings are chosen for one network for all row-wires: choose it under “Advanced”, Rows."
    };
    ui.add_enabled_ui(has_one_network && !shared.phase.is_busy(), |ui| {
        let choice = ui.checkbox(&mut is_automatic, "Choose settings automatically");
        let choice = choice.on_hover_text(glossary::AUTO.hint).on_disabled_hover_text(reason);
        if choice.changed() {
            effects.push(Effect::ChooseAutomatically(is_automatic));
        }
    });
    if is_automatic {
        let search = shared.chosen_run().and_then(|run| run.search.as_ref());
        let note = match search.and_then(AutoRecord::choice) {
            Some(choice) => format!("Chosen: {}; {}.", choice.model, choice.features()),
            None if shared.phase == Phase::Preparing => "Settings are being chosen.".to_owned(),
            None => {
                "Train tries several settings, and keeps those with the lowest error in cross-validation.".to_owned()
            }
        };
        dim_ui(ui, &note);
    }
}
