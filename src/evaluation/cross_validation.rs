use std::time::Instant;

use ndarray::{Array2, Axis};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::{Run, RunError, RunSettings, TargetErrors, TargetRow, baselines::fit_baselines};
use crate::{
    dataset::{Dataset, FoldUnit, Folds, Seed, Split, Stream},
    decoupling::decode_set,
};

/// A k-fold cross-validation, repeated with the samples shuffled anew.
///
/// Fold by fold, the network is tested on the fold, the next fold chooses the best weights and ends the training, and
/// the others are fitted. With two folds none is left to choose by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossValidation {
    /// k.
    pub folds: usize,
    /// How often the samples are shuffled anew.
    pub repeats: usize,
    /// Unit of the folds.
    pub unit: FoldUnit,
}

impl Default for CrossValidation {
    /// As the paper: 10 folds of samples, 10 repeats.
    fn default() -> Self {
        Self {
            folds: 10,
            repeats: 10,
            unit: FoldUnit::Sample,
        }
    }
}

/// Answers for every sample of a set, each by what was fitted without it: samples × outputs.
#[derive(Clone, Debug)]
pub struct CrossValidated {
    /// The folds.
    pub folds: Folds,
    /// Of the networks.
    pub network: Array2<f64>,
    /// Of the training means.
    pub mean: Array2<f64>,
    /// Of the linear maps.
    pub linear: Array2<f64>,
    /// What the trainings took.
    pub effort: Effort,
}

/// Epochs and the time for them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Epochs run, of all starts and folds together.
    pub epochs: usize,
    /// Time spent on them.
    pub seconds: f64,
    /// Time of the quickest epoch, which other work on the machine has disturbed least.
    pub least_epoch_seconds: f64,
}

impl CrossValidation {
    /// Cross-validates on `set`: repeat number `repeat` (from 0), which has a seed of its own that follows from that of
    /// `settings`. `None` if cancelled.
    ///
    /// # Errors
    /// Folds that cannot be filled, or settings that are impossible, with the reason.
    pub fn run(
        &self,
        settings: &RunSettings,
        set: &Dataset,
        repeat: usize,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<CrossValidated>, RunError> {
        let own_seed = nth_seed(settings.seed, repeat);
        let folds = Folds::deal(set, self.folds, self.unit, &mut own_seed.rng(Stream::Split))?;
        let mut effort = Effort::default();
        let empty = || Array2::zeros(set.targets().dim());
        let (mut network, mut mean, mut linear) = (empty(), empty(), empty());
        for fold in 0..folds.count() {
            let (samples, test) = (folds.test(fold), set.select(folds.test(fold)));
            let split = split(set, &folds, fold);
            let (mut of_mean, mut of_linear) = fit_baselines(&split.training, settings)?;
            scatter(&mut mean, samples, &decode_set(&mut of_mean, &test)?);
            scatter(&mut linear, samples, &decode_set(&mut of_linear, &test)?);
            let settings = RunSettings {
                seed: nth_seed(own_seed, fold),
                ..*settings
            };
            let mut run = Run::on_sets(settings, split, test)?;
            let Some(of_fold) = Effort::train(&mut run, &is_cancelled) else {
                return Ok(None);
            };
            scatter(&mut network, samples, &run.decouple_test());
            effort.add(of_fold);
        }
        Ok(Some(CrossValidated {
            folds,
            network,
            mean,
            linear,
            effort,
        }))
    }
}

impl CrossValidated {
    /// The samples of `set`, the set that was cross-validated on, that were fitted when fold `fold` was tested.
    pub(super) fn training(&self, set: &Dataset, fold: usize) -> Dataset {
        split(set, &self.folds, fold).training
    }

    /// The errors of each target on all samples of `set`, the set that was cross-validated on.
    ///
    /// # Panics
    /// If the set has another shape.
    pub fn target_table(&self, set: &Dataset) -> Vec<TargetRow> {
        let row = |name, answers: &Array2<f64>| TargetRow {
            name,
            targets: TargetErrors::measure(set.targets(), answers.view()),
        };
        vec![
            row("training mean", &self.mean),
            row("linear map", &self.linear),
            row("network", &self.network),
        ]
    }
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            epochs: 0,
            seconds: 0.0,
            least_epoch_seconds: f64::INFINITY,
        }
    }
}

impl Effort {
    /// Steps `run` to its end; `None` if cancelled before.
    pub(super) fn train(run: &mut Run, is_cancelled: impl Fn() -> bool) -> Option<Self> {
        let mut effort = Self::default();
        while run.stop_reason().is_none() {
            if is_cancelled() {
                return None;
            }
            let at_work = run.trainers().iter().filter(|trainer| trainer.stop_reason().is_none());
            let at_work = at_work.count() as f64;
            let begun = Instant::now();
            run.step();
            effort.least_epoch_seconds = effort.least_epoch_seconds.min(begun.elapsed().as_secs_f64() / at_work);
        }
        for trainer in run.trainers() {
            effort.epochs += trainer.latest().epoch;
            effort.seconds += trainer.elapsed().as_secs_f64();
        }
        Some(effort)
    }

    fn add(&mut self, other: Self) {
        self.epochs += other.epochs;
        self.seconds += other.seconds;
        self.least_epoch_seconds = self.least_epoch_seconds.min(other.least_epoch_seconds);
    }
}

/// The sets of fold `fold`: the fold after it chooses the best weights.
fn split(set: &Dataset, folds: &Folds, fold: usize) -> Split {
    let chooses = (fold + 1) % folds.count();
    if folds.count() < 3 {
        return Split {
            training: set.select(&folds.without(&[fold])),
            validation: None,
        };
    }
    Split {
        training: set.select(&folds.without(&[fold, chooses])),
        validation: Some(set.select(folds.test(chooses))),
    }
}

/// Seed number `n` of those that follow from `seed`.
fn nth_seed(seed: Seed, n: usize) -> Seed {
    let mut seeds = seed.rng(Stream::Folds).random_iter();
    Seed(seeds.nth(n).expect("a generator never ends"))
}

/// Writes the rows of `answers` to the rows `samples` of `pooled`.
fn scatter(pooled: &mut Array2<f64>, samples: &[usize], answers: &Array2<f64>) {
    for (&sample, answer) in samples.iter().zip(answers.axis_iter(Axis(0))) {
        pooled.row_mut(sample).assign(&answer);
    }
}
