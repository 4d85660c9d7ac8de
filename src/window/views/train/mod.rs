//! The Train view: one training and what it makes of the sensor.

mod bottom_tab;
mod chart;
mod charts_card;
mod configuration;
mod decoders;
mod drawn;
mod exports;
mod inspect;
mod paper_figure;
mod press;
mod recording;
mod report;
mod sample_card;
mod scrub;
mod state;
mod surfaces;
mod view;
mod workbench;

pub use bottom_tab::BottomTab;
pub use decoders::DecoderResult;
pub use exports::CHECKPOINT;
pub use state::TrainView;
