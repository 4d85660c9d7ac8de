use std::time::Instant;

use ndarray::{Array2, Axis};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Bottleneck, CrossValidation};
use crate::{
    dataset::{Dataset, Folds, Seed, Split, Stream},
    decoupling::{Decoupler, LinearMap, TrainingMean},
    evaluation::{Baselines, Errors, Run, RunError, RunSettings},
    training::TrainerState,
};

/// What one trial of a cell came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Its seed.
    pub seed: Seed,
    /// Which repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// On the test set; in a cross-validation, on all samples, each decoupled by the network that had not seen it.
    pub errors: Errors,
    /// On the same samples.
    pub baselines: Baselines,
    /// The errors, on the same samples, of the best answer that so few hidden nodes can give: see [`Bottleneck`].
    pub bottleneck: Errors,
    /// Networks trained: 1, or one for each fold.
    pub networks: usize,
    /// Epochs run, of all starts and folds together.
    pub epochs: usize,
    /// Time spent on them.
    pub seconds: f64,
    /// Time of the quickest epoch, which other work on the machine has disturbed least.
    pub least_epoch_seconds: f64,
    /// Every start as it ended, which [`Run::resume`] takes up; none from a cross-validation, which has as many
    /// networks as folds.
    pub states: Vec<TrainerState>,
}

/// A trial that could not be carried out.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("seed {seed}: {reason}")]
pub struct TrialFailure {
    /// Its seed.
    pub seed: Seed,
    /// Which repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Why.
    pub reason: RunError,
}

impl Trial {
    /// Training time of one network, all its starts together.
    pub fn seconds_per_network(&self) -> f64 {
        self.seconds / self.networks.max(1) as f64
    }

    /// Trains on sets drawn with the seed of `settings` and tests on the test set. `None` if cancelled.
    pub(super) fn on_drawn_sets(
        settings: RunSettings,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let (split, test) = Run::draw(&settings)?;
        let bottleneck = Bottleneck::fit(split.training.coordinates_mm.view(), settings.hidden)?;
        let reconstructed = bottleneck.reconstruct(test.coordinates_mm.view());
        let bottleneck = Errors::measure(&test, &reconstructed, settings.stroke_mm());
        let mut run = Run::on_sets(settings, split, test)?;
        let Some(spent) = train(&mut run, &is_cancelled) else {
            return Ok(None);
        };
        Ok(Some(Self {
            seed: settings.seed,
            repeat: 0,
            errors: run.decouple_test().1,
            baselines: *run.baselines(),
            bottleneck,
            networks: 1,
            epochs: spent.epochs,
            seconds: spent.seconds,
            least_epoch_seconds: spent.least_epoch_seconds,
            states: run.states(),
        }))
    }

    /// Cross-validates on a set drawn with the seed of `settings`. `None` if cancelled.
    pub(super) fn by_cross_validation(
        settings: RunSettings,
        CrossValidation { folds, unit, .. }: CrossValidation,
        repeat: usize,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let set = Run::training_set(&settings, settings.samples)?;
        let own_seed = nth_seed(settings.seed, repeat);
        let folds = Folds::deal(&set, folds, unit, &mut own_seed.rng(Stream::Split))?;
        let mut pooled = Pooled::new(&set);
        let mut spent = Spent::default();
        for fold in 0..folds.count() {
            let split = split(&set, &folds, fold);
            let test = set.select(folds.test(fold));
            pooled.add_references(folds.test(fold), &split.training, &test, settings.hidden)?;
            let settings = RunSettings {
                seed: nth_seed(own_seed, fold),
                ..settings
            };
            let mut run = Run::on_sets(settings, split, test)?;
            let Some(of_fold) = train(&mut run, &is_cancelled) else {
                return Ok(None);
            };
            scatter(&mut pooled.network, folds.test(fold), &run.decouple_test().0);
            spent.add(of_fold);
        }
        let errors = |decoupled_mm| Errors::measure(&set, decoupled_mm, settings.stroke_mm());
        Ok(Some(Self {
            seed: settings.seed,
            repeat,
            errors: errors(&pooled.network),
            baselines: Baselines {
                mean: errors(&pooled.mean),
                linear: errors(&pooled.linear),
                reference: None,
            },
            bottleneck: errors(&pooled.bottleneck),
            networks: folds.count(),
            epochs: spent.epochs,
            seconds: spent.seconds,
            least_epoch_seconds: spent.least_epoch_seconds,
            states: Vec::new(),
        }))
    }
}

/// Steps to the end and tells what that took; `None` if cancelled before.
fn train(run: &mut Run, is_cancelled: impl Fn() -> bool) -> Option<Spent> {
    let mut spent = Spent::default();
    while run.stop_reason().is_none() {
        if is_cancelled() {
            return None;
        }
        let at_work = run.trainers().iter().filter(|trainer| trainer.stop_reason().is_none());
        let at_work = at_work.count() as f64;
        let begun = Instant::now();
        run.step();
        spent.least_epoch_seconds = spent.least_epoch_seconds.min(begun.elapsed().as_secs_f64() / at_work);
    }
    for trainer in run.trainers() {
        spent.epochs += trainer.latest().epoch;
        spent.seconds += trainer.elapsed().as_secs_f64();
    }
    Some(spent)
}

/// What is fitted and what is held out when fold `fold` is tested: the fold after it chooses the best weights.
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

/// Answers for every sample of a set, each by what was fitted without it: samples × 3·M2, in millimetres.
struct Pooled {
    network: Array2<f64>,
    mean: Array2<f64>,
    linear: Array2<f64>,
    bottleneck: Array2<f64>,
}

impl Pooled {
    fn new(set: &Dataset) -> Self {
        let empty = Array2::zeros(set.coordinates_mm.dim());
        Self {
            network: empty.clone(),
            mean: empty.clone(),
            linear: empty.clone(),
            bottleneck: empty,
        }
    }

    /// Fills in the answers of everything but the network for the `samples` that make up `test`.
    fn add_references(
        &mut self,
        samples: &[usize],
        training: &Dataset,
        test: &Dataset,
        hidden: usize,
    ) -> Result<(), RunError> {
        let readings = test.resistances_ohm.view();
        scatter(&mut self.mean, samples, &TrainingMean::fit(training).decouple(readings));
        scatter(&mut self.linear, samples, &LinearMap::fit(training)?.decouple(readings));
        let bottleneck = Bottleneck::fit(training.coordinates_mm.view(), hidden)?;
        let reconstructed = bottleneck.reconstruct(test.coordinates_mm.view());
        scatter(&mut self.bottleneck, samples, &reconstructed);
        Ok(())
    }
}

/// Writes the rows of `answers` to the places `samples`.
fn scatter(pooled: &mut Array2<f64>, samples: &[usize], answers: &Array2<f64>) {
    for (&sample, answer) in samples.iter().zip(answers.axis_iter(Axis(0))) {
        pooled.row_mut(sample).assign(&answer);
    }
}

/// Epochs and the time for them.
struct Spent {
    epochs: usize,
    seconds: f64,
    least_epoch_seconds: f64,
}

impl Default for Spent {
    fn default() -> Self {
        Self {
            epochs: 0,
            seconds: 0.0,
            least_epoch_seconds: f64::INFINITY,
        }
    }
}

impl Spent {
    fn add(&mut self, other: Self) {
        self.epochs += other.epochs;
        self.seconds += other.seconds;
        self.least_epoch_seconds = self.least_epoch_seconds.min(other.least_epoch_seconds);
    }
}
