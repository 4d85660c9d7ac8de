//! The report of a run: one HTML file that needs nothing else, for any browser and for print.

mod command;
mod contents;
mod html;
mod pictures;
mod settings;

#[cfg(test)]
pub mod tests;

pub use command::quoted;
pub use command::{CommandGap, train_command};
pub use contents::RunReport;
