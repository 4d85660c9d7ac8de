//! The files of a recording in the form, including those that are missing or have changed since a run was saved.

use std::path::PathBuf;

use decoupler_core::text::counted;
use decoupler_files::export::RecipeFile;
use eframe::egui::{Align, Label, Layout, Ui, WidgetInfo, accesskit::Role};

use super::{
    editor::{RecordingEditor, Use},
    import::{Import, file_name},
    opening::{Files, ToOpen},
};
use crate::window::{
    shared::{Effect, FileTask, FileWords, Shared, file_stem, sentence},
    widgets::{dim_ui, ghost_button, note_ui, progress_bar_ui, section_heading_ui},
};

/// Files that can be opened.
pub(super) const FILES: FileWords = FileWords {
    kind: "recording",
    description: "A table of readings and targets (CSV or other text, Excel, .npy, .npz, .mat), a recipe, a network or a \
                  checkpoint.",
    extensions: &[
        "csv",
        "txt",
        "tsv",
        "dat",
        "npy",
        "npz",
        "mat",
        "xlsx",
        "ods",
        "json",
        "checkpoint",
    ],
};

/// An open file by its use.
enum OpenFile {
    /// A recording by its number: the first, or one that is joined to it.
    Recording(usize),
    /// A file whose rows follow those of the first, by its number.
    Appended(usize),
    /// A file for the test, by the number of the recording that it replaces.
    Test(usize),
    /// Positions of targets.
    Positions,
}

impl RecordingEditor {
    /// Shows the files of the recording, and opens and closes them.
    pub fn files_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        section_heading_ui(ui, "Files");
        self.missing_ui(ui, effects);
        if let Some(file) = self.import.as_ref().and_then(|import| open_files_ui(ui, import)) {
            self.close_file(file);
        }
        for name in &self.changed {
            note_ui(ui, &format!("{name} has changed since the run was saved."));
        }
        self.samples_line_ui(ui);
        if let Some((name, progress)) = &self.opening.under_way {
            dim_ui(ui, &format!("Reading {name}…"));
            let share = progress.and_then(|progress| Some(progress.bytes as f32 / progress.of?.max(1) as f32));
            if let Some(share) = share {
                progress_bar_ui(ui, "Reading", share, &format!("{:.0} %", 100.0 * share));
            }
        }
        self.buttons_ui(ui, effects);
        if self.is_empty() {
            let button = ui.add(ghost_button("Open the sample recording"));
            let hint = "Simulated readings of a soft skin with the force on it and its position: a recording for \
                        trying out the program.";
            if button.on_hover_text(hint).clicked() {
                let data_folder = shared.runs.path.as_ref().and_then(|runs| runs.parent());
                let folder = data_folder.map_or_else(std::env::temp_dir, PathBuf::from);
                self.opening.start(ToOpen::Files(Files {
                    sample: Some(folder.join("samples")),
                    ..Files::default()
                }));
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
                effects.push(Effect::ChooseFile(self.ask(Use::Missing(path), FILES, name)));
            }
        }
        if is_training {
            dim_ui(ui, "The training is resumed once its recording is found.");
        }
    }

    fn close_file(&mut self, file: OpenFile) {
        match (file, &mut self.import) {
            (OpenFile::Recording(number), _) => self.close(number),
            (OpenFile::Appended(number), Some(import)) => import.close_appended(number),
            (OpenFile::Test(number), Some(import)) => import.set_test_file(number, PathBuf::new()),
            (OpenFile::Positions, Some(import)) => import.edit().import.positions = None,
            (_, None) => {}
        }
    }

    /// Shows the numbers of channels and samples, or the error of the import.
    fn samples_line_ui(&self, ui: &mut Ui) {
        if self.import.is_none() {
            return;
        }
        if let Some(reason) = self.obstacle() {
            note_ui(ui, &sentence(&reason));
            return;
        }
        let channels = self.channels().map(|(inputs, targets)| {
            let inputs = counted(inputs, "input");
            format!("{inputs}, {}", counted(targets, "target"))
        });
        let samples = match &self.checking.checked {
            Some(Ok(checked)) => counted(checked.samples.iter().sum::<usize>(), "sample"),
            Some(Err(reason)) => {
                note_ui(ui, &sentence(reason));
                return;
            }
            None if self.checking.is_under_way() => "checking the import…".to_owned(),
            None => return,
        };
        dim_ui(ui, &format!("{}, {samples}", channels.unwrap_or_default()));
    }

    fn buttons_ui(&mut self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        ui.horizontal_wrapped(|ui| {
            let text = if self.import.is_some() {
                "Add file…"
            } else {
                "Open file…"
            };
            if ui.add(ghost_button(text)).on_hover_text(FILES.description).clicked() {
                effects.push(Effect::ChooseFile(self.open_task()));
            }
            if self.opening.under_way.is_some() {
                if ui.add(ghost_button("Cancel")).clicked() {
                    self.opening.cancel();
                }
            } else if !self.is_empty() {
                let clear = ui.add(ghost_button("Clear"));
                if clear.on_hover_text("Closes all files.").clicked() {
                    self.close_all();
                }
            }
        });
    }

    /// Shows the button that displays the columns in place of the results.
    pub fn columns_button_ui(&mut self, ui: &mut Ui, shared: &Shared) {
        if self.import.is_some() && !self.is_on_show(shared) {
            let button = ui.add(ghost_button("Columns…"));
            let hint = "Shows the columns of the files and their meanings in place of the results.";
            if button.on_hover_text(hint).clicked() {
                self.shows_columns = true;
                ui.request_repaint();
            }
        }
    }
}

/// Lists the open files. Returns the one to be closed.
fn open_files_ui(ui: &mut Ui, import: &Import) -> Option<OpenFile> {
    let recipe = &import.plan.import;
    let recordings = import.paths().into_iter().enumerate().map(|(number, path)| {
        let what = if number == 0 { "" } else { ", joined" };
        (OpenFile::Recording(number), path, what.to_owned())
    });
    let appended = recipe.append.iter().enumerate();
    let appended =
        appended.map(|(number, set)| (OpenFile::Appended(number), set.data.clone(), ", appended".to_owned()));
    let tests = import.tests().into_iter().enumerate();
    let tests = tests
        .filter(|(_, (_, test))| !test.as_os_str().is_empty())
        .map(|(number, (recording, test))| {
            let of = format!(", for the test of {}", file_name(&recording));
            let what = if import.files.len() > 1 {
                of
            } else {
                ", for the test".to_owned()
            };
            (OpenFile::Test(number), test, what)
        });
    let positions = recipe.positions.iter();
    let positions = positions.map(|path| (OpenFile::Positions, path.clone(), ", positions".to_owned()));
    let mut closed = None;
    for (file, path, what) in recordings.chain(appended).chain(tests).chain(positions) {
        let name = file_name(&path);
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let close = ui.small_button("×");
                close.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Close {name}")));
                if close.on_hover_text("Closes this file.").clicked() {
                    closed = Some(file);
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
