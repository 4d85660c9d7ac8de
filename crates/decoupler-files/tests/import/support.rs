//! Folders with tables, and recipes that read them.

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use decoupler_files::import::{DialectChoice, Joined, Progress, Recipe, Recording, Table, read_table};
use tempfile::TempDir;

pub(crate) fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A folder with these files.
pub(crate) fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

pub(crate) fn fixture(name: &str) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    fixtures.join(name)
}

pub(crate) fn read(path: &Path) -> Result<Table, String> {
    read_table(path, DialectChoice::default(), &mut go_on).map_err(|error| error.to_string())
}

pub(crate) fn names(table: &Table) -> Vec<&str> {
    table.columns.iter().map(|column| column.name.as_str()).collect()
}

/// Numbers of the columns whose names contain `name`.
pub(crate) fn numbers(table: &Table, name: &str) -> Vec<Vec<f64>> {
    let columns = table.columns.iter().filter(|column| column.name.contains(name));
    columns.map(|column| column.numbers.clone()).collect()
}

/// Numbers of the column of this name.
pub(crate) fn column(table: &Table, name: &str) -> Vec<f64> {
    let found = table.columns.iter().find(|column| column.name == name);
    found.expect(name).numbers.clone()
}

pub(crate) fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

/// A recipe of `data.csv`, with columns separated by spaces.
pub(crate) fn recipe(inputs: &str, targets: &str) -> Recipe {
    Recipe {
        data: "data.csv".into(),
        inputs: words(inputs),
        targets: words(targets),
        ..Recipe::default()
    }
}

pub(crate) fn joined(file: &str) -> Joined {
    Joined {
        file: file.into(),
        ..Joined::default()
    }
}

pub(crate) fn import(recipe: &Recipe, folder: &Path) -> Result<Recording, String> {
    let imported = recipe.import(folder, &mut go_on);
    imported.map_err(|error| error.to_string())
}

/// Checks that the import fails for this cause.
#[track_caller]
pub(crate) fn refused(recipe: &Recipe, folder: &Path, cause: &str) {
    let message = import(recipe, folder).unwrap_err();
    assert!(message.contains(cause), "{message}");
}

/// A column of the readings of all samples.
pub(crate) fn reading(recording: &Recording, column: usize) -> Vec<f64> {
    recording.set.readings().column(column).to_vec()
}

/// A column of the targets of all samples.
pub(crate) fn target(recording: &Recording, column: usize) -> Vec<f64> {
    recording.set.targets().column(column).to_vec()
}
