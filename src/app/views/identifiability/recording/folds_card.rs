use eframe::egui::{Grid, RichText, Ui, vec2};

use super::work::FoldsResult;
use crate::{
    app::{
        shared::sentence,
        theme::{Theme, semibold, space, type_size},
        widgets::{dim_ui, section_heading_ui},
    },
    export::error_table,
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
    let table = error_table(&validated.table);
    let palette = Theme::of(ui).palette;
    Grid::new("held-out errors")
        .spacing(vec2(space(4), space(1)))
        .show(ui, |ui| {
            for column in &table.columns {
                let heading = RichText::new(column.title()).font(semibold(type_size().note));
                ui.label(heading.color(palette.dim));
            }
            ui.end_row();
            for row in &table.rows {
                for cell in row {
                    ui.label(RichText::new(cell.rounded()).size(type_size().note));
                }
                ui.end_row();
            }
        });
    ui.add_space(space(1));
    for remark in &validated.remarks {
        ui.label(RichText::new(sentence(remark)).size(type_size().note));
    }
}
