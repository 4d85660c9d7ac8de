use std::sync::Arc;

use super::{Cell, Experiment};
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{Baselines, Run, RunError, RunSets, RunSettings, Scores, cross_validation::Effort},
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
    /// Number of networks trained, each with all starts: 1, or one per fold.
    pub networks: usize,
    /// Number of epochs, over all starts and folds.
    pub epochs: usize,
    /// Total time of the epochs.
    pub seconds: f64,
    /// Time of the fastest epoch, which is least affected by other load on the machine.
    pub min_epoch_seconds: f64,
    /// Final state of every training, for [`Run::new`]; empty for a cross-validation, which has one network per
    /// fold.
    pub states: Vec<TrainerState>,
}

/// Samples of the trials of an experiment.
#[derive(Clone, Debug)]
pub enum TrialSamples {
    /// Samples drawn by each trial from the model of its settings, within this memory.
    Drawn(MemoryBudget),
    /// Recorded samples, read once for all trials and divided by each.
    Recorded {
        /// All samples except those of the test files.
        set: Arc<Dataset>,
        /// Samples of the test files, if there are any.
        test: Option<Arc<Dataset>>,
        /// Description of the readings and targets.
        problem: Arc<Problem>,
        /// Memory that a trial may use.
        memory: MemoryBudget,
    },
}

impl TrialSamples {
    /// Returns the sets of a trial with these settings and this division of recorded samples.
    ///
    /// # Errors
    /// If the samples cannot be drawn or divided in this way.
    ///
    /// # Panics
    /// If recorded samples have no division.
    pub fn sets(
        &self,
        settings: &RunSettings,
        division: Option<&Division>,
        job: &Job<'_>,
    ) -> Result<RunSets, RunError> {
        match self {
            Self::Drawn(memory) => RunSets::draw(settings, *memory, job),
            Self::Recorded {
                set,
                test,
                problem,
                memory,
            } => {
                let division = division.expect("recorded samples have a division");
                let (split, test) = division.sets(set, test.as_deref(), settings.seed)?;
                Ok(RunSets {
                    problem: Arc::clone(problem),
                    memory: *memory,
                    ..RunSets::new(split, test)
                })
            }
        }
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
        let (scores, effort, states) = if let Some(validation) = experiment.cross_validation {
            let simulation = settings.drawn()?;
            let set = simulation.draw_training(simulation.samples, seed)?;
            let tested = simulation.draw_tested_folds(&set, seed)?;
            let sets = (&set, tested.as_ref().unwrap_or(&set));
            let validated = validation.run(&settings, sets, repeat, job)?;
            let scores = validated.scores_of(&simulation.problem(), &set);
            (scores, validated.effort, Vec::new())
        } else {
            let sets = samples.sets(&settings, cell.division.as_ref(), job)?;
            let baselines = Baselines::fitted(&settings, &sets)?;
            let mut run = Run::new(settings, sets, None, job)?;
            let mut effort = Effort::default();
            effort.train(&mut run, job)?;
            let scores = Scores {
                network: run.errors(),
                network_alone: None,
                baselines,
                coverage: Vec::new(),
            };
            (scores, effort, run.states())
        };
        Ok(Self {
            seed,
            repeat,
            scores,
            networks: effort.networks,
            epochs: effort.epochs,
            seconds: effort.seconds,
            min_epoch_seconds: effort.min_epoch_seconds,
            states,
        })
    }
}
