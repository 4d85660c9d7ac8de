//! The middle of the Train view while a recording is imported: its columns, and the resulting samples.

use decoupler_core::{dataset::SplitBy, text::counted};
use decoupler_files::{export::format_number, import::Plan};
use eframe::egui::{Align, Layout, RichText, Sense, Ui, WidgetInfo, accesskit::Role};

use super::{checking::Checked, editor::RecordingEditor, files_section::FILES, options::bias};
use crate::window::{
    shared::{Effect, Shared, sentence},
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, dim_ui, ghost_button, note_ui, primary_button, scrolled_ui, section_heading_ui},
};

impl RecordingEditor {
    /// Shows the columns of the files with the samples below, or an invitation to open files.
    pub fn columns_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        /// Share of the height used by the samples, and its limits.
        const SAMPLES: (f32, f32, f32) = (0.2, space(28), space(48));
        let whole = ui.available_rect_before_wrap();
        if self.import.is_none() {
            card_ui(ui, whole, |ui| self.invitation_ui(ui, effects));
        } else {
            let height = (SAMPLES.0 * whole.height()).clamp(SAMPLES.1, SAMPLES.2);
            let (columns, samples) = whole.split_top_bottom_at_y(whole.bottom() - height);
            card_ui(ui, columns.with_max_y(columns.bottom() - space(2)), |ui| {
                ui.horizontal(|ui| {
                    ui.vertical(|ui| section_heading_ui(ui, "Columns"));
                    if shared.shown_run().is_some() {
                        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                            if ui.add(ghost_button("Show results")).clicked() {
                                self.shows_columns = false;
                                ui.request_repaint();
                            }
                        });
                    }
                });
                self.columns_table_ui(ui, shared.phase.is_busy());
            });
            card_ui(ui, samples, |ui| scrolled_ui(ui, "samples", |ui| self.samples_ui(ui)));
        }
        ui.allocate_rect(whole, Sense::hover());
    }

    fn invitation_ui(&mut self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        let dim = Theme::of(ui).palette.dim;
        ui.vertical_centered(|ui| {
            ui.add_space((0.5 * ui.available_height() - space(24)).max(space(2)));
            ui.label(RichText::new("Drop recordings here").font(semibold(type_size().title)));
            ui.add_space(space(2));
            ui.scope(|ui| {
                ui.set_max_width(space(120));
                let text = "Readings of a sensor with the targets measured at the same time, such as forces: one file, \
                            several that share a time, or several with the same columns. CSV and other text, Excel, \
                            .npy, .npz and .mat. The meaning of each \
                            column is suggested by its name and numbers, and can be changed.";
                ui.label(RichText::new(text).color(dim));
            });
            ui.add_space(space(3));
            let button = ui.add(primary_button("Open files…"));
            if button.on_hover_text(FILES.description).clicked() {
                effects.push(Effect::ChooseFile(self.open_task()));
            }
        });
    }

    fn samples_ui(&self, ui: &mut Ui) {
        section_heading_ui(ui, "Samples");
        let Some(import) = &self.import else { return };
        match &self.checking.checked {
            Some(Ok(checked)) => checked_ui(ui, checked, &import.plan),
            Some(Err(reason)) => {
                dim_ui(ui, &format!("There are no samples: {}", sentence(reason)));
            }
            None if self.checking.is_under_way() => {
                dim_ui(ui, "Checking the import…");
            }
            None => {}
        }
    }
}

fn checked_ui(ui: &mut Ui, checked: &Checked, plan: &Plan) {
    let [training, validation, test] = checked.samples;
    let facts = [
        ("Training", training, "Samples to which the network is fitted."),
        (
            "Validation",
            validation,
            "Samples that select the best weights and end the training.",
        ),
        ("Test", test, "Samples on which all errors are measured."),
    ];
    ui.horizontal(|ui| {
        let dim = Theme::of(ui).palette.dim;
        for (name, count, meaning) in facts {
            if (name, count) == ("Validation", 0) {
                continue;
            }
            ui.label(RichText::new(name).size(type_size().note).color(dim))
                .on_hover_text(meaning);
            let number = ui.label(count.to_string());
            number.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{name}: {count}")));
            ui.add_space(space(3));
        }
    });
    for file in &checked.files {
        let Some(join) = file.join else { continue };
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        let offset = join.median_offset.map_or_else(String::new, |offset| {
            format!(", median offset {}", format_number(offset.abs()))
        });
        let (limit, lost) = (format_number(join.limit), counted(join.without_partner, "row"));
        let text = format!(
            "{name} is joined by time within {limit}{offset}; {lost} without partner, {} of its rows unused.",
            join.unused
        );
        dim_ui(ui, &text);
    }
    for dropped in &checked.dropped {
        let (rows, reason, line) = (dropped.rows, &dropped.reason, dropped.first_line);
        let text = format!("{rows} of {} rows dropped: {reason} (first on line {line}).", checked.rows);
        dim_ui(ui, &text);
    }
    if let Some(positions) = &checked.positions {
        dim_ui(ui, &sentence(positions));
    }
    if plan.test.is_none() && plan.division.by == SplitBy::Random {
        note_ui(ui, bias(SplitBy::Random));
    }
    for warning in &checked.warnings {
        note_ui(ui, &sentence(warning));
    }
}
