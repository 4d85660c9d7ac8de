//! Files made to harm: archives that inflate to gigabytes, headers that claim them, files that are torn, nested or of another
//! kind than their name says. Every reader runs in a child process whose address space is limited: each file is refused in one
//! line or read, and none ends the program.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bombs;
mod documents;
mod names;
mod torn;

use std::{
    path::Path,
    process::{Command, Output},
};

/// Address space of the program in KiB: about 1 GB, of which a file may take less than half.
const LIMIT_KIB: u32 = 1_000_000;

/// Runs the program with these arguments in this folder and little memory.
pub(crate) fn limited(arguments: &[&str], folder: &Path) -> Output {
    let mut command = Command::new("sh");
    let script = format!("ulimit -v {LIMIT_KIB}; exec \"$0\" \"$@\"");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_decoupler")]);
    command.args(arguments).current_dir(folder).output().unwrap()
}

/// Returns standard error of a call that must end by itself: with success, or with status 1 or 2 and one line.
pub(crate) fn ended(arguments: &[&str], folder: &Path) -> (bool, String) {
    let output = limited(arguments, folder);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    match output.status.code() {
        Some(0) => (true, message),
        Some(1 | 2) => {
            let errors = message.lines().filter(|line| line.starts_with("error: ")).count();
            assert!(errors == 1 && message.len() < 3000, "{arguments:?}: {message}");
            (false, message)
        }
        other => panic!("{arguments:?} ended with {other:?} ({}): {message}", output.status),
    }
}

/// Returns the message of a call that must fail.
pub(crate) fn refused(arguments: &[&str], folder: &Path) -> String {
    let (succeeded, message) = ended(arguments, folder);
    assert!(!succeeded, "{arguments:?}: {message}");
    message
}
