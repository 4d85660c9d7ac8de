use eframe::egui::{ComboBox, RichText, Ui};

use crate::window::{
    glossary,
    theme::{Theme, space, type_size},
    widgets::fields::{capitalised, count_ui, input_text, quantity_ui, usually},
};
use decoupler_core::{
    evaluation::MAX_STARTS,
    training::{Method, StoppingRules},
};

/// The choice of the method; changes `method`.
pub fn method_choice_ui(ui: &mut Ui, method: &mut Method) {
    // The longest names fill a line.
    let label = ui.label("Method").on_hover_text(glossary::METHOD.hint);
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
}

/// The settings of the chosen method and the number of starts; changes both. A training that is held (`is_new` is false)
/// keeps its starts.
pub fn method_settings_ui(ui: &mut Ui, method: &mut Method, starts: &mut usize, is_new: bool) {
    for setting in method.settings() {
        let hint = format!("{} Default {}.", setting.meaning, input_text(setting.default));
        let limits = usually(setting.default, setting.range);
        quantity_ui(ui, &capitalised(setting.name), &hint, setting.value, limits, "");
        if setting.is_whole {
            *setting.value = setting.value.round();
        }
    }
    let hint = format!("{} Default 1.", glossary::STARTS.hint);
    ui.add_enabled_ui(is_new, |ui| {
        count_ui(ui, "Starts", &hint, starts, usually(1, 1..=MAX_STARTS))
    });
}

/// The rules that end a training; changes `stopping`.
pub fn stopping_ui(ui: &mut Ui, stopping: &mut StoppingRules) {
    let usual = StoppingRules::default();
    let hint = format!(
        "Largest number of epochs. {} Train counts from the first epoch, Continue from the current one.",
        glossary::EPOCH.hint
    );
    count_ui(
        ui,
        "Epochs",
        &hint,
        &mut stopping.epochs,
        usually(usual.epochs, 1..=StoppingRules::MAX_EPOCHS),
    );
    let hint = format!("{} Default 6.", glossary::VALIDATION_FAILURES.hint);
    count_ui(
        ui,
        "Validation failures",
        &hint,
        &mut stopping.max_fail,
        usually(usual.max_fail, 1..=StoppingRules::MAX_EPOCHS),
    );
    let hint = format!(
        "Training error at which training ends. Default 0.\n\n{}",
        glossary::MSE.hint
    );
    quantity_ui(
        ui,
        "Goal (mse)",
        &hint,
        &mut stopping.goal_mse,
        usually(usual.goal_mse, 0.0..=1e300),
        "",
    );
    let hint = format!(
        "Norm of the gradient below which training ends. Default 1e-7.\n\n{}",
        glossary::GRADIENT.hint
    );
    quantity_ui(
        ui,
        "Smallest gradient",
        &hint,
        &mut stopping.min_gradient,
        usually(usual.min_gradient, 0.0..=1e300),
        "",
    );
}
