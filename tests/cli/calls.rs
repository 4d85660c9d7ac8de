//! Calls of the program, their output, and its refusals.

use std::{
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::terminal::decoupler;

/// Standard output and standard error of a call that must succeed, possibly with warnings.
#[track_caller]
pub(crate) fn both(arguments: &str, folder: &Path) -> (String, String) {
    let output = decoupler(arguments, folder);
    let [printed, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{arguments}: {message}");
    (printed, message)
}

/// Standard output of a call that must succeed, possibly with warnings.
#[track_caller]
pub(crate) fn success(arguments: &str, folder: &Path) -> String {
    both(arguments, folder).0
}

/// Standard error of a call that must succeed.
#[track_caller]
pub(crate) fn said(arguments: &str, folder: &Path) -> String {
    both(arguments, folder).1
}

/// Like `success`, for a call that prints JSON.
#[track_caller]
pub(crate) fn json(arguments: &str, folder: &Path) -> Value {
    serde_json::from_str(&success(arguments, folder)).unwrap()
}

/// Warnings of a call that prints JSON.
#[track_caller]
pub(crate) fn warnings(arguments: &str, folder: &Path) -> String {
    json(arguments, folder)["warnings"].to_string()
}

/// Standard error of a call that must end with `status` and one line, without output.
#[track_caller]
pub(crate) fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {message}");
    assert!(output.stdout.is_empty(), "{arguments}");
    let is_line = message.starts_with("error: ") && message.lines().count() == 1 && message.len() < 1000;
    assert!(is_line, "{arguments}: {message}");
    message
}

/// Checks that a call ends with `status` and one line that has these words.
#[track_caller]
pub(crate) fn refused(arguments: &str, folder: &Path, status: i32, words: &str) {
    let message = failure(arguments, folder, status);
    assert!(message.contains(words), "{arguments}: {message}");
}

/// Checks that a text has all of these words.
#[track_caller]
pub(crate) fn has(text: &str, words: &[&str]) {
    for words in words {
        assert!(text.contains(words), "'{words}' is missing in {text}");
    }
}

pub(crate) fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

pub(crate) fn write(folder: &Path, name: &str, text: impl AsRef<[u8]>) {
    fs::write(folder.join(name), text).unwrap();
}

/// A number of a report.
#[track_caller]
pub(crate) fn number(of: &Value, name: &str) -> f64 {
    of[name].as_f64().unwrap()
}

/// Numbers of the column of a CSV text whose name begins like this.
pub(crate) fn column(text: &str, name: &str) -> Vec<f64> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let column = reader.headers().unwrap().iter().position(|cell| cell.starts_with(name));
    let number = |record: Result<csv::StringRecord, _>| record.unwrap()[column.unwrap()].parse().unwrap();
    reader.records().map(number).collect()
}

/// A running program that replaces files, with pipes to it. Signals are enabled that are ignored if the tests run in the
/// background.
#[cfg(unix)]
pub(crate) fn spawn(arguments: &str, folder: &Path) -> Child {
    let mut command = Command::new("env");
    command.args(["--default-signal", env!("CARGO_BIN_EXE_decoupler")]);
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
    piped(&mut command)
}

/// Starts a command with pipes to it.
pub(crate) fn piped(command: &mut Command) -> Child {
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
    command.stderr(Stdio::piped()).spawn().unwrap()
}

#[cfg(unix)]
pub(crate) fn signal(name: &str, child: &Child) {
    let kill = [format!("-{name}"), child.id().to_string()];
    assert!(Command::new("kill").args(kill).status().unwrap().success());
}

/// Signals that end the program, with its exit status.
#[cfg(unix)]
pub(crate) const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

/// Waits for a condition, until it is certain that the program hangs.
pub(crate) fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(600), "{what}");
        thread::sleep(Duration::from_millis(5));
    }
}
