//! The Train view: one training and what it makes of the sensor.

mod chart;
mod charts_card;
mod configuration;
mod decoders;
mod drawn;
mod export_kind;
mod paper_figure;
mod report;
mod run_buttons;
mod state;
mod surfaces;
mod view;
mod workbench;

pub use chart::BottomTab;
pub use decoders::DecoderResult;
pub use export_kind::ExportKind;
pub use state::TrainView;
