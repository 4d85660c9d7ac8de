//! Runs the program for the tests.

use std::{collections::BTreeSet, fs, path::Path, time::SystemTime};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    calls::{json, read, success, write},
    folders::names,
    terminal::decoupler,
};

/// Standard output and standard error of a sweep of which a part fails: with status 1 and one line.
pub(crate) fn incomplete(arguments: &str, folder: &Path) -> (String, String) {
    let output = decoupler(arguments, folder);
    let [printed, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(1), "{arguments}: {message}");
    let is_line = message.starts_with("error: ") && message.lines().count() == 1;
    assert!(is_line, "{arguments}: {message}");
    (printed, message)
}

/// Six trials, each a fraction of a second.
pub(crate) fn six() -> Value {
    serde_json::json!({
        "train": {"array": "10x6_3x18", "samples": 100, "epochs": 8, "decoder": ["ridge", "network"]},
        "axes": {"hidden": [3, 4, 10], "seed": [0, 7]},
    })
}

pub(crate) fn folder_with(specification: &Value) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "sweep.json", specification.to_string());
    folder
}

/// Results in a folder, with the times of their files.
pub(crate) fn results(folder: &Path) -> BTreeSet<(String, SystemTime)> {
    let results = names(folder).into_iter().filter(|name| name.ends_with(".json"));
    let with_time = |name: String| {
        let modified = fs::metadata(folder.join(&name)).unwrap().modified().unwrap();
        (name, modified)
    };
    results.map(with_time).collect()
}

pub(crate) fn fill(more: &str, folder: &Path) -> Value {
    json(&format!("sweep --spec sweep.json --json {more}"), folder)
}

/// The merged table without the times, which may differ.
pub(crate) fn merged(folders: &str, folder: &Path) -> Value {
    success(&format!("sweep --merge {folders} --out merged.json"), folder);
    let mut table: Value = serde_json::from_str(&read(folder, "merged.json")).unwrap();
    for trial in table["trials"].as_array_mut().unwrap() {
        trial.as_object_mut().unwrap().remove("time");
    }
    table
}
