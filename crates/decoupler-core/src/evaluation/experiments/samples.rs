use std::sync::Arc;

use super::Cell;
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{Problem, RunError, RunSets},
};

/// Samples of the trials of an experiment.
#[derive(Clone, Debug)]
pub enum TrialSamples {
    /// Drawn by each trial from the model of its settings.
    Drawn,
    /// Recorded, and divided by each trial.
    Recorded(RecordedSamples),
}

/// Recorded samples, read once for all trials.
#[derive(Clone, Debug)]
pub struct RecordedSamples {
    /// All samples but those of the test files.
    pub set: Arc<Dataset>,
    /// Samples of the test files, if there are any.
    pub test: Option<Arc<Dataset>>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
}

impl RecordedSamples {
    /// Returns the sets of a run with this seed.
    ///
    /// # Errors
    /// If the samples cannot be divided so.
    pub fn divided(&self, division: &Division, seed: Seed) -> Result<RunSets, RunError> {
        let (split, test) = division.sets(&self.set, self.test.as_deref(), seed)?;
        Ok(RunSets {
            problem: Arc::clone(&self.problem),
            ..RunSets::new(split, test)
        })
    }
}

impl TrialSamples {
    /// Returns the sets of a trial of `cell` with this seed; `None` once `is_cancelled`.
    pub(super) fn sets(
        &self,
        cell: &Cell,
        seed: Seed,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<RunSets>, RunError> {
        match self {
            Self::Drawn => {
                let mut settings = cell
                    .settings
                    .simulated()
                    .expect("the source of drawn samples is simulated");
                settings.seed = seed;
                settings.checked_sets_unless(is_cancelled)
            }
            Self::Recorded(recorded) => {
                let division = cell.division.expect("recorded samples have a division");
                recorded.divided(&division, seed).map(Some)
            }
        }
    }
}
