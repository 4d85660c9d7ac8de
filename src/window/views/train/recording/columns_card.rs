//! The middle of the Train view while a recording is imported: its columns, and the resulting samples.
//!
//! It also words the notes about splits and the errors of imports.

use std::{collections::BTreeMap, path::Path};

use decoupler_core::{dataset::SplitBy, text::counted};
use decoupler_files::{
    export::format_number,
    import::{Condition, Cure, ImportError, InspectedFile},
};
use eframe::egui::{Align, Layout, RichText, Sense, Ui, WidgetInfo, accesskit::Role};

use super::{
    draft::{Draft, joined, missing},
    editor::RecordingEditor,
    files_section::FILES,
    opening::Checked,
};
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
        if self.draft.is_none() {
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

    fn invitation_ui(&self, ui: &mut Ui, effects: &mut Vec<Effect>) {
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
            if ui
                .add(primary_button("Open files…"))
                .on_hover_text(FILES.description)
                .clicked()
            {
                effects.push(Effect::ChooseFile(self.open_task()));
            }
        });
    }

    fn samples_ui(&self, ui: &mut Ui) {
        section_heading_ui(ui, "Samples");
        let Some(draft) = &self.draft else { return };
        match &self.checking.checked {
            Some(Ok(checked)) => checked_ui(ui, checked, draft),
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

fn checked_ui(ui: &mut Ui, checked: &Checked, draft: &Draft) {
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
        dim_ui(
            ui,
            &format!(
                "{name} is joined by time within {}{offset}; {} without partner, {} of its rows unused.",
                format_number(join.limit),
                counted(join.without_partner, "row"),
                join.unused
            ),
        );
    }
    for dropped in &checked.dropped {
        dim_ui(
            ui,
            &format!(
                "{} of {} rows dropped: {} (first on line {}).",
                dropped.rows, checked.rows, dropped.reason, dropped.first_line
            ),
        );
    }
    if let Some(positions) = &checked.positions {
        dim_ui(ui, &sentence(positions));
    }
    if !draft.has_tests() && draft.plan.division.by == SplitBy::Random {
        note_ui(ui, bias(SplitBy::Random));
    }
    for warning in &checked.warnings {
        note_ui(ui, &sentence(warning));
    }
}

/// New full names of columns: the columns of a joined file have its stem in front, those of the first file have none.
#[derive(Debug)]
pub(super) struct Renaming(BTreeMap<String, String>);

impl Renaming {
    /// The names that change when `older` files are read with these stems; `None` is that of the first file.
    pub(super) fn new<'a>(older: &[InspectedFile], stems: impl Iterator<Item = (&'a Path, Option<&'a str>)>) -> Self {
        let mut names = BTreeMap::new();
        for (path, stem) in stems {
            let Some(file) = older.iter().find(|file| file.path == path) else {
                continue;
            };
            if file.stem.as_deref() == stem {
                continue;
            }
            for (column, summary) in file.columns.iter().enumerate() {
                let name = match stem {
                    None => summary.name.clone(),
                    Some(stem) => format!("{stem}.{}", summary.name),
                };
                names.insert(file.full_name(column), name);
            }
        }
        Self(names)
    }

    /// Returns the conditions as typed, with the new names. A text that is not a condition yet is unchanged.
    pub(super) fn conditions(&self, text: &str) -> String {
        match text.parse::<Condition>() {
            Ok(condition) if !self.0.is_empty() => condition.renamed(|name| self.0.get(name).cloned()).to_string(),
            _ => text.to_owned(),
        }
    }

    /// Returns the missing-cell markers as typed, with the new names.
    pub(super) fn missing(&self, text: &str) -> String {
        if self.0.is_empty() {
            return text.to_owned();
        }
        let mut items = missing(text);
        for column in items.iter_mut().filter_map(|item| item.column.as_mut()) {
            if let Some(name) = self.0.get(column) {
                column.clone_from(name);
            }
        }
        joined(&items, ", ")
    }
}

/// Returns a sentence on the bias of test errors by a rule of division.
pub(in crate::window::views::train) fn bias(by: SplitBy) -> &'static str {
    match by {
        SplitBy::Time => "The last part of the recording is held out for testing.",
        SplitBy::Group => "Whole groups are held out for testing: no press or session is in two sets.",
        SplitBy::Random => {
            "A random split is optimistic when neighbouring rows are similar. Compare with a split by group, or by time \
             if there are no groups."
        }
    }
}

/// Returns an error of the import, with the remedy in terms of the window.
pub(super) fn in_window(error: &ImportError) -> String {
    error.with_cure(|cure| match cure {
        Cure::CallMissing(text) => {
            format!("correct it, or add it to the missing cells under “Filter”: \"{text}\"")
        }
        Cure::NameTimes => "make the columns of their times “time” in both".to_owned(),
        Cure::NameJoinedTime => "make the column of its times “time”".to_owned(),
        Cure::GiveLimit => "give the limit under “Joined files”".to_owned(),
        Cure::GiveJoinedFiles => "open the joined files of each recording and of the test too".to_owned(),
        other => other.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use decoupler_files::import::{Joined, Recipe};

    use super::*;

    fn recipe() -> Recipe {
        Recipe {
            data: "one.csv".into(),
            inputs: vec!["a".to_owned()],
            targets: vec!["b".to_owned()],
            ..Recipe::default()
        }
    }

    fn error(one: &str, other: Option<&str>, recipe: Recipe) -> String {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("one.csv"), one).unwrap();
        std::fs::write(folder.path().join("two.csv"), other.unwrap_or_default()).unwrap();
        let watch = &mut |_| std::ops::ControlFlow::Continue(());
        let imported: Result<_, ImportError> = recipe.import(Path::new(folder.path()), watch);
        in_window(&imported.unwrap_err())
    }

    #[test]
    fn errors_of_the_import_name_no_argument_of_the_terminal() {
        let joined = |time: Option<&str>| Recipe {
            join: vec![Joined {
                file: "two.csv".into(),
                time: time.map(str::to_owned),
                ..Joined::default()
            }],
            ..recipe()
        };
        let timed = |time| Recipe {
            time: Some("t".to_owned()),
            ..joined(time)
        };
        let cases = [
            error("a,b\n1,bad\n2,3\n", None, recipe()),
            error("a,b\n1,2\n2,3\n", Some("c\n1\n"), joined(None)),
            error("t,a,b\n1,1,2\n2,2,3\n", Some("c\n1\n"), timed(Some("s"))),
            error("t,a,b\n1,1,2\n2,2,3\n", Some("s,c\n1,1\n1,2\n"), timed(Some("s"))),
        ];
        for text in cases {
            assert!(
                !text.contains("--") && (text.contains("“") || text.contains("“Filter”")),
                "{text}"
            );
        }
    }
}
