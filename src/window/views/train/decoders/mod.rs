//! Results of other decoders on the test set: measured on a thread of their own once a training is paused and the
//! user has unfolded their table, and shown as they come.

mod measuring;
mod table;

pub use measuring::{DecoderMeasuring, DecoderResult, DecodersState};
pub use table::decoders_ui;
