//! Arithmetic on frames as they arrive: re-zeroing, drift, and faulty wires from the residual.
//!
//! [`WireCheck`] checks whether Eq. (2) explains the readings, identifies the faulty wire, and decodes without it.
//! [`DriftMonitor`] reports readings that no longer look like those of the training. [`ZeroGains`] are the gains of the
//! unloaded state, estimated from recent frames.

mod drift;
mod error;
mod left_out;
mod re_zero;
mod wire_check;

pub use drift::{Drift, DriftMonitor, DriftReference};
pub use error::LiveError;
pub use re_zero::ZeroGains;
pub use wire_check::{FaultCause, FaultEvent, FaultyWire, WireCheck};
