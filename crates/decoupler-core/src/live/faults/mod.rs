//! Faults of wires and electronics, named from what Eq. (2) leaves unexplained.

mod cholesky;
mod diagnosis;
mod evidence;
mod monitor;
mod prior;
mod row_fit;
mod row_prediction;
mod shorts;

pub use diagnosis::{Diagnosis, FaultCause, FaultyWire};
pub use monitor::{FaultEvent, FaultMonitor};
pub(super) use prior::GaussianPrior;
pub(super) use row_fit::{RowFit, View};
