//! The paper's experiments and sweeps of one's own. An [`Experiment`] is a grid of cells; each cell is tried several
//! times (seeds, repeats of a cross-validation) by jobs that do not depend on each other. [`run_experiments`] works
//! them off on all cores and hands over each [`Trial`] as it is finished; [`ExperimentResults`] collects them, at any
//! time complete for what is finished, and [`verdicts`] says which of the paper's claims they bear out.

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
pub use growth::{Growth, GrowthLaw};
pub use results::{CellResults, ExperimentResults};
pub use runner::{Finished, run_experiments, worker_threads};
pub use summary::{CellSummary, Figure};
pub use trial::{Trial, TrialFailure};
pub use verdict::{Standing, Verdict, verdicts};
