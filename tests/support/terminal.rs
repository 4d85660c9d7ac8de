//! Runs the program from the command line.

use std::{
    path::Path,
    process::{Command, Output},
};

/// Returns the output of the program for these arguments, separated by spaces, run in this folder.
pub(crate) fn decoupler(arguments: &str, folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command.output().unwrap()
}
