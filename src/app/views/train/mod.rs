//! The Train view: one training and what it makes of the sensor.

pub mod charts;
mod charts_card;
mod configuration;
pub mod decoders;
mod paper_figure;
mod report;
mod shortcuts;
pub mod shown_figure;
pub mod surfaces;
mod workbench;

pub use configuration::configuration_ui;
pub use decoders::{DecoderResult, DecodersState};
pub use paper_figure::PaperFigure;
pub use report::report_ui;
pub use shortcuts::pressed_shortcuts;
pub use shown_figure::ShownPicture;
pub use workbench::{WorkbenchLayout, workbench_ui};
