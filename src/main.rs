//! The program: the window, or a command in the terminal.

use std::process::ExitCode;

fn main() -> ExitCode {
    decoupler::terminal::run(std::env::args_os(), |files| Ok(decoupler::window::open(files)?))
}
