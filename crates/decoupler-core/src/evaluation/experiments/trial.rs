use std::sync::Arc;

use thiserror::Error;

use super::{Cell, Experiment};
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{Baselines, Begin, Effort, Run, RunError, RunSets, RunSettings, Scores},
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
    /// Errors of the network, the training mean and the linear baseline on the test set; in a cross-validation, on all
    /// samples, each decoupled by the models for which it was held out.
    pub scores: Scores,
    /// Networks, epochs and time of the trainings.
    pub effort: Effort,
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

impl Trial {
    /// Runs a trial of a cell with this seed; a cross-validation draws one set with it.
    pub(super) fn run(
        experiment: &Experiment,
        cell: &Cell,
        (seed, repeat): (Seed, usize),
        samples: &TrialSamples,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        job.check()?;
        let settings = RunSettings { seed, ..cell.settings };
        if let Some(validation) = experiment.cross_validation {
            let simulation = settings.drawn()?;
            let set = simulation.draw_training(simulation.samples, seed)?;
            let tested = simulation.draw_tested_folds(&set, seed)?;
            let sets = (&set, tested.as_ref().unwrap_or(&set));
            let validated = validation.run(&settings, sets, repeat, job)?;
            return Ok(Self {
                seed,
                repeat,
                scores: validated.scores_of(&simulation.problem(), &set),
                effort: validated.effort,
                states: Vec::new(),
            });
        }
        let sets = match samples {
            TrialSamples::Drawn(memory) => RunSets::draw(&settings, *memory, job)?,
            TrialSamples::Recorded(recorded) => {
                let division = cell.division.expect("recorded samples have a division");
                recorded.divided(&division, seed)?
            }
        };
        let baselines = Baselines::fitted(&settings, &sets)?;
        let mut run = Run::new(settings, sets, Begin::Initialize, job)?;
        let mut effort = Effort::default();
        effort.train(&mut run, job)?;
        Ok(Self {
            seed,
            repeat,
            scores: Scores {
                network: run.errors(),
                network_alone: None,
                baselines,
                coverage: Vec::new(),
            },
            effort,
            states: run.states(),
        })
    }
}
