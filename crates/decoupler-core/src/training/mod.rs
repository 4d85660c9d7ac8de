//! Training: methods with their settings, a [`Trainer`] that is stepped one epoch at a time, and the reasons for
//! stopping.
//!
//! Everything here works on scaled values and is independent of sensors.

mod activations;
mod bayesian_regularization;
mod checkpoint;
mod epoch_columns;
mod examples;
mod gradient_descent;
mod levenberg_marquardt;
mod method;
mod normal_equations;
mod parallel;
mod scaled_conjugate_gradient;
mod setting;
#[cfg(test)]
mod tests;
mod trainer;

pub use bayesian_regularization::RegularizationSettings;
pub use checkpoint::{ResumeError, TrainerState};
pub use epoch_columns::History;
pub use examples::Examples;
pub use gradient_descent::{
    AdaptiveDescentSettings, GradientDescentSettings, MomentumSettings, ResilientSettings, StepMomentumSettings,
};
pub use levenberg_marquardt::Damping;
pub use method::Method;
use method::MethodState;
pub use scaled_conjugate_gradient::ScaledConjugateGradientSettings;
pub use setting::{Setting, SettingError, StopReason, StoppingRules, TrainingDefect};
use trainer::Evaluation;
pub use trainer::{EpochRecord, Problem, Stage, Trainer, TrainingError, TrainingSettings, check_width};
