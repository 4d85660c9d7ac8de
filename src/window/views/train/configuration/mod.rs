//! The settings of the next training: array scale, hidden nodes and method first, the rest folded beneath them in the
//! order of the pipeline.

mod choices;
mod form;
mod network_section;
mod noise_section;
mod preset_section;
mod scene_choice;
mod scene_section;
mod sensor_section;
mod summaries;

pub use form::configuration_ui;
