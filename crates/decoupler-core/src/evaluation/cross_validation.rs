use std::time::Instant;

use ndarray::{Array2, Axis};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::{Baselines, Run, RunError, RunSets, RunSettings, Scores, TestErrors, baselines::fit_baselines};
use crate::{
    dataset::{Dataset, Folds, Seed, SplitBy, Stream},
    decoupling::decode_set,
    job::{Cancelled, Job},
    problem::Problem,
    training::TrainingError,
};

/// k-fold cross-validation, repeated with the samples reshuffled; [`CrossValidated::on_folds`] accepts other folds.
///
/// Each fold in turn is the test set and the fold after it the validation set, which selects the best weights and ends
/// the training; the others are the training set. There is no validation set with two folds, or for measured samples
/// if the method [needs none](crate::training::Method::needs_validation).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossValidation {
    /// Number of folds, k.
    pub folds: usize,
    /// Number of repeats, each with the samples reshuffled.
    pub repeats: usize,
    /// Rule by which samples are assigned to the folds.
    #[serde(alias = "unit")]
    pub by: SplitBy,
}

impl Default for CrossValidation {
    /// Returns the cross-validation of the paper: 10 folds of samples, 10 repeats.
    fn default() -> Self {
        Self {
            folds: 10,
            repeats: 10,
            by: SplitBy::Random,
        }
    }
}

/// Held-out answers for every sample of a set, by models fitted without it: samples × outputs.
#[derive(Clone, Debug)]
pub struct CrossValidated {
    /// Folds of the cross-validation.
    pub folds: Folds,
    /// Answers of the networks.
    pub network: Array2<f64>,
    /// Answers of the training means.
    pub mean: Array2<f64>,
    /// Answers of the linear maps.
    pub linear: Array2<f64>,
    /// Epochs and time of the trainings.
    pub(super) effort: Effort,
}

/// Networks trained, with the number and time of their epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effort {
    /// Number of networks trained, each with all starts: 1, or one per fold.
    pub networks: usize,
    /// Number of epochs, over all starts and folds.
    pub epochs: usize,
    /// Total time of the epochs.
    pub seconds: f64,
    /// Time of the fastest epoch, which is least affected by other load on the machine.
    pub min_epoch_seconds: Option<f64>,
}

impl CrossValidation {
    /// Runs repeat `repeat` (from 0) of the cross-validation: trains on folds of `set` and tests on the same samples of
    /// `tested`, whose readings may have other noise. Each repeat has its own seed, derived from that of `settings`.
    ///
    /// # Errors
    /// If the folds cannot be filled, the settings are invalid, or the job is cancelled.
    pub fn run(
        &self,
        settings: &RunSettings,
        (set, tested): (&Dataset, &Dataset),
        repeat: usize,
        job: &Job<'_>,
    ) -> Result<CrossValidated, RunError> {
        let seed = nth_seed(settings.seed, repeat);
        let folds = Folds::by(set, self.folds, self.by, &mut seed.rng(Stream::Split))?;
        CrossValidated::of_sets(&RunSettings { seed, ..*settings }, (set, tested), folds, job)
    }
}

impl CrossValidated {
    /// Cross-validates on `folds` of `set`; each fold has its own seed, derived from that of `settings`.
    ///
    /// # Errors
    /// If the settings are invalid, or the job is cancelled.
    pub fn on_folds(settings: &RunSettings, set: &Dataset, folds: Folds, job: &Job<'_>) -> Result<Self, RunError> {
        Self::of_sets(settings, (set, set), folds, job)
    }

    /// Trains on folds of `set` and tests on the same samples of `tested`.
    fn of_sets(
        settings: &RunSettings,
        (set, tested): (&Dataset, &Dataset),
        folds: Folds,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let problem = Problem::of(settings.simulation(), set);
        let holds_out = problem.has_nodes() || settings.training.method.needs_validation();
        let mut effort = Effort::default();
        let empty = || Array2::zeros(set.targets().dim());
        let (mut network, mut mean, mut linear) = (empty(), empty(), empty());
        for fold in 0..folds.count() {
            let (samples, test) = (folds.test(fold), tested.select(folds.test(fold)));
            let split = folds.divided(fold, holds_out).split(set);
            let (mut of_mean, mut of_linear) = fit_baselines(&split.training, settings)?;
            let answers_of_mean = decode_set(&mut of_mean, &test)?;
            scatter(&mut mean, samples, &answers_of_mean);
            scatter(&mut linear, samples, &decode_set(&mut of_linear, &test)?);
            let settings = RunSettings {
                seed: nth_seed(settings.seed, fold),
                ..*settings
            };
            let sets = RunSets::new(split, test).described(problem.clone());
            let mut run = match Run::new(settings, sets, None, job) {
                // Every target is constant without this fold: the constant is the answer.
                Err(RunError::Training(TrainingError::NothingVaries)) if set.has_varying_target() => {
                    scatter(&mut network, samples, &answers_of_mean);
                    continue;
                }
                run => run?,
            };
            effort.train(&mut run, job)?;
            scatter(&mut network, samples, &run.decouple_test());
        }
        Ok(Self {
            folds,
            network,
            mean,
            linear,
            effort,
        })
    }

    /// Returns the errors of each target over all samples of `set`, the set that was cross-validated.
    ///
    /// # Panics
    /// If the set has a different shape.
    pub fn scores(&self, set: &Dataset) -> Scores {
        self.scores_of(&Problem::unnamed(set.channels(), set.outputs()), set)
    }

    /// As [`Self::scores`], for a set that `problem` describes.
    pub(super) fn scores_of(&self, problem: &Problem, set: &Dataset) -> Scores {
        let errors = |answers| TestErrors::measure(problem, set, answers);
        Scores {
            network: errors(&self.network),
            network_alone: None,
            baselines: Baselines {
                mean: errors(&self.mean),
                linear: errors(&self.linear),
                model_based: None,
            },
            coverage: Vec::new(),
        }
    }
}

impl Effort {
    /// Trains `run` to its end, unless the job is cancelled, and counts its effort.
    pub(super) fn train(&mut self, run: &mut Run, job: &Job<'_>) -> Result<(), Cancelled> {
        while run.stop_reason().is_none() {
            job.check()?;
            let at_work = run.trainers().iter().filter(|trainer| trainer.stop_reason().is_none());
            let at_work = at_work.count() as f64;
            let begun = Instant::now();
            run.step();
            let seconds = begun.elapsed().as_secs_f64() / at_work;
            self.min_epoch_seconds = Some(self.min_epoch_seconds.map_or(seconds, |least| least.min(seconds)));
        }
        self.networks += 1;
        let epochs = run.trainers().iter().map(|trainer| trainer.latest().epoch);
        self.epochs += epochs.sum::<usize>();
        self.seconds += run.training_time().as_secs_f64();
        Ok(())
    }
}

/// Returns the `n`th seed derived from `seed`.
pub(super) fn nth_seed(seed: Seed, n: usize) -> Seed {
    let mut seeds = seed.rng(Stream::Folds).random_iter();
    Seed(seeds.nth(n).expect("a generator never ends"))
}

/// Copies the rows of `answers` to the rows `samples` of `pooled`.
pub(super) fn scatter(pooled: &mut Array2<f64>, samples: &[usize], answers: &Array2<f64>) {
    for (&sample, answer) in samples.iter().zip(answers.axis_iter(Axis(0))) {
        pooled.row_mut(sample).assign(&answer);
    }
}
