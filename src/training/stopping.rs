use std::fmt;

use serde::{Deserialize, Serialize};

use super::SettingError;

/// When a training ends by itself, with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoppingRules {
    /// Most epochs.
    pub epochs: usize,
    /// Training error (mse, scaled) that is good enough.
    pub goal_mse: f64,
    /// Length of the gradient below which the surface is taken as flat.
    pub min_gradient: f64,
    /// How often the validation error may rise from one epoch to the next before it falls again.
    pub max_fail: usize,
}

impl Default for StoppingRules {
    fn default() -> Self {
        Self {
            epochs: 1000,
            goal_mse: 0.0,
            min_gradient: 1e-7,
            max_fail: 6,
        }
    }
}

impl StoppingRules {
    /// The most epochs offered.
    pub const MOST_EPOCHS: usize = 1_000_000;

    /// Checks the ranges.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        let most = Self::MOST_EPOCHS as f64;
        let values = [
            ("epochs", self.epochs as f64, 1.0..=most),
            ("goal", self.goal_mse, 0.0..=f64::MAX),
            ("smallest gradient", self.min_gradient, 0.0..=f64::MAX),
            ("validation failures", self.max_fail as f64, 1.0..=most),
        ];
        match values.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => Err(SettingError { name, value, range }),
            None => Ok(()),
        }
    }
}

/// Why a training ended. Ending is a result, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// All epochs were run.
    EpochsReached,
    /// The training error reached the goal.
    GoalReached,
    /// The gradient became as small as was asked.
    GradientSmall,
    /// No damping up to the largest one lowers the error.
    MuLarge,
    /// The validation error rose too often.
    ValidationRose,
    /// The error became infinite; the best weights before that are kept.
    Diverged,
    /// The user stopped it.
    Stopped,
}

impl StopReason {
    /// Whether the network's error was still finite and the method ended as it should.
    pub fn was_successful(self) -> bool {
        self != Self::Diverged
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::EpochsReached => "all epochs done",
            Self::GoalReached => "goal reached",
            Self::GradientSmall => "gradient below its limit: no further progress to make",
            Self::MuLarge => "mu above its limit: no step lowers the error",
            Self::ValidationRose => "validation error no longer falls",
            Self::Diverged => "error grew without bound: lower the learning rate",
            Self::Stopped => "stopped by you",
        })
    }
}
