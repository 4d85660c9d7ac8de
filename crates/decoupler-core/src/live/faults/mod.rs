//! Faults of wires and electronics, named from what Eq. (2) leaves unexplained.

mod evidence;
mod monitor;
mod row_fit;
mod shorts;

pub use monitor::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub(super) use row_fit::{FitPrior, RowFit, RowReadings};
