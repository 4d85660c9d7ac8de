use eframe::egui::Ui;

use crate::window::{theme::space, widgets::explained_options_ui};
use decoupler_core::{
    evaluation::{Preset, SimulatedSettings, Simulation},
    scene::Scene,
};

/// Shows the presets on which the settings are based; changes `draft`.
pub fn preset_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    ui.add_space(space(2));
    let options = [
        (
            Some(Preset::Paper),
            "Paper",
            "One network for all rows, resistances between −1 and 1, 1000 training samples.\n\nArray, axes, loading, \
             noise, hidden nodes and seed stay as they are.",
        ),
        (
            Some(Preset::Best),
            "Best",
            "A small network for each known row, whitened conductances, 5000 training samples, or 50 000 if the \
             readings are noisy.\n\nChosen by measurement: of all and known rows, resistance, conductance and its \
             logarithm, min-max and whitening, this has the lowest test error for the same hidden nodes.\n\nArray, \
             axes, loading, noise, hidden nodes and seed stay as they are.",
        ),
    ];
    if let Some(Some(picked)) = explained_options_ui(ui, "Preset", &options, present(draft), true) {
        *draft = applied(picked, draft);
    }
}

/// The preset that `draft` follows, if any.
pub fn present(draft: &SimulatedSettings) -> Option<Preset> {
    Preset::ALL.into_iter().find(|&preset| applied(preset, draft) == *draft)
}

/// `draft` with what `preset` decides: how readings are decoded and trained on, not what happens to the sensor.
pub fn applied(preset: Preset, draft: &SimulatedSettings) -> SimulatedSettings {
    let settings = preset.settings_in(draft.source.scene.noise);
    SimulatedSettings {
        source: Simulation {
            sensor: draft.source.sensor,
            scene: Scene {
                rows: settings.source.scene.rows,
                ..draft.source.scene
            },
            test_samples: draft.source.test_samples,
            ..settings.source
        },
        hidden: draft.hidden,
        starts: draft.starts,
        seed: draft.seed,
        ..settings
    }
}
