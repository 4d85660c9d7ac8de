//! The files of a recording in the form, including those that are missing or have changed since a run was saved.

use std::{iter::once, path::PathBuf};

use decoupler_core::text::counted;
use decoupler_files::{
    export::RecipeFile,
    import::{FileSet, Format, Plan},
};
use eframe::egui::{Align, Label, Layout, Ui, WidgetInfo, accesskit::Role, vec2};

use super::{
    editor::{RecordingEditor, Use},
    import::{Import, file_name},
    reading::State,
};
use crate::window::{
    shared::{Command, Effect, FileTask, FileWords, Shared, file_stem, sentence},
    theme::space,
    widgets::{dim_ui, ghost_button, note_ui, progress_bar_ui, section_heading_ui},
};

/// Files that can be opened.
pub(super) const FILES: FileWords = FileWords {
    kind: "recording",
    description: "A table of readings and targets (CSV or other text, Excel, .npy, .npz, .mat), a recipe, a network or a \
                  checkpoint. A table with the header target,x,y says where each target lies on the skin, in millimetres: \
                  then surfaces are shown.",
    extensions: &{
        let mut all = ["json"; Format::EXTENSIONS.len() + 2];
        all.split_at_mut(Format::EXTENSIONS.len())
            .0
            .copy_from_slice(&Format::EXTENSIONS);
        all[Format::EXTENSIONS.len() + 1] = "checkpoint";
        all
    },
};

impl RecordingEditor {
    /// Shows the files of the recording, and opens and closes them.
    pub fn files_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        section_heading_ui(ui, "Files");
        // Above the list, which grows and shrinks.
        self.buttons_ui(ui, effects);
        self.missing_ui(ui, effects);
        if let Some(path) = self.import.as_ref().and_then(|import| open_files_ui(ui, import)) {
            self.close(&path);
        }
        for name in &self.changed {
            note_ui(ui, &format!("{name} has changed since the run was saved."));
        }
        self.samples_line_ui(ui);
        if let State::Opening { names, progress, .. } = &self.reading.state {
            dim_ui(ui, &format!("Reading {names}…"));
            let share = progress.and_then(|progress| Some(progress.bytes as f32 / progress.of?.max(1) as f32));
            if let Some(share) = share {
                progress_bar_ui(ui, "Reading", share, &format!("{:.0} %", 100.0 * share));
            }
        }
        if self.is_empty() {
            let button = ui.add(ghost_button("Open the sample recording"));
            let hint = "Simulated readings of a soft skin with the force on it and its position: a recording for \
                        trying out the program.";
            if button.on_hover_text(hint).clicked() {
                let data_folder = shared.runs.path.as_ref().and_then(|runs| runs.parent());
                let folder = data_folder.map_or_else(std::env::temp_dir, PathBuf::from);
                self.open_sample(folder.join("samples"));
            }
        }
    }

    /// Lists the missing files, each with a button to find it.
    fn missing_ui(&mut self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        let Some(reopened) = &self.missing else { return };
        let is_training = reopened.checkpoint.is_some();
        for path in reopened.missing.clone() {
            let name = file_name(&path);
            note_ui(ui, &format!("{name} is missing.")).on_hover_text(path.display().to_string());
            let find = ui.add(ghost_button("Find…"));
            find.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Find {name}")));
            let find = find.on_hover_text("Choose the file in its new place. Its contents are checked.");
            if find.clicked() {
                effects.push(Effect::ChooseFile(self.ask(Use::Missing(path), name)));
            }
        }
        if is_training {
            dim_ui(ui, "The training is resumed once its recording is found.");
        }
    }

    /// Shows the numbers of channels and samples, or the error of the import.
    fn samples_line_ui(&self, ui: &mut Ui) {
        let Some(import) = &self.import else { return };
        let (inputs, targets) = self.channels().unwrap_or_default();
        let channels = format!("{}, {}", counted(inputs, "input"), counted(targets, "target"));
        match (import.obstacle(), &self.reading.state) {
            (Some(reason), _) => drop(note_ui(ui, &sentence(&reason))),
            (None, State::Checked(Err(reason))) => drop(note_ui(ui, &sentence(reason))),
            (None, State::Checked(Ok(checked))) => {
                let samples = counted(checked.samples.iter().sum::<usize>(), "sample");
                dim_ui(ui, &format!("{channels}, {samples}"));
            }
            (None, State::Checking) => drop(dim_ui(ui, &format!("{channels}, checking the import…"))),
            (None, _) => {}
        }
    }

    fn buttons_ui(&mut self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        ui.horizontal_wrapped(|ui| {
            let text = if self.import.is_some() {
                "Add file…"
            } else {
                "Open file…"
            };
            let open = ghost_button(text).min_size(vec2(space(22), space(7)));
            if ui.add(open).on_hover_text(FILES.description).clicked() {
                effects.push(Effect::Do(Command::OpenFiles));
            }
            if self.reading.is_opening() {
                if ui.add(ghost_button("Cancel")).clicked() {
                    self.reading.cancel();
                }
            } else if !self.is_empty() {
                let clear = ui.add(ghost_button("Clear"));
                if clear.on_hover_text("Closes all files, which can be undone.").clicked() {
                    self.clear();
                }
            } else if self.cleared.is_some() {
                let undo = ui.add(ghost_button("Undo: Clear"));
                if undo
                    .on_hover_text("Brings back the files and the meanings of their columns.")
                    .clicked()
                {
                    self.undo_clear();
                }
            }
        });
    }

    /// Shows the button that displays the columns in place of the results, or the results again.
    pub fn columns_button_ui(&mut self, ui: &mut Ui, shared: &Shared) {
        let is_on_show = self.is_on_show(shared);
        if self.import.is_none() || (is_on_show && shared.shown_run().is_none()) {
            return;
        }
        let text = if is_on_show { "Show results" } else { "Columns…" };
        let hint = "Shows the columns of the files and their meanings in place of the results, or the results again.";
        if ui.add(ghost_button(text)).on_hover_text(hint).clicked() {
            self.hidden = shared.run.as_ref().map(|run| run.id).filter(|_| !is_on_show);
            ui.request_repaint();
        }
    }
}

