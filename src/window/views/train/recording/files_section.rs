//! The files of a recording, including files that have moved or changed since a run was saved.

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use decoupler_core::text::counted;
use decoupler_files::{
    export::{CheckpointFile, RecipeFile, atomic_write},
    import::{FileChecksum, Plan, Recorded, file_crc32},
};
use eframe::egui::{Align, Label, Layout, Ui, WidgetInfo, accesskit::Role};

use super::{
    draft::{Draft, file_name},
    editor::RecordingEditor,
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
#[derive(Clone)]
enum OpenFile {
    /// A recording by its number: the first, or one that is joined to it.
    Recording(usize),
    /// A file whose rows follow those of the first, by its number.
    Appended(usize),
    /// A file for the test, by the recording that it replaces.
    Test(PathBuf),
    /// Positions of targets.
    Positions,
}

impl RecordingEditor {
    /// Returns the task of opening a file.
    pub fn open_task(&self) -> FileTask {
        self.recordings.task(FILES, String::new())
    }

    /// Shows the files of the recording, and opens and closes them.
    pub fn files_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        section_heading_ui(ui, "Files");
        self.missing_ui(ui, effects);
        if let Some(file) = self.draft.as_ref().and_then(|draft| open_files_ui(ui, draft)) {
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
                self.open_sample(folder.join("samples"));
            }
        }
    }

    /// Lists the missing files, each with buttons to find it.
    fn missing_ui(&mut self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        let Some(reopened) = &self.missing else { return };
        let missing: Vec<PathBuf> = reopened.missing().into_iter().map(PathBuf::from).collect();
        let is_training = reopened.checkpoint.is_some();
        for path in missing {
            let name = file_name(&path);
            note_ui(ui, &format!("{name} is missing.")).on_hover_text(path.display().to_string());
            ui.horizontal(|ui| {
                let find = ui.add(ghost_button("Find…"));
                find.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Find {name}")));
                let find = find.on_hover_text("Choose the file in its new place. Its contents are checked.");
                if !find.clicked() {
                    return;
                }
                let (_, paths) = self
                    .finding
                    .insert((path.clone(), super::editor::ChosenPaths::default()));
                let task = paths.task(FILES, name.clone());
                effects.push(Effect::ChooseFile(task));
            });
        }
        if is_training {
            dim_ui(ui, "The training is resumed once its recording is found.");
        }
    }

    fn close_file(&mut self, file: OpenFile) {
        match (file, &mut self.draft) {
            (OpenFile::Recording(number), _) => self.close(number),
            (OpenFile::Appended(number), Some(draft)) => draft.close_appended(number),
            (OpenFile::Test(recording), Some(draft)) => draft.close_test_file(&recording),
            (OpenFile::Positions, Some(draft)) => draft.plan.import.positions = None,
            (_, None) => {}
        }
    }

    /// Shows the numbers of channels and samples, or the error of the import.
    fn samples_line_ui(&self, ui: &mut Ui) {
        let Some(draft) = &self.draft else { return };
        if let Some(reason) = draft.obstacle() {
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
            let text = if self.draft.is_some() {
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
        if self.draft.is_some() && !self.is_on_show(shared) {
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
fn open_files_ui(ui: &mut Ui, draft: &Draft) -> Option<OpenFile> {
    let mut closed = None;
    let recordings = draft.paths().into_iter().enumerate();
    let recordings = recordings.map(|(number, path)| (OpenFile::Recording(number), path));
    let tests = draft.tests();
    let tests = tests.map(|(recording, test)| (OpenFile::Test(recording.to_owned()), test.to_owned()));
    let positions = draft.plan.import.positions.iter();
    let positions = positions.map(|path| (OpenFile::Positions, path.clone()));
    let appended = draft.plan.import.append.iter().enumerate();
    let appended = appended.map(|(number, set)| (OpenFile::Appended(number), set.data.clone()));
    for (file, path) in recordings.chain(appended).chain(tests).chain(positions) {
        let name = file_name(&path);
        let what = match &file {
            OpenFile::Recording(0) => String::new(),
            OpenFile::Recording(_) => ", joined".to_owned(),
            OpenFile::Appended(_) => ", appended".to_owned(),
            OpenFile::Test(recording) if draft.files.len() > 1 => {
                format!(", for the test of {}", file_name(recording))
            }
            OpenFile::Test(_) => ", for the test".to_owned(),
            OpenFile::Positions => ", positions".to_owned(),
        };
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

/// Name and contents of the sample: made by `examples/soft_skin.rs`.
const NAME: &str = "soft_skin.csv";
const TEXT: &str = include_str!("../../../../../assets/samples/soft_skin.csv");

/// Writes the sample recording into `folder`, and returns its path.
///
/// # Errors
/// If it cannot be written.
pub(super) fn write_sample(folder: &Path) -> Result<PathBuf, String> {
    let path = folder.join(NAME);
    let refused = |error: &dyn std::fmt::Display| format!("the sample recording cannot be written: {error}");
    fs::create_dir_all(folder).map_err(|error| refused(&error))?;
    // An unchanged file keeps its modification time.
    if fs::read(&path).is_ok_and(|written| written == TEXT.as_bytes()) {
        return Ok(path);
    }
    atomic_write(&path, |file| file.write_all(TEXT.as_bytes())).map_err(|error| refused(&error))?;
    Ok(path)
}

const RECIPE: FileWords = FileWords {
    kind: "recipe",
    description: "The source of the samples as JSON: the array and its scene, or the files of a recording, the meaning of \
                  their columns and the division of the samples. It opens here and in a terminal (train --recipe FILE).",
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

/// An import to be opened again: its plan, and the known checksums of its files.
#[derive(Clone, Debug)]
pub(super) struct Reopened {
    /// Plan with absolute paths, and checksums; an empty checksum is not known.
    pub(super) recorded: Recorded,
    /// Training to be resumed once all files are found.
    pub(super) checkpoint: Option<Box<CheckpointFile>>,
    /// Names of files whose contents differ from those at the time of the run.
    pub(super) changed: Vec<String>,
}

impl From<Recorded> for Reopened {
    fn from(recorded: Recorded) -> Self {
        Self {
            recorded,
            checkpoint: None,
            changed: Vec::new(),
        }
    }
}

impl From<Plan> for Reopened {
    /// Returns the import of a plan without known checksums.
    fn from(plan: Plan) -> Self {
        let unknown = |path| FileChecksum {
            path,
            crc32: String::new(),
        };
        Self::from(Recorded {
            files: plan.files().into_iter().map(unknown).collect(),
            samples_crc32: String::new(),
            search: None,
            combined: None,
            chosen_intervals: None,
            plan,
        })
    }
}

impl Reopened {
    /// Returns the paths of files that no longer exist.
    pub(super) fn missing(&self) -> Vec<&Path> {
        self.recorded.missing()
    }

    /// Notes the names of files whose contents have changed.
    ///
    /// # Errors
    /// If a file cannot be read, or has changed while a training is to be resumed with it.
    pub(super) fn compare(&mut self) -> Result<(), String> {
        let mut changed = Vec::new();
        for file in &self.recorded.files {
            if file.path.is_file() && !has_checksum(&file.path, &file.crc32)? {
                changed.push(file_name(&file.path));
            }
        }
        if let (Some(_), Some(name)) = (&self.checkpoint, changed.first()) {
            return Err(format!(
                "{name} has changed since the training was saved, so the training cannot be resumed with it. \
                 Use the original file."
            ));
        }
        self.changed = changed;
        Ok(())
    }

    /// Replaces a missing file by `found`, and other missing files by those of the same name and contents next to it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn relocate(&mut self, missing: &Path, found: &Path) -> Result<(), String> {
        self.recorded = self.recorded.relocated(missing, found);
        let folder = found.parent().unwrap_or(Path::new(""));
        for file in self.recorded.files.clone() {
            let neighbour = file.path.file_name().map(|name| folder.join(name));
            if let Some(neighbour) = neighbour.filter(|neighbour| !file.path.exists() && neighbour.is_file())
                && has_checksum(&neighbour, &file.crc32)?
            {
                self.recorded = self.recorded.relocated(&file.path, &neighbour);
            }
        }
        Ok(())
    }
}

/// Returns true if the file has this checksum, or the checksum is not known.
fn has_checksum(path: &Path, crc32: &str) -> Result<bool, String> {
    if crc32.is_empty() {
        return Ok(true);
    }
    let found = file_crc32(path, &mut |_| ControlFlow::Continue(()));
    Ok(found.map_err(|error| error.to_string())? == crc32)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_is_found_with_its_neighbours_and_changed_contents_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [("sensor.csv", "1\n"), ("states.csv", "2\n"), ("other.csv", "3\n")] {
            fs::write(at(name), text).unwrap();
        }
        let gone = |name: &str| PathBuf::from("/gone").join(name);
        let mut plan = Plan::default();
        plan.import.data = gone("sensor.csv");
        plan.import.join = vec![decoupler_files::import::Joined {
            file: gone("states.csv"),
            ..Default::default()
        }];
        let mut reopened = Reopened::from(plan);
        for file in &mut reopened.recorded.files {
            file.crc32 = file_crc32(&at(&file_name(&file.path)), &mut |_| ControlFlow::Continue(())).unwrap();
        }
        assert_eq!(reopened.missing(), [gone("sensor.csv"), gone("states.csv")]);

        let mut found = reopened.clone();
        found.relocate(&gone("sensor.csv"), &at("sensor.csv")).unwrap();
        assert!(found.missing().is_empty(), "the other file is next to it");
        assert_eq!(found.recorded.plan.import.join[0].file, at("states.csv"));
        found.compare().unwrap();
        assert!(found.changed.is_empty());

        reopened.relocate(&gone("sensor.csv"), &at("other.csv")).unwrap();
        reopened.compare().unwrap();
        assert_eq!(reopened.changed, ["other.csv"]);
    }
}
