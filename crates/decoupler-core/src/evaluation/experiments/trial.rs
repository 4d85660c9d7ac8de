use ndarray::Array2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Bottleneck, Cell, TrialSamples};
use crate::{
    dataset::{Dataset, Seed},
    evaluation::{
        Baselines, CrossValidated, CrossValidation, Effort, Run, RunError, RunSettings, SimulatedSettings, TestErrors,
    },
    scene::RowModel,
    training::TrainerState,
};

/// Result of one trial of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Errors on the test set; in a cross-validation, on all samples, each decoupled by the network that had not seen
    /// it.
    pub errors: TestErrors,
    /// Errors of the baselines on the same samples.
    pub baselines: Baselines,
    /// Errors, on the same samples, of the best answer possible with so few hidden nodes: see [`Bottleneck`]. `None` for a
    /// recording with a network for each row-wire.
    pub bottleneck: Option<TestErrors>,
    /// Number of networks trained: 1, or one per fold.
    pub networks: usize,
    /// Number of epochs, over all starts and folds.
    pub epochs: usize,
    /// Time spent on them.
    pub seconds: f64,
    /// Time of the fastest epoch, the one least disturbed by other work on the machine.
    pub min_epoch_seconds: f64,
    /// Final state of every training, for [`Run::resume`]; empty for a cross-validation, which has as many networks as
    /// folds.
    pub states: Vec<TrainerState>,
}

/// A trial that failed.
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

    /// Trains and tests with this seed on the sets of `cell`. Returns `None` if cancelled.
    pub(super) fn on_sets(
        cell: &Cell,
        seed: Seed,
        samples: &TrialSamples,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let settings = RunSettings { seed, ..cell.settings };
        let Some(sets) = samples.sets(cell, seed, &is_cancelled)? else {
            return Ok(None);
        };
        let has_bound = settings.source.simulation().is_some() || settings.source.row_model() == RowModel::Shared;
        let bottleneck = if has_bound {
            let bottleneck = Bottleneck::fit(sets.split.training.targets(), settings.hidden)?;
            let reconstructed = bottleneck.reconstruct(sets.test.targets());
            Some(TestErrors::measure(&settings.source, &sets.test, &reconstructed))
        } else {
            None
        };
        let Some(mut run) = Run::on_unless(settings, sets, &is_cancelled)? else {
            return Ok(None);
        };
        let Some(effort) = Effort::train(&mut run, &is_cancelled) else {
            return Ok(None);
        };
        let scores = run.scores().expect("a run that is not of a fold has baselines");
        Ok(Some(Self {
            seed,
            repeat: 0,
            errors: scores.network,
            baselines: scores.baselines,
            bottleneck,
            networks: 1,
            epochs: effort.epochs,
            seconds: effort.seconds,
            min_epoch_seconds: effort.min_epoch_seconds,
            states: run.states(),
        }))
    }

    /// Cross-validates on a set drawn with the seed of `settings`. Returns `None` if cancelled.
    pub(super) fn by_cross_validation(
        settings: SimulatedSettings,
        validation: CrossValidation,
        repeat: usize,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let set = settings.draw_training(settings.source.samples)?;
        let tested = settings.draw_tested_folds(&set)?;
        let sets = (&set, tested.as_ref().unwrap_or(&set));
        let Some(validated) = validation.run_with_tested(&settings.into(), sets, repeat, is_cancelled)? else {
            return Ok(None);
        };
        let bottleneck = bottleneck_answers(&set, &validated, settings.hidden)?;
        let source = settings.source.into();
        let errors = |decoupled_mm| TestErrors::measure(&source, &set, decoupled_mm);
        Ok(Some(Self {
            seed: settings.seed,
            repeat,
            errors: errors(&validated.network),
            baselines: Baselines {
                mean: errors(&validated.mean),
                linear: errors(&validated.linear),
                reference: None,
                no_reference: None,
            },
            bottleneck: Some(errors(&bottleneck)),
            networks: validated.folds.count(),
            epochs: validated.effort.epochs,
            seconds: validated.effort.seconds,
            min_epoch_seconds: validated.effort.min_epoch_seconds,
            states: Vec::new(),
        }))
    }
}

/// Returns the best answers possible with so few hidden nodes, for each sample from the training set of its fold.
fn bottleneck_answers(set: &Dataset, validated: &CrossValidated, hidden: usize) -> Result<Array2<f64>, RunError> {
    let folds = &validated.folds;
    let mut answers = Array2::zeros(set.targets().dim());
    for fold in 0..folds.count() {
        let training = validated.training(set, fold);
        let bottleneck = Bottleneck::fit(training.targets(), hidden)?;
        let reconstructed = bottleneck.reconstruct(set.select(folds.test(fold)).targets());
        for (&sample, answer) in folds.test(fold).iter().zip(reconstructed.rows()) {
            answers.row_mut(sample).assign(&answer);
        }
    }
    Ok(answers)
}
