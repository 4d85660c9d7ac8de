//! The paper's experiments, and experiments over any other settings, on a simulated array or on a recording.
//!
//! An [`Experiment`] is a grid of cells; each cell is run several times (seeds, repeats of a cross-validation) by
//! independent jobs, each on its own [`TrialSamples`]. [`run_experiments`] runs them on all cores and passes on each
//! [`Trial`] as it finishes; [`ExperimentResults`] collects them and can be evaluated at any time.

mod experiment;
mod results;
mod runner;

pub use experiment::{Axis, AxisKind, Cell, Experiment, ExperimentRecording, PaperTable};
pub use results::{ExperimentResults, Figure};
pub use runner::{Finished, Trial, TrialSamples, run_experiments, worker_threads};
