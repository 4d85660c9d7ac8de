use eframe::egui::Ui;

use super::{
    choices::{array_choice_ui, hidden_choice_ui},
    network_section::inputs_ui,
    preset_section::{applied, present, preset_section_ui},
    scene_choice::scene_choice_ui,
    scene_section::{outlook_notes_ui, samples_section_ui, scene_section_ui},
    sensor_section::geometry_ui,
    summaries,
};
use crate::{
    app::{
        shared::{Effect, Phase, Shared, method_choice_ui, method_settings_ui, stopping_ui},
        theme::space,
        views::train::paper_figure::PaperFigure,
        widgets::{Landmark, fold_ui, ghost_button, scrolled_ui},
    },
    evaluation::{Outlook, SimulatedSettings},
};

/// The settings of the next training. Returns the paper's figure that is to be shown, if the user said so.
pub fn configuration_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<PaperFigure> {
    let mut draft = shared.draft;
    let mut picked = None;
    scrolled_ui(ui, "configuration", |ui| {
        let is_busy = shared.phase.is_busy();
        // What is held can be continued with another method.
        let is_held = shared.phase == Phase::Paused;
        let scene = draft.source.scene;
        let followed = present(&draft);
        ui.add_space(space(2));
        let top = ui.cursor().top();
        ui.add_enabled_ui(!is_busy, |ui| {
            array_choice_ui(ui, &mut draft.source.sensor.scale);
            hidden_choice_ui(ui, &mut draft);
        });
        ui.add_enabled_ui(!is_busy || is_held, |ui| {
            method_choice_ui(ui, &mut draft.training.method);
        });
        Landmark::Choices.stands_at(ui, ui.min_rect().with_min_y(top));
        ui.add_enabled_ui(!is_busy, |ui| {
            preset_section_ui(ui, &mut draft);
            scene_choice_ui(ui, &mut draft);
            ui.add_space(space(2));
            ui.separator();
            outlook_notes_ui(ui, &draft, outlook(shared));
            fold_ui(ui, "Scene", &summaries::of_scene(&draft), |ui| {
                scene_section_ui(ui, &mut draft, outlook(shared));
            });
            // How many samples are best depends on whether there is noise.
            if let Some(preset) = followed.filter(|_| draft.source.scene.noise != scene.noise) {
                draft = applied(preset, &draft);
            }
            fold_ui(ui, "Samples", &summaries::of_samples(&draft), |ui| {
                samples_section_ui(ui, &mut draft);
            });
            let geometry = summaries::of_geometry(&draft.source.sensor.geometry);
            fold_ui(ui, "Geometry", &geometry, |ui| geometry_ui(ui, &mut draft));
            fold_ui(ui, "Network inputs", &summaries::of_inputs(&draft), |ui| {
                inputs_ui(ui, &mut draft);
            });
        });
        ui.add_enabled_ui(!is_busy || is_held, |ui| {
            fold_ui(ui, "When to stop", &summaries::of_stopping(&draft), |ui| {
                stopping_ui(ui, &mut draft.training.stopping);
            });
            fold_ui(ui, "Method settings", &summaries::of_method(&draft), |ui| {
                method_settings_ui(ui, &mut draft.training.method, &mut draft.starts, !is_busy);
            });
        });
        ui.add_enabled_ui(!is_busy && shared.phase != Phase::Died, |ui| {
            fold_ui(ui, "Figures of the paper", "", |ui| picked = paper_section_ui(ui));
        });
        ui.add_enabled_ui(!is_busy, |ui| {
            ui.add_space(space(4));
            let is_default = draft == SimulatedSettings::default();
            let reset = ui.add_enabled(!is_default, eframe::egui::Button::new("Reset to the paper's settings"));
            if reset
                .on_hover_text("10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples")
                .clicked()
            {
                draft = SimulatedSettings::default();
            }
            ui.add_space(space(4));
        });
    });
    if draft != shared.draft {
        effects.push(Effect::Configure(Box::new(draft)));
    }
    picked
}

/// Returns the outlook of the scene of the draft, where it is known.
fn outlook(shared: &Shared) -> Option<&Outlook> {
    let (settings, test) = match (&shared.preview, &shared.run) {
        (Some(preview), _) => (preview.settings, &preview.test),
        (None, Some(run)) => (run.simulated()?, run.test.array()?),
        (None, None) => return None,
    };
    let is_same =
        (settings.source.sensor, settings.source.scene) == (shared.draft.source.sensor, shared.draft.source.scene);
    test.outlook.as_ref().filter(|_| is_same)
}

/// The paper's figures of single networks, one click each.
fn paper_section_ui(ui: &mut Ui) -> Option<PaperFigure> {
    const GAP: f32 = space(1);
    let mut picked = None;
    let width = 0.5 * (ui.available_width() - GAP);
    ui.spacing_mut().item_spacing = [GAP, GAP].into();
    for pair in PaperFigure::ALL.chunks(2) {
        ui.horizontal(|ui| {
            for figure in pair {
                let button = ghost_button(figure.name()).min_size([width, space(7)].into());
                if ui.add(button).on_hover_text(figure.description()).clicked() {
                    picked = Some(*figure);
                }
            }
        });
    }
    picked
}
