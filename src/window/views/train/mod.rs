//! The Train view: one training and its results.

mod charts_card;
mod configuration;
mod decoders;
mod drawn;
mod exports;
mod inspect;
mod press;
mod recording;
mod report;
mod scrub;
mod surfaces;
mod view;

pub use charts_card::BottomTab;
pub use decoders::DecoderResult;
pub use exports::CHECKPOINT;
pub use view::TrainView;
