//! The record of one epoch.

use serde::{Deserialize, Serialize};

/// Errors and state of the training after one epoch; epoch 0 is the start. Errors are mean squared errors in scaled units.
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
    /// Euclidean norm of the gradient of the training error, including the penalty on the weights where the method
    /// regularises.
    pub gradient_norm: f64,
    /// The damping mu, or the learning rate, after this epoch: [`super::Method::parameter_name`].
    pub parameter: f64,
    /// Number of weights that the data determine, where the method estimates it.
    #[serde(default)]
    pub effective_parameters: Option<f64>,
    /// Number of epochs at which the validation error was above its best, since the last new best or since the current
    /// method began.
    pub validation_failures: usize,
}
