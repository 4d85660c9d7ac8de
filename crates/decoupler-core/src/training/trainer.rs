//! A training in progress, stepped one epoch at a time: its stages, the records of its epochs, and the correlation of
//! the errors of neighbouring samples.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    Examples, Method, SettingError, StopReason, TrainingSettings, activations::Activations, method::Algorithm,
};
use crate::{
    machine::MemoryBudget,
    network::{Mlp, Shape},
    text::counted,
};

/// Scaled training, validation and test sets.
#[derive(Clone, Debug)]
pub struct ExampleSets {
    /// Training set.
    pub training: Examples,
    /// Validation set, if one is held out: it decides which weights are best and when to stop.
    pub validation: Option<Examples>,
    /// Test set, if its error is to be displayed.
    pub test: Option<Examples>,
}

/// Reason why a training cannot begin or be resumed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrainingError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// No target varies.
    #[error(
        "every target is constant in the training set: there is nothing to learn; give samples in which a target changes by more than rounding"
    )]
    NothingVaries,
    /// The network has no hidden nodes.
    #[error("the network has no hidden nodes: give at least 1")]
    NoHiddenNodes,
    /// The method's equations need more memory than is available.
    #[error(
        "the network is too wide for this method: the equations of {}{} would take {:.1} GB, and {memory}; use the scaled \
         conjugate gradient (scg), fewer hidden nodes, or fewer starts",
        counted(*.trainings as u64, "training"), if *.trainings > 1 { " at once" } else { "" }, *.bytes as f64 * 1e-9
    )]
    TooWide {
        /// Number of simultaneous trainings.
        trainings: usize,
        /// Memory that they would take, in bytes.
        bytes: u64,
        /// Memory of the machine.
        memory: MemoryBudget,
    },
    /// The parts contradict each other, or contain numbers that are not finite.
    #[error("the saved training is damaged: {0}")]
    Damaged(&'static str),
    /// The network does not fit the samples.
    #[error(
        "the saved network has {} inputs and {} outputs, the samples have {inputs} and {outputs}: resume with the \
         settings it was started with",
        .shape.inputs, .shape.outputs
    )]
    Shape {
        /// Shape of the saved network.
        shape: Shape,
        /// Number of inputs of the samples.
        inputs: usize,
        /// Number of outputs of the samples.
        outputs: usize,
    },
    /// The saved weights have a different error on these samples.
    #[error(
        "the saved training had an error of {saved:e}, on these samples it is {found:e}: resume with the settings and \
         the version of the program it was started with"
    )]
    OtherSamples {
        /// The training error saved.
        saved: f64,
        /// The training error found.
        found: f64,
    },
}

/// Checks that the equations of the method fit into `memory`, with this many simultaneous trainings of this shape.
///
/// # Errors
/// [`TrainingError::TooWide`] if they do not.
pub fn check_width(
    method: &Method,
    shape: Shape,
    samples: usize,
    trainings: usize,
    memory: MemoryBudget,
) -> Result<(), TrainingError> {
    let bytes = (method.equations_bytes(shape, samples) as u64).saturating_mul(trainings as u64);
    let too_wide = TrainingError::TooWide {
        trainings,
        bytes,
        memory,
    };
    if bytes > memory.bytes() { Err(too_wide) } else { Ok(()) }
}

/// A training in progress. It runs one epoch for each call of [`Self::step`], so pausing only means not calling `step`.
pub struct Trainer {
    pub(super) settings: TrainingSettings,
    pub(super) problem: ExampleSets,
    pub(super) algorithm: Box<dyn Algorithm>,
    pub(super) mlp: Mlp,
    pub(super) best: Best,
    pub(super) history: Vec<EpochRecord>,
    pub(super) stages: Vec<Stage>,
    /// Epochs since the last best validation error or since the current method began, see
    /// [`StoppingRules::max_fail`](super::StoppingRules::max_fail).
    pub(super) validation_failures: usize,
    pub(super) stop_reason: Option<StopReason>,
    pub(super) elapsed: Duration,
    pub(super) activations: Activations,
}

/// Weights with the lowest validation error, or with the lowest training error if nothing is held out; in that case the
/// latest weights if the method needs no validation.
#[derive(Debug)]
pub(super) struct Best {
    pub(super) mlp: Mlp,
    pub(super) epoch: usize,
    pub(super) mse: f64,
}

