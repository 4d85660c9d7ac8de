use eframe::egui::{RichText, Ui};

use super::work::FoldsResult;
use crate::window::{
    shared::{error_table_ui, sentence},
    theme::{space, type_size},
    widgets::{dim_ui, section_heading_ui},
};

/// Held-out errors of the cross-validation, and its remarks.
pub fn folds_ui(ui: &mut Ui, validated: &FoldsResult) {
    section_heading_ui(ui, "Cross-validation");
    dim_ui(
        ui,
        &format!(
            "{} samples, each tested by a network trained on the other folds: {}.",
            validated.samples, validated.folds
        ),
    );
    error_table_ui(ui, &validated.table);
    ui.add_space(space(1));
    for remark in &validated.remarks {
        ui.label(RichText::new(sentence(remark)).size(type_size().note));
    }
}
