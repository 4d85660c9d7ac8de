use eframe::egui::{CollapsingHeader, ComboBox, RichText, Ui};

use super::{
    network_section::network_section_ui,
    preset_section::{applied, present, preset_section_ui},
    scene_section::{samples_section_ui, scene_section_ui},
    sensor_section::sensor_section_ui,
};
use crate::{
    app::{
        shared::{Effect, Phase, Shared},
        theme::{Theme, space, type_size},
        views::train::paper_figure::PaperFigure,
        widgets::{
            fields::{capitalised, count_ui, input_text, quantity_ui},
            ghost_button, scrolled_ui, section_heading_ui,
        },
    },
    evaluation::{MOST_STARTS, Outlook, SimulatedSettings},
    training::{Method, StoppingRules},
};

/// The settings of the next training, in the order of the pipeline.
/// Returns the paper's figure that is to be shown, if the user said so.
pub fn configuration_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<PaperFigure> {
    let mut draft = shared.draft;
    let mut picked = None;
    scrolled_ui(ui, "configuration", |ui| {
        let is_busy = shared.phase.is_busy();
        ui.add_enabled_ui(!is_busy, |ui| preset_section_ui(ui, &mut draft));
        let followed = present(&draft);
        ui.add_enabled_ui(!is_busy && shared.phase != Phase::Died, |ui| {
            picked = paper_section_ui(ui);
        });
        ui.add_enabled_ui(!is_busy, |ui| {
            sensor_section_ui(ui, &mut draft);
            let noise = draft.source.scene.noise;
            scene_section_ui(ui, &mut draft, outlook(shared));
            // How many samples are best depends on whether there is noise.
            if let Some(preset) = followed.filter(|_| draft.source.scene.noise != noise) {
                draft = applied(preset, &draft);
            }
            samples_section_ui(ui, &mut draft);
            network_section_ui(ui, &mut draft);
        });
        // What is held can be continued with another method.
        ui.add_enabled_ui(!is_busy || shared.phase == Phase::Paused, |ui| {
            training_section_ui(ui, &mut draft, !is_busy);
        });
        ui.add_enabled_ui(!is_busy, |ui| {
            ui.add_space(space(4));
            let is_default = draft == SimulatedSettings::default();
            let reset = ui.add_enabled(!is_default, eframe::egui::Button::new("Back to the paper's settings"));
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

/// What can be hoped for in the scene of the draft, where that is known.
fn outlook(shared: &Shared) -> Option<&Outlook> {
    let (settings, test) = match (&shared.preview, &shared.run) {
        (Some(preview), _) => (&preview.settings, &preview.test),
        (None, Some(run)) => (&run.settings, &run.test),
        (None, None) => return None,
    };
    let is_same =
        (settings.source.sensor, settings.source.scene) == (shared.draft.source.sensor, shared.draft.source.scene);
    test.outlook.as_ref().filter(|_| is_same)
}

/// The paper's figures of single networks, one click each.
fn paper_section_ui(ui: &mut Ui) -> Option<PaperFigure> {
    section_heading_ui(ui, "The paper's figures");
    // So small that the names fit in the narrowest window.
    let gap = space(1);
    let mut picked = None;
    let count = PaperFigure::ALL.len() as f32;
    let width = (ui.available_width() - gap * (count - 1.0)) / count;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = gap;
        for figure in PaperFigure::ALL {
            let button = ghost_button(figure.name()).min_size([width, space(7)].into());
            if ui.add(button).on_hover_text(figure.description()).clicked() {
                picked = Some(figure);
            }
        }
    });
    picked
}

fn training_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings, is_new: bool) {
    section_heading_ui(ui, "Training");
    let hint = "Trainings from different random weights, side by side; the best by validation error is kept. One run of \
                a random start proves little: several show how the results spread. Seeds are derived. Default 1.";
    ui.add_enabled_ui(is_new, |ui| {
        count_ui(ui, "Starts", hint, &mut draft.starts, 1..=MOST_STARTS)
    });
    let method = &mut draft.training.method;
    // The longest names fill a line.
    let label = ui.label("Method").on_hover_text("How the weights are improved.");
    let combo = ComboBox::from_id_salt("method")
        .selected_text(method.name())
        .width(ui.available_width())
        .height(space(90));
    let shown = combo.show_ui(ui, |ui| {
        for option in Method::all() {
            let is_selected = option.short_name() == method.short_name();
            let choice = ui
                .selectable_label(is_selected, option.name())
                .on_hover_text(option.description());
            if choice.clicked() && !is_selected {
                *method = option;
            }
        }
    });
    shown.response.labelled_by(label.id);
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(method.description()).size(type_size().note).color(dim));
    for setting in method.settings() {
        let hint = format!("{} Default {}.", setting.meaning, input_text(setting.default));
        quantity_ui(ui, &capitalised(setting.name), &hint, setting.value, setting.range, "");
    }
    let stopping = &mut draft.training.stopping;
    let hint = "The most epochs, passes over the training set: Train counts them from the start, Continue from where the \
                training stands.";
    count_ui(ui, "Epochs", hint, &mut stopping.epochs, 1..=StoppingRules::MOST_EPOCHS);
    CollapsingHeader::new("When to stop earlier")
        .id_salt("stopping")
        .show(ui, |ui| {
            let hint = "Training error (mse of the scaled coordinates) that is good enough. Default 0.";
            quantity_ui(ui, "Goal (mse)", hint, &mut stopping.goal_mse, 0.0..=1e300, "");
            let hint = "Stop when the gradient is shorter than this. Default 1e-7.";
            quantity_ui(
                ui,
                "Smallest gradient",
                hint,
                &mut stopping.min_gradient,
                0.0..=1e300,
                "",
            );
            let hint = "Training ends after this many epochs without a new best validation error. Default 6.";
            count_ui(
                ui,
                "Validation failures",
                hint,
                &mut stopping.max_fail,
                1..=StoppingRules::MOST_EPOCHS,
            );
        });
}
