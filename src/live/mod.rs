//! Frames as they come: sources, decoding line by line, re-zero, recording, and faults named from the residual.

mod faults;
mod left_out_decoder;
mod simulated;

pub use faults::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub use left_out_decoder::LeftOutDecoder;
pub use simulated::{Simulated, SimulatedError};
