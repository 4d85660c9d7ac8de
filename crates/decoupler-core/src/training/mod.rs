//! Training: methods with their settings, a [`Trainer`] that is stepped one epoch at a time, and why it stopped.
//!
//! Everything here works on scaled values and knows nothing of sensors.

mod activations;
mod adaptive_descent;
mod algorithm;
mod backpropagation;
mod bayesian_regularization;
#[cfg(test)]
mod certified;
mod checkpoint;
mod continuation;
mod correlation_time;
mod damping;
mod defect;
mod elementwise;
mod epoch_columns;
mod evaluation;
mod examples;
mod gradient_descent;
mod history;
mod input_pairs;
mod levenberg_marquardt;
mod memory;
mod method;
mod momentum;
mod normal_equations;
mod parallel;
mod regularization_settings;
mod resilient;
mod scaled_conjugate_gradient;
mod setting;
mod stage;
mod step_momentum;
mod stopping;
mod trainer;
mod variable_projection;

pub use adaptive_descent::AdaptiveDescentSettings;
pub use checkpoint::{ResumeError, TrainerState};
pub use damping::Damping;
pub use defect::TrainingDefect;
pub use epoch_columns::History;
use evaluation::Evaluation;
pub use examples::Examples;
pub(crate) use examples::{BLOCK, DrawnBlocks};
pub use gradient_descent::GradientDescentSettings;
pub use history::EpochRecord;
pub use memory::{MachineMemory, MemorySource};
pub use method::Method;
use method::MethodState;
pub use momentum::MomentumSettings;
use normal_equations::{FactoredEquations, NormalEquations};
pub use regularization_settings::RegularizationSettings;
pub use resilient::ResilientSettings;
pub use scaled_conjugate_gradient::ScaledConjugateGradientSettings;
pub use setting::{Setting, SettingError};
pub use stage::Stage;
pub use step_momentum::StepMomentumSettings;
pub use stopping::{StopReason, StoppingRules};
pub(crate) use trainer::check_width;
pub use trainer::{Problem, Trainer, TrainingError, TrainingSettings};
