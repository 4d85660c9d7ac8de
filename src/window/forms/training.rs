//! The training: its method, the rules that end it, and its restarts.

use decoupler_core::{settings::Method, text::counted};
use eframe::egui::Ui;

use super::{Fields, Look, Row, SetBy, number_ui};
use crate::window::widgets::{dim_ui, fields::capitalised, fold_ui};

const METHOD: Row = Row(
    "method",
    "Method",
    Look::Below(|| Vec::from(Method::all().map(|method| (method.short_name(), method.name())))),
);

const EPOCHS: Row = Row("epochs", "Epochs", Look::Number(""));

const STOPPING: [Row; 3] = [
    Row("max fail", "Validation failures", Look::Number("")),
    Row("goal", "Goal (mse)", Look::Number("")),
    Row("min gradient", "Smallest gradient", Look::Number("")),
];

const RESTARTS: [Row; 2] = [
    Row("starts", "Restarts", Look::Number("")),
    Row(
        "combine",
        "Combine restarts",
        Look::Below(|| vec![("best", "keep the best"), ("mean", "average their answers")]),
    ),
];

/// The method, and what it does.
pub fn method_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    fields.show(ui, &[METHOD]);
    if let SetBy::User = fields.set_by {
        dim_ui(ui, fields.settings.training.method.summary());
    }
}

/// The folded settings of the training. A paused one (`is_new` is false) keeps its restarts.
pub fn training_ui(ui: &mut Ui, fields: &mut Fields<'_>, is_new: bool) {
    let stopping = fields.summary(|settings| counted(settings.training.stopping.epochs, "epoch"));
    fold_ui(ui, "When to stop", &stopping, |ui| {
        fields.show(ui, &[EPOCHS]);
        if let SetBy::User = fields.set_by {
            fields.show(ui, &STOPPING);
        }
    });
    let restarts = fields.summary(|settings| counted(settings.starts, "restart"));
    fold_ui(ui, "Method settings", &restarts, |ui| {
        if let SetBy::User = fields.set_by {
            let method = &mut fields.settings.training.method;
            for setting in method.settings() {
                let texts = [&capitalised(setting.name), setting.help, ""];
                number_ui(ui, texts, setting, method, &fields.usual.training.method);
            }
        }
        ui.add_enabled_ui(is_new, |ui| fields.show(ui, &RESTARTS));
    });
}
