//! Saving and resuming the state of a training, and continuing it with another method or other stopping rules.

use std::{
    mem::discriminant,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

use super::{
    EpochRecord, ExampleSets, Method, MethodState, SettingError, Stage, StopReason, StoppingRules, Trainer,
    TrainingError, TrainingSettings, activations::Activations, trainer::Best,
};
use crate::network::{Mlp, Shape};

/// State of a [`Trainer`] except its samples. A training resumed with the same samples gives bit-identical
/// results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainerState {
    settings: TrainingSettings,
    shape: Shape,
    weights: Vec<f64>,
    /// Training error of `weights`, to check that the samples are the same.
    mse: f64,
    best_weights: Vec<f64>,
    best_epoch: usize,
    #[serde(with = "super::epoch_columns")]
    history: Vec<EpochRecord>,
    stages: Vec<Stage>,
    validation_failures: usize,
    stop_reason: Option<StopReason>,
    elapsed: Duration,
    method: MethodState,
}

/// Relative difference up to which two training errors count as the same. Rounding on another machine stays far below.
const SAME_ERROR: f64 = 1e-6;

impl TrainerState {
    /// Returns the records of all epochs so far.
    pub fn history(&self) -> &[EpochRecord] {
        &self.history
    }

    /// Checks everything that does not depend on the samples.
    fn check(&self) -> Result<(), TrainingError> {
        self.settings.check()?;
        self.stages.iter().try_for_each(|stage| stage.method.check())?;
        let Shape {
            inputs,
            hidden,
            outputs,
        } = self.shape;
        // Checked, since the sizes come from a file.
        let w = inputs.checked_add(1).and_then(|n1| n1.checked_mul(hidden));
        let v = hidden.checked_add(1).and_then(|h1| h1.checked_mul(outputs));
        let expected = w.zip(v).and_then(|(w, v)| w.checked_add(v));
        let fit = |weights: &Vec<f64>| Some(weights.len()) == expected;
        let (mut weights, history) = (self.weights.iter().chain(&self.best_weights), self.history());
        let first_epochs = || self.stages.iter().map(|stage| stage.first_epoch);
        let has_gap = || history.iter().enumerate().any(|(epoch, kept)| kept.epoch != epoch);
        let has_layers = hidden > 0 && outputs > 0;
        let defect = if !(has_layers && fit(&self.weights) && fit(&self.best_weights)) {
            "its weights do not fit its layers"
        } else if !weights.all(|weight| weight.is_finite()) {
            "a weight is not a finite number"
        } else if history.is_empty() || has_gap() {
            "its history has gaps"
        } else if self.best_epoch >= history.len() {
            "its best epoch is after the last"
        } else if first_epochs().next() != Some(0) || !first_epochs().is_sorted() {
            "its methods are out of order"
        } else if !self.method.fits(self.weights.len()) {
            "the state of its method does not fit its weights"
        } else {
            return Ok(());
        };
        Err(TrainingError::Damaged(defect))
    }
}

impl Trainer {
    /// Returns the state, to be saved.
    pub fn state(&self) -> TrainerState {
        TrainerState {
            settings: self.settings,
            shape: self.mlp.shape(),
            weights: self.mlp.weights().to_vec(),
            mse: Activations::new(self.mlp.shape()).mse(&self.mlp, &self.problem.training),
            best_weights: self.best.mlp.weights().to_vec(),
            best_epoch: self.best.epoch,
            history: self.history.clone(),
            stages: self.stages.clone(),
            validation_failures: self.validation_failures,
            stop_reason: self.stop_reason,
            elapsed: self.elapsed,
            method: self.algorithm.state(),
        }
    }

    /// Resumes a training from `state`, with the same samples. A training that the user had stopped continues.
    ///
    /// # Errors
    /// If the state is damaged or belongs to other samples.
    pub fn resume(state: TrainerState, problem: ExampleSets) -> Result<Self, TrainingError> {
        state.check()?;
        let (shape, training) = (state.shape, &problem.training);
        if (shape.inputs, shape.outputs) != (training.inputs(), training.outputs()) {
            return Err(TrainingError::Shape {
                shape,
                inputs: training.inputs(),
                outputs: training.outputs(),
            });
        }
        let mlp = Mlp::from_weights(shape, state.weights);
        let mut activations = Activations::new(shape);
        let (saved, found) = (state.mse, activations.mse(&mlp, training));
        // False for NaN.
        let is_same = (found - saved).abs() <= SAME_ERROR * saved.abs();
        if !is_same {
            return Err(TrainingError::OtherSamples { saved, found });
        }
        let (mut algorithm, _) = state.settings.method.start(&mlp, training);
        if discriminant(&algorithm.state()) != discriminant(&state.method) {
            return Err(TrainingError::Damaged("the state belongs to another method"));
        }
        algorithm.restore(state.method);
        let best = state.history[state.best_epoch];
        let best_mse = best.validation_mse.unwrap_or(best.training_mse);
        Ok(Self {
            settings: state.settings,
            algorithm,
            best: Best {
                mlp: Mlp::from_weights(shape, state.best_weights),
                epoch: state.best_epoch,
                mse: if best_mse.is_nan() { f64::INFINITY } else { best_mse },
            },
            mlp,
            history: state.history,
            stages: state.stages,
            validation_failures: state.validation_failures,
            stop_reason: state.stop_reason.filter(|reason| *reason != StopReason::Stopped),
            elapsed: state.elapsed,
            activations,
            problem,
        })
    }

    /// Continues from the current weights with another method (momentum first, Levenberg-Marquardt to finish), even if
    /// the training has ended, unless all epochs were run. The epoch count continues; the count of validation failures
    /// restarts from 0, but the best validation error so far remains the one to beat.
    ///
    /// # Errors
    /// If a setting is out of range; nothing is then changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), TrainingError> {
        method.check()?;
        let begun = Instant::now();
        let first_epoch = self.latest().epoch + 1;
        self.stages.retain(|stage| stage.first_epoch < first_epoch);
        self.stages.push(Stage { first_epoch, method });
        self.settings.method = method;
        (self.algorithm, _) = method.start(&self.mlp, &self.problem.training);
        self.validation_failures = 0;
        let all_run = self.latest().epoch >= self.settings.stopping.epochs;
        self.stop_reason = all_run.then_some(StopReason::EpochsReached);
        self.elapsed += begun.elapsed();
        Ok(())
    }

    /// Replaces the stopping rules. The training continues if the new rules do not end it at its current epoch, for
    /// instance with more epochs; otherwise it ends.
    ///
    /// # Errors
    /// If a setting is out of range; nothing is then changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        stopping.check()?;
        let is_changed = stopping != self.settings.stopping;
        self.settings.stopping = stopping;
        if is_changed && self.stop_reason.is_none_or(StopReason::depends_on_rules) {
            self.stop_reason = self.reason_to_stop(self.latest());
        }
        Ok(())
    }
}