impl Trainer {
    /// Prepares a training from the weights of `start` and records them as epoch 0. Whether its equations fit into memory is
    /// for the caller to check with [`check_width`].
    ///
    /// # Errors
    /// If a setting is out of range, or there is nothing to train.
    pub fn new(start: Mlp, problem: ExampleSets, settings: TrainingSettings) -> Result<Self, TrainingError> {
        settings.check()?;
        if start.shape().outputs == 0 {
            return Err(TrainingError::NothingVaries);
        }
        if start.shape().hidden == 0 {
            return Err(TrainingError::NoHiddenNodes);
        }
        let begun = Instant::now();
        let (algorithm, evaluation) = settings.method.start(&start, &problem.training);
        let mut trainer = Self {
            settings,
            algorithm,
            best: Best {
                mlp: start.clone(),
                epoch: 0,
                mse: f64::INFINITY,
            },
            history: Vec::new(),
            stages: vec![Stage {
                first_epoch: 0,
                method: settings.method,
            }],
            validation_failures: 0,
            stop_reason: None,
            elapsed: Duration::ZERO,
            activations: Activations::new(start.shape()),
            mlp: start,
            problem,
        };
        trainer.record(evaluation);
        trainer.elapsed = begun.elapsed();
        Ok(trainer)
    }

    /// Runs one epoch, unless the training has ended. Returns the reason for ending if it has ended.
    pub fn step(&mut self) -> Option<StopReason> {
        if self.stop_reason.is_none() {
            let begun = Instant::now();
            match self.algorithm.step(&mut self.mlp, &self.problem.training) {
                Ok(evaluation) => self.record(evaluation),
                Err(reason) => {
                    self.stop_reason = Some(reason);
                    self.restart_method();
                }
            }
            if self.stop_reason == Some(StopReason::Diverged) {
                self.mlp.weights_mut().copy_from_slice(self.best.mlp.weights());
                self.restart_method();
            }
            self.elapsed = self.elapsed.saturating_add(begun.elapsed());
        }
        self.stop_reason
    }

    /// Restarts the method after it stopped, when its state may not be finite, so that the state can be saved and other
    /// stopping rules can continue the training.
    fn restart_method(&mut self) {
        (self.algorithm, _) = self.settings.method.start(&self.mlp, &self.problem.training);
    }

    /// Ends the training at the user's request.
    pub fn stop(&mut self) {
        self.stop_reason.get_or_insert(StopReason::Stopped);
    }

    fn record(&mut self, evaluation: Evaluation) {
        let Evaluation { mse, gradient_norm } = evaluation;
        let mut watch = |examples| self.activations.mse(&self.mlp, examples);
        let validation_mse = self.problem.validation.as_ref().map(&mut watch);
        let test_mse = self.problem.test.as_ref().map(&mut watch);
        let deciding = validation_mse.unwrap_or(mse);
        let epoch = self.history.len();
        // Regularised weights are best at the minimum of the regularised error, not of the training error.
        let is_regularized = validation_mse.is_none() && !self.settings.method.needs_validation();
        let is_best = deciding < self.best.mse || is_regularized && deciding.is_finite();
        if is_best {
            self.best.mse = deciding;
            self.best.epoch = epoch;
            self.best.mlp.weights_mut().copy_from_slice(self.mlp.weights());
            self.validation_failures = 0;
        } else if validation_mse.is_some_and(|mse| mse.is_nan() || mse > self.best.mse) {
            self.validation_failures += 1;
        }
        let latest = EpochRecord {
            epoch,
            training_mse: mse,
            validation_mse,
            test_mse,
            gradient_norm,
            parameter: self.algorithm.parameter(),
            effective_parameters: self.algorithm.effective_parameters(),
            validation_failures: self.validation_failures,
        };
        self.history.push(latest);
        self.stop_reason = self.reason_to_stop(&latest);
    }

    pub(super) fn reason_to_stop(&self, latest: &EpochRecord) -> Option<StopReason> {
        let rules = self.settings.stopping;
        let failed_to_validate = self.validation_failures >= rules.max_fail;
        let mse = latest.training_mse;
        let start_mse = self.history.first().map_or(f64::INFINITY, |start| start.training_mse);
        let reasons = [
            (!mse.is_finite(), StopReason::Diverged),
            // A validation error that stays above its best while the training error is above its initial value is not
            // overfitting.
            (failed_to_validate && mse > start_mse, StopReason::Diverged),
            (mse <= rules.goal_mse, StopReason::GoalReached),
            (latest.gradient_norm <= rules.min_gradient, StopReason::GradientSmall),
            (failed_to_validate, StopReason::ValidationRose),
            (latest.epoch >= rules.epochs, StopReason::EpochsReached),
        ];
        reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
    }

