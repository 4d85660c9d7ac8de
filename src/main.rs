//! The program: the window, or a command in the terminal.

use std::process::ExitCode;

fn main() -> ExitCode {
    decoupler::cli::run(std::env::args_os(), None)
}
