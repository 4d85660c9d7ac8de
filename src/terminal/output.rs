use std::{
    io::{self, Write, stdout},
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::failure::Failure;

/// Prints one JSON object on standard output.
pub(super) fn print_object(object: &impl Serialize) -> Result<(), Failure> {
    print(|output| {
        serde_json::to_writer(&mut *output, object)?;
        writeln!(output)
    })
}

/// Prints what `write` writes on standard output.
pub(super) fn print(write: impl FnOnce(&mut io::StdoutLock) -> io::Result<()>) -> Result<(), Failure> {
    write(&mut stdout().lock()).map_err(Failure::Output)
}

/// A progress bar of `steps`, drawn by this template; hidden next to JSON and where standard error is no terminal.
pub(super) fn progress_bar(is_hidden: bool, steps: usize, template: &str) -> ProgressBar {
    if is_hidden {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps as u64);
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
