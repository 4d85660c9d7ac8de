//! What a training has come to, in figures.

mod conditioning;
mod panel;
mod spread;

pub use panel::report_ui;