/// Lists the open files. Returns the one to be closed.
fn open_files_ui(ui: &mut Ui, import: &Import) -> Option<PathBuf> {
    let Plan {
        import: recipe, test, ..
    } = &*import.plan;
    let joined = recipe.join.iter().map(|joined| (&joined.file, ", joined"));
    let appended = recipe.append.iter().map(|set| (&set.data, ", appended"));
    let of_test = test
        .iter()
        .flat_map(FileSet::files)
        .map(|path| (path, ", for the test"));
    let positions = recipe.positions.iter().map(|path| (path, ", positions"));
    let files = once((&recipe.data, "")).chain(joined).chain(appended);
    let mut closed = None;
    for (path, what) in files.chain(of_test).chain(positions) {
        let name = file_name(path);
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let close = ui.small_button("×");
                close.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Close {name}")));
                if close.on_hover_text("Closes this file.").clicked() {
                    closed = Some(path.clone());
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text = format!("{name}{what}");
                    ui.add(Label::new(text).truncate())
                        .on_hover_text(path.display().to_string());
                });
            });
        });
    }
    closed
}

const RECIPE: FileWords = FileWords {
    kind: "recipe",
    description: "The source of the samples as JSON: the array and its scene, or the files of a recording, the meaning of \
                  their columns and the division of the samples. It opens here and in the terminal.",
    extensions: &["json"],
};

/// Returns the file of the recipe of the source.
pub fn recipe_task(shared: &Shared) -> Result<FileTask, String> {
    let setup = shared.setup()?;
    let stem = file_stem("recipe", &setup);
    Ok(FileTask::save(RECIPE, &stem, move |path| {
        RecipeFile::from(&setup).save(path)
    }))
}
