//! Arithmetic on frames as they arrive: re-zeroing, drift, and faulty wires from the residual.
//!
//! [`WireCheck`] checks whether Eq. (2) explains the readings and identifies the faulty wire; [`LeftOutDecoder`] decodes
//! without it. [`DriftMonitor`] reports readings that no longer look like those of the training. [`ReZero`] estimates the
//! unloaded state from recent frames.

mod drift;
mod error;
mod left_out_decoder;
mod re_zero;
mod wire_check;

pub use drift::{Drift, DriftMonitor, DriftReference};
pub use error::LiveError;
pub use left_out_decoder::LeftOutDecoder;
pub use re_zero::{ReZero, ZeroGains};
pub use wire_check::{Diagnosis, FaultCause, FaultEvent, FaultyWire, WireCheck};
