use eframe::egui::Ui;

use crate::window::{glossary, shared::opening_settings, theme::space, widgets::explained_options_ui};
use decoupler_core::{evaluation::SimulatedSettings, scene::Scene};

/// The scenes that stand ready, one click each; changes `draft`. Everything else about a scene is folded beneath them.
pub fn scene_choice_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    ui.add_space(space(1));
    // Which rows share a network is the preset's.
    let scene = &mut draft.source.scene;
    let [print, paper] = [opening_settings().source.scene, Scene::default()].map(|ready| Scene {
        rows: scene.rows,
        ..ready
    });
    let options = [
        (
            print,
            "Indenter's print",
            "Each sample is the print of a ball of 2 to 6 mm radius, pressed somewhere onto the surface: what a touch \
             looks like.",
        ),
        (paper, "Paper's scene", glossary::RANDOM_NODES.hint),
    ];
    if let Some(picked) = explained_options_ui(ui, "Ready scenes", &options, *scene, true) {
        *scene = picked;
    }
}
