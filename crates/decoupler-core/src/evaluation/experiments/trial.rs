use std::sync::Arc;

use thiserror::Error;

use super::Cell;
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{
        Begin, CrossValidation, Effort, Run, RunError, RunSets, RunSettings, TestErrors, baselines::mean_and_linear,
    },
    job::Job,
    machine::MemoryBudget,
    problem::Problem,
    training::TrainerState,
};

/// Result of one trial of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Errors on the test set; in a cross-validation, on all samples, each decoupled by the network for which it was
    /// held out.
    pub errors: TestErrors,
    /// Errors, on the same samples, of always answering the mean of the training set.
    pub mean: TestErrors,
    /// Errors, on the same samples, of the linear baseline.
    pub linear: TestErrors,
    /// Number of networks trained: 1, or one per fold.
    pub networks: usize,
    /// Number of epochs, over all starts and folds.
    pub epochs: usize,
    /// Total time of the epochs.
    pub seconds: f64,
    /// Time of the fastest epoch, which is least affected by other load on the machine.
    pub min_epoch_seconds: f64,
    /// Final state of every training, for [`Begin::Resume`]; empty for a cross-validation, which has one network per
    /// fold.
    pub states: Vec<TrainerState>,
}

/// Trial that failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("seed {seed}: {reason}")]
pub struct TrialFailure {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Reason for the failure.
    pub reason: RunError,
}

impl Trial {
    /// Training time of one network, over all its starts.
    pub(super) fn seconds_per_network(&self) -> f64 {
        self.seconds / self.networks.max(1) as f64
    }

    /// Trains and tests with this seed on the sets of `cell`.
    pub(super) fn on_sets(cell: &Cell, seed: Seed, samples: &TrialSamples, job: &Job<'_>) -> Result<Self, RunError> {
        let settings = RunSettings { seed, ..cell.settings };
        let sets = samples.sets(cell, seed, job)?;
        let [mean, linear] = mean_and_linear(&settings, &sets)?;
        let mut run = Run::new(settings, sets, Begin::Initialize, job)?;
        let effort = Effort::train(&mut run, job)?;
        Ok(Self {
            seed,
            repeat: 0,
            errors: run.errors(),
            mean,
            linear,
            networks: 1,
            epochs: effort.epochs,
            seconds: effort.seconds,
            min_epoch_seconds: effort.min_epoch_seconds,
            states: run.states(),
        })
    }

    /// Cross-validates on a set drawn with the seed of `settings`.
    pub(super) fn by_cross_validation(
        settings: RunSettings,
        validation: CrossValidation,
        repeat: usize,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let (simulation, seed) = (settings.drawn()?, settings.seed);
        let set = simulation.draw_training(simulation.samples, seed)?;
        let tested = simulation.draw_tested_folds(&set, seed)?;
        let sets = (&set, tested.as_ref().unwrap_or(&set));
        let validated = validation.run_with_tested(&settings, sets, repeat, job)?;
        let problem = simulation.problem();
        let errors = |decoupled_mm| TestErrors::measure(&problem, &set, decoupled_mm);
        Ok(Self {
            seed,
            repeat,
            errors: errors(&validated.network),
            mean: errors(&validated.mean),
            linear: errors(&validated.linear),
            networks: validated.folds.count(),
            epochs: validated.effort.epochs,
            seconds: validated.effort.seconds,
            min_epoch_seconds: validated.effort.min_epoch_seconds,
            states: Vec::new(),
        })
    }
}

/// Samples of the trials of an experiment.
#[derive(Clone, Debug)]
pub enum TrialSamples {
    /// Samples drawn by each trial from the model of its settings, within this memory.
    Drawn(MemoryBudget),
    /// Recorded samples, divided by each trial.
    Recorded(RecordedSamples),
}

/// Recorded samples, read once for all trials.
#[derive(Clone, Debug)]
pub struct RecordedSamples {
    /// All samples except those of the test files.
    pub set: Arc<Dataset>,
    /// Samples of the test files, if there are any.
    pub test: Option<Arc<Dataset>>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Memory that a trial may use.
    pub memory: MemoryBudget,
}

impl RecordedSamples {
    /// Returns the sets of a run with this seed.
    ///
    /// # Errors
    /// If the samples cannot be divided in this way.
    pub fn divided(&self, division: &Division, seed: Seed) -> Result<RunSets, RunError> {
        let (split, test) = division.sets(&self.set, self.test.as_deref(), seed)?;
        Ok(RunSets {
            problem: Arc::clone(&self.problem),
            memory: self.memory,
            ..RunSets::new(split, test)
        })
    }
}

impl TrialSamples {
    /// Returns the sets of a trial of `cell` with this seed.
    pub(super) fn sets(&self, cell: &Cell, seed: Seed, job: &Job<'_>) -> Result<RunSets, RunError> {
        match self {
            Self::Drawn(memory) => {
                let settings = RunSettings { seed, ..cell.settings };
                RunSets::draw(&settings, *memory, job)
            }
            Self::Recorded(recorded) => {
                let division = cell.division.expect("recorded samples have a division");
                recorded.divided(&division, seed)
            }
        }
    }
}
