//! Results of other decoders on the test set: measured on a thread of their own once a training is paused and the
//! user has unfolded their table, and shown as they come.

mod measuring;
mod state;
mod table;

pub use state::{DecoderResult, DecodersState};
pub use {measuring::DecoderMeasuring, table::decoders_ui};
