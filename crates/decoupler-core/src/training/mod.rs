//! Training: methods, a [`Trainer`] that is stepped one epoch at a time, and the reasons for
//! stopping.
//!
//! Everything here works on scaled values and is independent of sensors.

mod activations;
mod bayesian_regularization;
mod checkpoint;
mod ending;
pub mod epoch_columns;
mod examples;
mod gradient_descent;
mod levenberg_marquardt;
mod method;
mod normal_equations;
mod parallel;
mod scaled_conjugate_gradient;
#[cfg(test)]
mod tests;
mod trainer;

pub use crate::settings::{
    AdaptiveSettings, ConjugateSettings, Damping, Method, MomentumSettings, RegularizationSettings, ResilientSettings,
    SettingError, StoppingRules, TrainingSettings,
};
pub use checkpoint::TrainerState;
pub use ending::StopReason;
pub use examples::Examples;
use method::MethodState;
pub(crate) use parallel::for_each_part;
use trainer::Evaluation;
pub use trainer::{EpochRecord, ExampleSets, Stage, Trainer, TrainingError, check_width};
