//! The middle of the Train view while a recording is imported: its columns, and the resulting samples.

use eframe::egui::{RichText, Sense, Ui};

use super::{checking::Checked, editor::RecordingEditor};
use crate::window::{
    glossary,
    shared::{Command, Effect, Shared, sentence},
    theme::{semibold, space, type_size},
    widgets::{card_ui, dim_ui, ghost_button, invitation_ui, note_ui, scrolled_ui, section_heading_ui},
};

const INVITATION: &str = "Readings of a sensor with the targets measured at the same time, such as forces: one file, several that \
                          share a time, or several with the same columns. CSV and other text, Excel, .npy, .npz and .mat. \
                          The meaning of each column is suggested by its name and numbers, and can be changed.";

const SELECTING: &str = "Click a name to select a column, or all of a file; with Shift a range, with Ctrl several. A meaning chosen in one \
                         is given to all.";

impl RecordingEditor {
    /// Shows the columns of the files with the samples below, or an invitation to open files.
    pub fn columns_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        /// Share of the height used by the samples, and its limits.
        const SAMPLES: (f32, f32, f32) = (0.2, space(28), space(48));
        let whole = ui.available_rect_before_wrap();
        if self.import.is_none() {
            card_ui(ui, whole, |ui| {
                ui.label(RichText::new("Drop recordings here").font(semibold(type_size().title)));
                if invitation_ui(ui, INVITATION, "Open files…", true) {
                    effects.push(Effect::Do(Command::OpenFiles));
                }
            });
        } else {
            let height = (SAMPLES.0 * whole.height()).clamp(SAMPLES.1, SAMPLES.2);
            let (columns, samples) = whole.split_top_bottom_at_y(whole.bottom() - height);
            card_ui(ui, columns.with_max_y(columns.bottom() - space(2)), |ui| {
                section_heading_ui(ui, "Columns");
                dim_ui(ui, SELECTING);
                self.columns_table_ui(ui, shared.phase.is_busy());
            });
            card_ui(ui, samples, |ui| {
                scrolled_ui(ui, "samples", |ui| {
                    section_heading_ui(ui, "Samples");
                    if let Some(checked) = self.reading.checked() {
                        checked_ui(ui, checked);
                    }
                    for fix in &self.fixes {
                        let button = ui.add_enabled(!shared.phase.is_busy(), ghost_button(&fix.button));
                        if button.on_hover_text(&fix.problem).clicked() {
                            effects.extend(fix.effects(shared));
                        }
                    }
                });
            });
        }
        ui.allocate_rect(whole, Sense::hover());
    }
}

fn checked_ui(ui: &mut Ui, checked: &Checked) {
    const SETS: [(&str, glossary::Term); 3] = [
        ("Training", glossary::TRAINING_SET),
        ("Validation", glossary::VALIDATION_SET),
        ("Test", glossary::TEST_SET),
    ];
    ui.horizontal(|ui| {
        for ((name, meaning), count) in SETS.into_iter().zip(checked.samples) {
            if (name, count) != ("Validation", 0) {
                ui.label(format!("{name}: {count}")).on_hover_text(meaning.hint);
                ui.add_space(space(3));
            }
        }
    });
    for fact in &checked.facts {
        dim_ui(ui, fact);
    }
    for warning in &checked.warnings {
        note_ui(ui, &sentence(warning));
    }
}
