//! Report of a training in figures.

mod conditioning;
mod panel;
mod spread;

pub use panel::report_ui;
