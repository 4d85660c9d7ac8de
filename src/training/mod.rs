//! Training: methods with their settings, a [`Trainer`] that is stepped one epoch at a time, and why it stopped.
//!
//! Everything here works on scaled values and knows nothing of sensors.

mod activations;
mod backpropagation;
mod elementwise;
mod examples;
mod history;
mod input_pairs;
mod levenberg_marquardt;
mod method;
mod momentum;
mod normal_equations;
mod setting;
mod stopping;
mod trainer;

pub use examples::Examples;
pub use history::EpochRecord;
pub use levenberg_marquardt::{LevenbergMarquardt, LevenbergMarquardtSettings};
pub use method::Method;
pub use momentum::{Momentum, MomentumSettings};
pub use normal_equations::NormalEquations;
pub use setting::{Setting, SettingError};
pub use stopping::{StopReason, StoppingRules};
pub use trainer::{Problem, Trainer, TrainingError, TrainingSettings};

/// Where a method stands: at the weights it has just reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Mean squared error over samples and outputs, in scaled units.
    pub mse: f64,
    /// Euclidean length of the gradient of [`Self::mse`].
    pub gradient_norm: f64,
}
