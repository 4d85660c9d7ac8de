//! The report of a run: one self-contained HTML file, for any browser and for print.

mod command;
mod contents;
mod html;
mod pictures;
mod settings;

#[cfg(test)]
mod tests;

pub use command::{CommandGap, changed_options, quoted, train_command};
pub use contents::RunReport;
