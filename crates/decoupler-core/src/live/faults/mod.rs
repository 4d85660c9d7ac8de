//! Diagnosis of faults of wires and electronics from the residual of Eq. (2).

mod evidence;
mod monitor;
mod row_fit;
mod shorts;

pub use monitor::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub(super) use row_fit::{FitPrior, RowFit, RowReadings};
