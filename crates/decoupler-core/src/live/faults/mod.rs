//! Diagnosis of faults of wires and electronics from the residual of Eq. (2).

mod diagnosis;
mod evidence;
mod monitor;
mod row_fit;
mod shorts;

pub use diagnosis::{Diagnosis, FaultCause, FaultyWire};
pub use monitor::{FaultEvent, FaultMonitor};
pub(super) use row_fit::{FitPrior, RowFit, RowReadings};
