//! Presets of a simulated array.

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Preset, RunSettings},
    sensor::SensorModel,
};
use eframe::egui::Ui;

use crate::window::{shared::opening_settings, widgets::fields::list_ui};

/// Returns the settings with those of a preset; the scale of the array is kept.
type Change = fn(&RunSettings) -> RunSettings;

/// Name, hint and settings of each preset.
const PRESETS: [(&str, &str, Change); 3] = [
    (
        "Press demo",
        "Each sample is the print of a ball of 2 to 6 mm radius, pressed somewhere onto the surface and read with 0.1 % noise: \
         as a touch would leave it. Everything else is as in the paper. The array scale stays as it is.",
        |settings| with_scale_of(settings, opening_settings()),
    ),
    (
        "Paper",
        "Scene, network and training of the paper: every node pressed by a random depth, no noise, one network for all rows, \
         resistances between −1 and 1, 1000 training samples. The array scale stays as it is.",
        |settings| with_scale_of(settings, RunSettings::default()),
    ),
    (
        "Best accuracy",
        "A small network for each known row, whitened conductances, 5000 training samples, or 50 000 if the readings are \
         noisy: by measurement, the lowest test error for the same hidden nodes. Array, axes, loading, noise, hidden nodes \
         and seed stay as they are.",
        with_best,
    ),
];

/// The list of presets.
pub fn preset_ui(ui: &mut Ui, settings: &mut RunSettings) {
    let presets = PRESETS.map(|(name, hint, change)| (change(settings), name, hint));
    let hint = "Settings that go together. Each can be changed afterwards.";
    *settings = list_ui(ui, "Preset", hint, &presets, *settings).unwrap_or(*settings);
}

fn with_scale_of(settings: &RunSettings, mut preset: RunSettings) -> RunSettings {
    if let (Some(simulation), Some(Simulation { sensor, .. })) = (settings.simulation(), preset.simulation_mut()) {
        *sensor = SensorModel::new(simulation.sensor.scale);
    }
    preset
}

fn with_best(settings: &RunSettings) -> RunSettings {
    let mut settings = *settings;
    if let Some(simulation) = settings.simulation_mut() {
        let noise = simulation.scene.noise;
        let best = Preset::Best.simulation_in(noise);
        simulation.scene.rows = best.scene.rows;
        (simulation.samples, simulation.validation_samples) = (best.samples, best.validation_samples);
        let RunSettings { inputs, training, .. } = Preset::Best.settings_in(noise);
        (settings.inputs, settings.training) = (inputs, training);
    }
    settings
}

/// Keeps to the best accuracy if the settings did so `before` their noise changed: the best number of samples depends on it.
pub fn follow_preset(before: &RunSettings, settings: &mut RunSettings) {
    let noise = |settings: &RunSettings| settings.simulation().map(|simulation| simulation.scene.noise);
    if noise(before) != noise(settings) && with_best(before) == *before {
        *settings = with_best(settings);
    }
}

/// Returns the name of the preset that leads from one of the settings to the other, if one does.
pub fn preset_between(before: &RunSettings, after: &RunSettings) -> Option<&'static str> {
    let preset = PRESETS.iter().find(|(.., change)| change(before) == *after);
    preset.map(|(name, ..)| *name)
}
