//! Arithmetic on frames as they arrive: re-zeroing, drift, and fault diagnosis from the residual.
//!
//! [`FaultMonitor`] checks whether Eq. (2) explains the readings and identifies the faulty wire; [`LeftOutDecoder`] decodes
//! without it. [`DriftMonitor`] reports readings that no longer look like those of the training. [`ReZero`] estimates the
//! unloaded state from recent frames.

mod drift;
mod faults;
mod left_out_decoder;
mod re_zero;

pub use drift::{Drift, DriftEvent, DriftMonitor, DriftReference, NoDriftMonitor};
pub use faults::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub use left_out_decoder::LeftOutDecoder;
pub use re_zero::{ReZero, ReZeroError, ZeroGains};
