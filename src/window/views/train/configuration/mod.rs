//! The settings of the next training: array scale, hidden nodes and method first, the rest folded below them in the
//! order of the pipeline.

mod automatic;
mod form;
mod scene_section;

pub use form::configuration_ui;
