//! The paper's experiments, and experiments over any other settings.
//!
//! An [`Experiment`] is a grid of cells; each cell is run several times (seeds, repeats of a cross-validation) by
//! independent jobs. [`run_experiments`] runs them on all cores and passes on each [`Trial`] as it finishes;
//! [`ExperimentResults`] collects them and is complete at any time for what is finished; [`verdicts`] judges which of
//! the paper's claims they support.

mod axis;
mod bottleneck;
mod experiment;
mod growth;
mod measured;
mod results;
mod runner;
mod summary;
mod time_left;
mod trial;
mod verdict;

pub use axis::Axis;
pub use bottleneck::Bottleneck;
pub use experiment::{Cell, Experiment, ExperimentError, PaperTable};
pub use growth::Growth;
pub use results::{CellResults, ExperimentResults};
pub use runner::{Finished, run_experiments, worker_threads};
pub use summary::{CellSummary, Figure};
pub use trial::{Trial, TrialFailure};
pub use verdict::{Standing, Verdict, verdicts};
