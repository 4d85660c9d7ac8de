//! The Experiments view: the paper's tables redone and sweeps of one's own, run on threads of their own while the
//! window stays free.

mod form;
mod panel;
mod state;
mod sweep_folder;
mod view;

pub use form::{AxisForm, Form};
pub use state::{Ending, ExperimentLook, ExperimentsView, Outcome, Running, Topic};
