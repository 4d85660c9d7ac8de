use serde::{Deserialize, Serialize};

/// What is kept of each epoch; epoch 0 is the start. Errors are mean squared errors in scaled units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochRecord {
    /// Epoch, the start being 0.
    pub epoch: usize,
    /// Error on the training set.
    pub training_mse: f64,
    /// Error on the validation set, if there is one.
    pub validation_mse: Option<f64>,
    /// Error on the test set, if it is watched. It decides nothing.
    pub test_mse: Option<f64>,
    /// Length of the gradient of the training error, the weights' share included where the method regularises.
    pub gradient_norm: f64,
    /// The damping mu, or the learning rate, after this epoch: [`super::Method::parameter_name`].
    pub parameter: f64,
    /// How many weights the data determine, where the method estimates it.
    #[serde(default)]
    pub effective_parameters: Option<f64>,
    /// How often the validation error has risen since it last fell.
    pub validation_failures: usize,
}
