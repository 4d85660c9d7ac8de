//! The training: its method, the rules that end it, and its restarts.

use decoupler_core::settings::Method;
use eframe::egui::Ui;

use super::{Fields, Look, Row, SetBy, number_ui};
use crate::window::widgets::{dim_ui, fields::capitalised, fold_ui};

pub(super) const METHOD: Row = Row(
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

const RESTARTS: Row = Row("starts", "Restarts", Look::Number(""));

const COMBINE: Row = Row(
    "combine",
    "Combine restarts",
    Look::Below(|| vec![("best", "keep the best"), ("mean", "average their answers")]),
);

/// The method, and what it does.
pub fn method_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    fields.show(ui, &[METHOD]);
    if let SetBy::User = fields.set_by {
        dim_ui(ui, fields.settings.training.method.summary());
    }
}

/// The largest number of epochs and the restarts; folded, the other rules that end the training and the settings of its method.
/// A paused training (`is_new` is false) keeps its restarts.
pub(super) fn training_ui(ui: &mut Ui, fields: &mut Fields<'_>, is_new: bool) {
    fields.show(ui, &[EPOCHS]);
    ui.add_enabled_ui(is_new, |ui| {
        fields.show(ui, &[RESTARTS]);
        if fields.settings.starts > 1 || matches!(fields.set_by, SetBy::Choice(_)) {
            fields.show(ui, &[COMBINE]);
        }
    });
    if let SetBy::User = fields.set_by {
        let method = fields.settings.training.method.short_name();
        fold_ui(ui, "Stopping and method", method, |ui| {
            fields.show(ui, &STOPPING);
            let method = &mut fields.settings.training.method;
            for setting in method.settings() {
                let texts = [&capitalised(setting.name), setting.help, ""];
                number_ui(ui, texts, setting, method, &fields.usual.training.method);
            }
        });
    }
}
