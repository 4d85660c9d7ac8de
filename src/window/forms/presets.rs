//! Presets of a simulated array and ready-made scenes, one click each.

use decoupler_core::{
    evaluation::{Preset, RunSettings},
    scene::Scene,
};
use eframe::egui::Ui;

use crate::window::{glossary, shared::opening_scene, theme::space, widgets::explained_options_ui};

/// The presets: how readings are decoded and trained on.
pub fn preset_ui(ui: &mut Ui, settings: &mut RunSettings) {
    ui.add_space(space(2));
    let options = [
        (
            Some(Preset::Paper),
            "Paper",
            "One network for all rows, resistances between −1 and 1, 1000 training samples. Array, axes, loading, noise, \
             hidden nodes and seed stay as they are.",
        ),
        (
            Some(Preset::Best),
            "Best",
            "A small network for each known row, whitened conductances, 5000 training samples, or 50 000 if the readings are \
             noisy: by measurement, the lowest test error for the same hidden nodes. Array, axes, loading, noise, hidden \
             nodes and seed stay as they are.",
        ),
    ];
    if let Some(Some(picked)) = explained_options_ui(ui, "Preset", &options, preset_of(settings), true) {
        *settings = with_preset(picked, settings);
    }
}

/// Returns the preset that the settings follow, if any.
fn preset_of(settings: &RunSettings) -> Option<Preset> {
    Preset::ALL
        .into_iter()
        .find(|&preset| with_preset(preset, settings) == *settings)
}

/// Returns the settings with those of `preset`: how readings are decoded and trained on, not the scene.
fn with_preset(preset: Preset, settings: &RunSettings) -> RunSettings {
    let mut settings = *settings;
    if let Some(simulation) = settings.simulation_mut() {
        let noise = simulation.scene.noise;
        let of_preset = preset.simulation_in(noise);
        simulation.scene.rows = of_preset.scene.rows;
        simulation.samples = of_preset.samples;
        simulation.validation_samples = of_preset.validation_samples;
        let RunSettings { inputs, training, .. } = preset.settings_in(noise);
        (settings.inputs, settings.training) = (inputs, training);
    }
    settings
}

/// Keeps to the preset that the settings followed `before` their noise changed: the best number of samples depends on it.
pub fn follow_preset(before: &RunSettings, settings: &mut RunSettings) {
    let noise = |settings: &RunSettings| settings.simulation().map(|simulation| simulation.scene.noise);
    if noise(before) != noise(settings)
        && let Some(preset) = preset_of(before)
    {
        *settings = with_preset(preset, settings);
    }
}

/// The ready-made scenes. All other settings of a scene are folded below them.
pub fn scene_choice_ui(ui: &mut Ui, scene: &mut Scene) {
    ui.add_space(space(1));
    // The preset decides which rows share a network.
    let [print, paper] = [opening_scene(), Scene::default()].map(|ready| Scene {
        rows: scene.rows,
        ..ready
    });
    let options = [
        (
            print,
            "Indenter's print",
            "Each sample is the print of a ball of 2 to 6 mm radius, pressed somewhere onto the surface: as a touch \
             would leave it.",
        ),
        (paper, "Paper's scene", glossary::RANDOM_NODES.hint),
    ];
    *scene = explained_options_ui(ui, "Ready-made scenes", &options, *scene, true).unwrap_or(*scene);
}
