//! Recordings to be dropped on the window, and their results from the library.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use decoupler_core::{evaluation::RunSettings, scene::RowModel};
use decoupler_files::import::{Plan, Recipe, Setup};
use eframe::egui::{self, accesskit::Role};
use egui_kittest::kittest::{By, Queryable as _};
use tempfile::TempDir;

use crate::driver::Driver;

/// A file dropped on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        fs::read(&self.0).map_err(|error| error.to_string())
    }
}

impl Driver {
    /// Drops files on the window and waits until their columns are shown.
    #[track_caller]
    pub(crate) fn drop_files(&mut self, paths: &[&Path]) {
        for path in paths {
            let file = std::sync::Arc::new(Dropped((*path).to_owned()));
            self.harness().input_mut().dropped_files.push(file);
        }
        self.harness().step();
    }

    /// As [`Self::drop_files`]; waits until the window has checked the import.
    #[track_caller]
    pub(crate) fn open_recordings(&mut self, paths: &[&Path]) {
        self.drop_files(paths);
        self.wait("the samples", |driver| driver.says("Test: "));
    }

    /// Gives a column another meaning through its list.
    #[track_caller]
    pub(crate) fn mean(&mut self, column: &str, meaning: &str) {
        self.click(&format!("Meaning of {column}"));
        // The form, on the left, may have a button of the same name.
        self.settle();
        let options = self.harness().get_all(By::new().role(Role::Button).label(meaning));
        let option = options.max_by(|one, other| one.rect().left().total_cmp(&other.rect().left()));
        option.unwrap().click();
        self.harness().run_steps(2);
        self.settle();
    }

    /// Presses Train and waits for the end; settings are those of the form.
    #[track_caller]
    pub(crate) fn train_recording(&mut self) {
        self.choose_by_hand();
        self.click("▶ Train");
        self.wait_for_training();
    }

    /// Enables the settings of the form.
    #[track_caller]
    pub(crate) fn choose_by_hand(&mut self) {
        if self.state().recording.is_auto {
            self.click("Choose settings automatically");
            self.settle();
            assert!(!self.state().recording.is_auto);
        }
    }

    /// Waits for the end of the training of a recording, and for its results.
    #[track_caller]
    pub(crate) fn wait_for_training(&mut self) {
        self.wait("the end of the training", |driver| {
            let result = driver.state().result();
            driver.has_ended() && result.is_some_and(|result| result.is_idle)
        });
        self.settle();
    }

    /// Unfolds the part of the form with this field.
    #[track_caller]
    pub(crate) fn unfold_to(&mut self, part: &str, field: &str) {
        if !self.has(field) {
            self.click(part);
            self.settle();
        }
    }

    /// Limits the training to this many epochs.
    #[track_caller]
    pub(crate) fn limit_epochs(&mut self, epochs: &str) {
        self.choose_by_hand();
        self.unfold_to("Advanced", "Epochs");
        self.enter("Epochs", epochs);
    }
}

/// Readings of two channels and a target that is nearly linear in them, in the order of time.
pub(crate) fn recording(rows: usize) -> String {
    let mut text = "time (s),u1 (V),u2 (V),x (mm),y (mm)\n".to_owned();
    for row in 0..rows {
        let t = row as f64;
        let (x, y) = (10.0 + 5.0 * (0.37 * t).sin(), 4.0 * (0.23 * t).cos());
        let (u1, u2) = (0.2 * x + 0.05 * y + 0.01 * x * y / 40.0, 0.3 * y - 0.02 * x);
        writeln!(text, "{},{u1:.6},{u2:.6},{x:.6},{y:.6}", 0.1 * t).unwrap();
    }
    text
}

pub(crate) fn written(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    path
}

/// The import that the window suggests for [`recording`], or for its columns in another file.
pub(crate) fn plan(path: &Path, targets: &[&str]) -> Plan {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Plan {
        import: Recipe {
            data: path.to_owned(),
            inputs: names(&["u1", "u2"]),
            targets: names(targets),
            time: Some("time".to_owned()),
            ..Recipe::default()
        },
        ..Plan::default()
    }
}

/// What the window trains on [`recording`] with five epochs.
pub(crate) fn setup(path: &Path) -> Setup {
    let mut settings = RunSettings::measured(RowModel::Shared);
    settings.training.stopping.epochs = 5;
    Setup::recording(settings, plan(path, &["x", "y"]))
}

/// Returns a window with [`recording`] open, its file, and the folder of the file.
pub(crate) fn opened(rows: usize) -> (Driver, PathBuf, TempDir) {
    opened_text(&recording(rows))
}

/// As [`opened`], with this text.
pub(crate) fn opened_text(text: &str) -> (Driver, PathBuf, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", text);
    let mut driver = Driver::open();
    driver.open_recordings(&[&path]);
    (driver, path, folder)
}
