//! Report of a training in figures.

mod panel;

pub use panel::report_ui;
