//! The settings of the next training, in the order of the pipeline.

mod form;
mod network_section;
mod noise_section;
mod preset_section;
mod scene_section;
mod sensor_section;

pub use form::configuration_ui;
