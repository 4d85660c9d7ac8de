use eframe::egui::{CollapsingHeader, ComboBox, RichText, Slider, Stroke, Ui};

use super::{
    fields::{capitalised, count_ui, field_ui, input_text, quantity_ui},
    sensor_section::sensor_section_ui,
};
use crate::{
    app::{
        action::Action,
        state::{Phase, State},
        theme::{Theme, scrolled_ui, section_heading_ui, slider_style, space, type_size},
    },
    dataset::LARGEST_SAMPLES,
    evaluation::{MOST_STARTS, RunSettings},
    network::{HiddenSuggestions, LARGEST_HIDDEN, Shape},
    training::{Method, StoppingRules},
};

/// The settings of the next training, in the order of the pipeline.
pub fn configuration_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut draft = state.draft;
    scrolled_ui(ui, "configuration", |ui| {
        let is_busy = state.phase.is_busy();
        ui.add_enabled_ui(!is_busy, |ui| {
            sensor_section_ui(ui, &mut draft);
            scene_section_ui(ui, &mut draft);
            network_section_ui(ui, &mut draft);
        });
        // What is held can be continued with another method.
        ui.add_enabled_ui(!is_busy || state.phase == Phase::Paused, |ui| {
            training_section_ui(ui, &mut draft, !is_busy);
        });
        ui.add_enabled_ui(!is_busy, |ui| {
            ui.add_space(space(4));
            let is_default = draft == RunSettings::default();
            let reset = ui.add_enabled(!is_default, eframe::egui::Button::new("Back to the paper's settings"));
            if reset
                .on_hover_text("10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples")
                .clicked()
            {
                draft = RunSettings::default();
            }
            ui.add_space(space(4));
        });
    });
    if draft == state.draft {
        Vec::new()
    } else {
        vec![Action::Configure(Box::new(draft))]
    }
}

fn scene_section_ui(ui: &mut Ui, draft: &mut RunSettings) {
    section_heading_ui(ui, "Scene");
    let dim = Theme::of(ui).palette.dim;
    let text = "Every node of every row pressed down by a random amount, as in the paper";
    ui.label(RichText::new(text).size(type_size().note).color(dim));
    let mut percent = 100.0 * draft.scene.largest_compression;
    let hint = "The most a node is pressed down, in percent of the height.";
    if quantity_ui(ui, "Largest compression", hint, &mut percent, 0.001..=99.0, "%").changed() {
        draft.scene.largest_compression = percent / 100.0;
    }
    let rows = draft.sensor.scale.rows();
    let hint = format!("What the method fits; whole snapshots of {rows} rows are drawn.");
    count_ui(ui, "Training samples", &hint, &mut draft.samples, 1..=LARGEST_SAMPLES);
    let hint = "Drawn beside the training samples; they choose the best weights and stop the training. 0 for none.";
    count_ui(
        ui,
        "Validation samples",
        hint,
        &mut draft.validation_samples,
        0..=LARGEST_SAMPLES,
    );
    let hint = "Never trained on: all errors are measured here, and the snapshots shown are these.";
    count_ui(ui, "Test samples", hint, &mut draft.test_samples, 1..=LARGEST_SAMPLES);
    let hint = "Everything random follows from it: the same seed gives the same network.";
    field_ui(ui, "Seed", hint, |ui| {
        ui.add_sized(
            [space(16), space(6)],
            eframe::egui::DragValue::new(&mut draft.seed.0).speed(0.1),
        )
    });
}

fn network_section_ui(ui: &mut Ui, draft: &mut RunSettings) {
    section_heading_ui(ui, "Network");
    let hint = "Nodes of the tanh layer between resistances and coordinates.";
    count_ui(ui, "Hidden nodes", hint, &mut draft.hidden, 1..=LARGEST_HIDDEN);
    let scale = draft.sensor.scale;
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
    // Of the coordinates x varies with the row and z with the load; y never does.
    let varying_axes = if scale.rows() > 1 { 2 } else { 1 };
    let shape = Shape {
        inputs: n,
        hidden: draft.hidden,
        outputs: varying_axes * scale.nodes_per_row(),
    };
    let text = format!("{n} inputs, {} outputs, {} weights", shape.outputs, shape.weights());
    ui.label(RichText::new(text).size(type_size().note).color(dim))
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

fn training_section_ui(ui: &mut Ui, draft: &mut RunSettings, is_new: bool) {
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
            let hint = "Stop when the validation error has risen this often since it last fell. Default 6.";
            count_ui(
                ui,
                "Validation failures",
                hint,
                &mut stopping.max_fail,
                1..=StoppingRules::MOST_EPOCHS,
            );
        });
}
