//! The program as the terminal runs it.

use std::{
    path::Path,
    process::{Command, Output},
};

/// What the program gives for these arguments, separated by spaces, in this folder.
pub(crate) fn decoupler(arguments: &str, folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command.output().unwrap()
}