    /// Number of training samples.
    pub fn samples(&self) -> usize {
        self.problem.training.samples()
    }

    /// Returns the method and the stopping rules.
    pub fn settings(&self) -> &TrainingSettings {
        &self.settings
    }

    /// Returns the current weights, from which another method would continue.
    pub fn present(&self) -> &Mlp {
        &self.mlp
    }

    /// Returns the best weights so far: those with the lowest validation error, or with the lowest training error if
    /// nothing is held out. Bayesian regularisation, which does not minimise the training error, then returns the
    /// latest.
    pub fn best(&self) -> &Mlp {
        &self.best.mlp
    }

    /// Returns the epoch of [`Self::best`].
    pub fn best_epoch(&self) -> usize {
        self.best.epoch
    }

    /// Returns the error of [`Self::best`]: on the validation set, or on the training set if nothing is held out.
    pub fn best_mse(&self) -> f64 {
        self.best.mse
    }

    /// Returns the stages so far, in order.
    pub fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// Returns the records of all epochs so far, beginning with the start.
    pub fn history(&self) -> &[EpochRecord] {
        &self.history
    }

    /// Returns the record of the latest epoch.
    pub fn latest(&self) -> &EpochRecord {
        self.history
            .last()
            .expect("the start is recorded when the trainer is created")
    }

    /// Returns the reason why the training has ended, if it has.
    pub fn stop_reason(&self) -> Option<StopReason> {
        self.stop_reason
    }

    /// Returns the time spent in training, without pauses.
    pub fn elapsed(&self) -> Duration {
        self.elapsed
    }
}

/// Stage of a training: its epochs with one method. [`super::Trainer::continue_with`] begins the next stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// First epoch with this method; 0 for the first stage.
    pub first_epoch: usize,
    /// Method with its settings.
    pub method: Method,
}

/// Errors and state of the training after one epoch; epoch 0 is the start. Errors are mean squared errors in scaled
/// units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochRecord {
    /// Number of the epoch; 0 is the start.
    pub epoch: usize,
    /// Error on the training set.
    pub training_mse: f64,
    /// Error on the validation set, if there is one.
    pub validation_mse: Option<f64>,
    /// Error on the test set, if there is one. It is only displayed.
    pub test_mse: Option<f64>,
    /// Euclidean norm of the gradient of the training error, including the penalty on the weights if the method
    /// regularises.
    pub gradient_norm: f64,
    /// Parameter of the method after this epoch, such as the damping mu: [`super::Method::parameter_name`].
    pub parameter: f64,
    /// Effective number of weights determined by the data, if the method estimates it.
    #[serde(default)]
    pub effective_parameters: Option<f64>,
    /// Number of epochs at which the validation error was above its best, since the last new best or since the current
    /// method began.
    pub validation_failures: usize,
}

/// Error and gradient at the current weights of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Mean squared error over samples and outputs, in scaled units.
    pub mse: f64,
    /// Euclidean norm of the gradient of the objective: [`Self::mse`] plus the penalty on the weights if the method
    /// regularises.
    pub gradient_norm: f64,
}

impl Evaluation {
    /// Returns the evaluation if it is finite.
    ///
    /// # Errors
    /// [`StopReason::Diverged`] if it does not.
    pub(super) fn if_finite(self) -> Result<Self, StopReason> {
        let is_finite = self.mse.is_finite() && self.gradient_norm.is_finite();
        if is_finite { Ok(self) } else { Err(StopReason::Diverged) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Shape;

    #[test]
    fn simultaneous_trainings_share_the_memory() {
        let shape = Shape {
            inputs: 30,
            hidden: 12,
            outputs: 30,
        };
        let memory = MemoryBudget::User(1_000_000_000);
        let check = |trainings| check_width(&Method::default(), shape, 1000, trainings, memory);
        assert_eq!(check(1), Ok(()));
        let refused = check(1_000_000_000).unwrap_err().to_string();
        assert!(
            refused.contains("of 1000000000 trainings at once would take"),
            "{refused}"
        );
    }
}
