//! Runs the program for the tests.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant, SystemTime},
};

use serde_json::{Value, json};
use tempfile::TempDir;

pub(crate) fn command(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
    command
}

pub(crate) fn run(arguments: &str, folder: &Path) -> Output {
    command(arguments, folder).output().unwrap()
}

pub(crate) fn success(arguments: &str, folder: &Path) -> String {
    let output = run(arguments, folder);
    let errors = String::from_utf8_lossy(&output.stderr);
    // The recordings here are short.
    let is_note =
        |line: &str| line.starts_with("Drift of the readings is not monitored") || line.starts_with("warning: ");
    assert!(
        output.status.success() && errors.lines().all(is_note),
        "{arguments}: {errors}"
    );
    String::from_utf8(output.stdout).unwrap()
}

/// Standard output and standard error of a call that must end with `status` and one line.
pub(crate) fn failure(arguments: &str, folder: &Path, status: i32) -> (String, String) {
    let output = run(arguments, folder);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
    assert!(
        text.starts_with("error: ") && text.lines().count() == 1,
        "{arguments}: {text}"
    );
    (String::from_utf8(output.stdout).unwrap(), text)
}

pub(crate) fn spawn(command: &mut Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

pub(crate) fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        thread::sleep(Duration::from_millis(2));
    }
}

/// Six trials, each a fraction of a second.
pub(crate) fn six() -> Value {
    json!({
        "train": {"array": "10x6_3x18", "samples": 100, "epochs": 8, "decoder": ["ridge", "network"]},
        "axes": {"hidden": [3, 4, 10], "seed": [0, 7]},
    })
}

pub(crate) fn folder_with(specification: &Value) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("sweep.json"), specification.to_string()).unwrap();
    folder
}

pub(crate) fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// Results in a folder, with the times of their files.
pub(crate) fn results(folder: &Path) -> BTreeSet<(String, SystemTime)> {
    let is_result = |name: &String| name.ends_with(".json");
    let names = names(folder).into_iter().filter(is_result);
    names
        .map(|name| {
            let modified = fs::metadata(folder.join(&name)).unwrap().modified().unwrap();
            (name, modified)
        })
        .collect()
}

pub(crate) fn fill(more: &str, folder: &Path) -> Value {
    serde_json::from_str(&success(&format!("sweep --spec sweep.json --json {more}"), folder)).unwrap()
}

/// The merged table without the times, which may differ.
pub(crate) fn merged(folders: &str, folder: &Path) -> Value {
    success(&format!("sweep --merge {folders} --out merged.json"), folder);
    let mut table: Value = serde_json::from_slice(&fs::read(folder.join("merged.json")).unwrap()).unwrap();
    for trial in table["trials"].as_array_mut().unwrap() {
        trial.as_object_mut().unwrap().remove("time");
    }
    table
}
