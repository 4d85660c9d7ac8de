//! The Experiments view: reproduces the paper's tables and runs sweeps in the background.

mod form;
mod panel;
mod state;
mod sweep_folder;
mod view;

pub use form::{AxisForm, Form};
pub use state::{Ending, ExperimentLook, ExperimentsView, Outcome, Running, Topic};
