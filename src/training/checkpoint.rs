use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    EpochRecord, MethodState, Problem, SettingError, StopReason, Trainer, TrainingSettings, activations::Activations,
    trainer::Best,
};
use crate::network::{Mlp, Shape};

/// Everything a [`Trainer`] holds but its samples. Resumed with the same samples it gives the same bits as a training
/// that was never interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainerState {
    settings: TrainingSettings,
    shape: Shape,
    weights: Vec<f64>,
    best_weights: Vec<f64>,
    best_epoch: usize,
    best_mse: f64,
    history: Vec<EpochRecord>,
    validation_failures: usize,
    stop_reason: Option<StopReason>,
    elapsed: Duration,
    method: MethodState,
}

/// Why a training cannot be resumed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ResumeError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The parts do not fit together, or contain numbers that are not finite.
    #[error("the saved training is damaged: {0}")]
    Damaged(&'static str),
    /// The network does not fit the samples.
    #[error(
        "the saved network has {} inputs and {} outputs, the samples have {inputs} and {outputs}: resume with the \
         settings it was begun with",
        .shape.inputs, .shape.outputs
    )]
    Shape {
        /// Of the saved network.
        shape: Shape,
        /// Of the samples.
        inputs: usize,
        /// Of the samples.
        outputs: usize,
    },
    /// The saved weights have another error on these samples than they had.
    #[error(
        "the saved training had an error of {saved:e}, on these samples it is {found:e}: resume with the settings it \
         was begun with"
    )]
    OtherSamples {
        /// The training error saved.
        saved: f64,
        /// The training error found.
        found: f64,
    },
}

/// How closely the saved error must be found again. Another machine's rounding stays far below.
const SAME_ERROR: f64 = 1e-6;

impl TrainerState {
    /// How it is trained.
    pub fn settings(&self) -> &TrainingSettings {
        &self.settings
    }

    /// Every epoch so far.
    pub fn history(&self) -> &[EpochRecord] {
        &self.history
    }

    /// Checks what does not depend on the samples.
    fn check(&self) -> Result<(), ResumeError> {
        self.settings.method.check()?;
        self.settings.stopping.check()?;
        let Shape {
            inputs,
            hidden,
            outputs,
        } = self.shape;
        // Checked, since the sizes come from a file.
        let w = inputs.checked_add(1).and_then(|n1| n1.checked_mul(hidden));
        let v = hidden.checked_add(1).and_then(|h1| h1.checked_mul(outputs));
        let expected = w.zip(v).and_then(|(w, v)| w.checked_add(v));
        let sizes = [self.weights.len(), self.best_weights.len()];
        if hidden == 0 || outputs == 0 || sizes.iter().any(|size| Some(*size) != expected) {
            return Err(ResumeError::Damaged("its weights do not fit its layers"));
        }
        let mut weights = self.weights.iter().chain(&self.best_weights);
        if !weights.all(|weight| weight.is_finite()) {
            return Err(ResumeError::Damaged("a weight is not a finite number"));
        }
        if self.history.is_empty() || self.history.iter().enumerate().any(|(epoch, kept)| kept.epoch != epoch) {
            return Err(ResumeError::Damaged("its history has gaps"));
        }
        if !self.method.fits(self.weights.len()) {
            return Err(ResumeError::Damaged("the state of its method does not fit its weights"));
        }
        Ok(())
    }
}

impl Trainer {
    /// The state to be saved.
    pub fn state(&self) -> TrainerState {
        TrainerState {
            settings: self.settings,
            shape: self.mlp.shape(),
            weights: self.mlp.weights().to_vec(),
            best_weights: self.best.mlp.weights().to_vec(),
            best_epoch: self.best.epoch,
            best_mse: self.best.mse,
            history: self.history.clone(),
            validation_failures: self.validation_failures,
            stop_reason: self.stop_reason,
            elapsed: self.elapsed,
            method: self.algorithm.state(),
        }
    }

    /// Goes on where `state` was taken, with the same samples. A training that the user had stopped goes on.
    ///
    /// # Errors
    /// A state that is damaged or belongs to other samples.
    pub fn resume(state: TrainerState, problem: Problem) -> Result<Self, ResumeError> {
        state.check()?;
        let (shape, training) = (state.shape, &problem.training);
        if (shape.inputs, shape.outputs) != (training.inputs(), training.outputs()) {
            return Err(ResumeError::Shape {
                shape,
                inputs: training.inputs(),
                outputs: training.outputs(),
            });
        }
        let mlp = Mlp::from_weights(shape, state.weights);
        let mut activations = Activations::new(shape);
        let found = training.mse(&mlp, &mut activations);
        let saved = state.history.last().map_or(found, |last| last.training_mse);
        // After a divergence the weights are the best ones, not the last.
        let same = found == saved || (found - saved).abs() <= SAME_ERROR * saved.abs();
        if !same && state.stop_reason != Some(StopReason::Diverged) {
            return Err(ResumeError::OtherSamples { saved, found });
        }
        let algorithm = state.settings.method.resume(state.method, &mlp, training);
        let algorithm = algorithm.ok_or(ResumeError::Damaged("the state is that of another method"))?;
        Ok(Self {
            settings: state.settings,
            algorithm,
            best: Best {
                mlp: Mlp::from_weights(shape, state.best_weights),
                epoch: state.best_epoch,
                mse: state.best_mse,
            },
            mlp,
            history: state.history,
            validation_failures: state.validation_failures,
            stop_reason: state.stop_reason.filter(|reason| *reason != StopReason::Stopped),
            elapsed: state.elapsed,
            activations,
            problem,
        })
    }
}
