//! The Train view: one training and its results.

mod charts;
mod configuration;
mod decoders;
mod exports;
mod press;
mod recording;
mod report;
mod scrub;
mod section;
mod surfaces;
mod view;

pub use decoders::DecoderResult;
pub use exports::CHECKPOINT;
pub use view::TrainView;
