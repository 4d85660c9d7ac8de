use std::sync::Arc;

use super::{Problem, RunError, SimulatedSettings, Workload, further_samples::FurtherSamples};
use crate::dataset::{Dataset, Split};

/// Sets of samples of a run, drawn from a model or recorded.
#[derive(Clone, Debug)]
pub struct RunSets {
    /// Training samples, and those held out for validation.
    pub split: Split,
    /// Training samples beyond those held in memory.
    pub(super) further: Option<Arc<FurtherSamples>>,
    /// Test samples.
    pub test: Arc<Dataset>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
}

impl RunSets {
    /// Returns the sets of a run whose samples are all in memory.
    pub fn new(split: Split, test: Dataset) -> Self {
        Self {
            problem: Arc::new(Problem::unnamed(test.channels(), test.outputs())),
            split,
            further: None,
            test: Arc::new(test),
        }
    }

    /// Returns the sets with this description of their channels.
    #[must_use]
    pub fn described(self, problem: Problem) -> Self {
        Self {
            problem: Arc::new(problem),
            ..self
        }
    }
}

impl SimulatedSettings {
    /// Draws the sets of these settings, as far as a run holds them in memory.
    ///
    /// # Errors
    /// If the settings are invalid, or the samples do not fit into memory.
    pub fn draw_sets(&self) -> Result<RunSets, RunError> {
        Ok(self.checked_sets_unless(&|| false)?.expect("nothing cancels it"))
    }

    /// Draws the sets of these settings, after a check that they fit into memory; returns `None` once `is_cancelled`, which is
    /// called between the parts of the work.
    ///
    /// # Errors
    /// If the settings are invalid, or the samples do not fit into memory.
    pub fn checked_sets_unless(&self, is_cancelled: &dyn Fn() -> bool) -> Result<Option<RunSets>, RunError> {
        Workload::of(self)?.check_memory()?;
        self.sets_unless(is_cancelled)
    }

    /// Draws the sets of these settings; returns `None` once `is_cancelled`, which is called between the parts of the work.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub(crate) fn sets_unless(&self, is_cancelled: &dyn Fn() -> bool) -> Result<Option<RunSets>, RunError> {
        let Some((split, test)) = self.draw_held_unless(is_cancelled)? else {
            return Ok(None);
        };
        let further = FurtherSamples::of(self)?.map(Arc::new);
        if let Some(further) = &further
            && !further.check(is_cancelled)?
        {
            return Ok(None);
        }
        Ok(Some(RunSets {
            further,
            ..RunSets::new(split, test).described(self.source.problem())
        }))
    }
}
