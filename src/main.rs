//! The program: the window, or a command in the terminal.

use std::process::ExitCode;

#[cfg(feature = "gui")]
const WINDOW: Option<decoupler::cli::Window> = Some(|| Ok(decoupler::app::open()?));
#[cfg(not(feature = "gui"))]
const WINDOW: Option<decoupler::cli::Window> = None;

fn main() -> ExitCode {
    decoupler::cli::run(std::env::args_os(), WINDOW)
}
