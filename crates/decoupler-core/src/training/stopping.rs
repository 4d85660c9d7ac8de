//! Stopping rules, and the reason why a training ended.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Method, SettingError};

/// Rules that end a training by themselves, with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoppingRules {
    /// Maximum number of epochs.
    pub epochs: usize,
    /// Training error (mean squared, in scaled units) at which training ends.
    pub goal_mse: f64,
    /// Length of the gradient at which training ends.
    pub min_gradient: f64,
    /// Maximum number of validation failures: epochs, since the last new best validation error, at which it was above
    /// the best. An error equal to the best counts neither way.
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
    /// Largest number of epochs that can be set.
    pub const MAX_EPOCHS: usize = 1_000_000;

    /// Checks the ranges.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        let most = Self::MAX_EPOCHS as f64;
        let values = [
            ("epochs", self.epochs as f64, 1.0..=most),
            ("goal", self.goal_mse, 0.0..=f64::MAX),
            ("smallest gradient", self.min_gradient, 0.0..=f64::MAX),
            ("validation failures", self.max_fail as f64, 1.0..=most),
        ];
        match values.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => Err(SettingError::Range { name, value, range }),
            None => Ok(()),
        }
    }
}

/// Reason why a training ended. Ending is a result, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The maximum number of epochs was run.
    EpochsReached,
    /// The training error reached the goal.
    GoalReached,
    /// The length of the gradient fell to its limit.
    GradientSmall,
    /// No step with a damping mu up to its limit lowers the error.
    MuLarge,
    /// The scale lambda of the scaled conjugate gradient overflowed: no step along its direction lowers the error.
    LambdaLarge,
    /// The validation error did not reach a new best for [`StoppingRules::max_fail`] epochs.
    ValidationRose,
    /// The error or its gradient was no longer finite, or the training error was above the initial one when the validation
    /// failures reached their limit. The best weights before that are kept.
    Diverged,
    /// The user stopped it.
    Stopped,
}

impl StopReason {
    /// Tells whether the error fell as it should until the training ended.
    pub fn was_successful(self) -> bool {
        self != Self::Diverged
    }

    /// Says what to change after a training of this method that ended so, where its network is not good enough.
    pub fn remedy(self, method: &Method) -> String {
        match self {
            Self::Diverged => method.cure(),
            Self::EpochsReached | Self::Stopped => "train for more epochs, or with more hidden nodes".to_owned(),
            Self::ValidationRose => {
                "draw more training samples, or take another seed or another number of hidden nodes".to_owned()
            }
            Self::GoalReached => "set a lower goal".to_owned(),
            Self::GradientSmall | Self::MuLarge | Self::LambdaLarge => {
                "it is stuck: take another seed, or more hidden nodes".to_owned()
            }
        }
    }

    /// Tells whether other stopping rules could have let the training continue: not if the user stopped it or the method
    /// found no further step.
    pub(super) fn depends_on_rules(self) -> bool {
        !matches!(self, Self::Stopped | Self::Diverged | Self::MuLarge | Self::LambdaLarge)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::EpochsReached => "all epochs done",
            Self::GoalReached => "goal reached",
            Self::GradientSmall => "gradient below its limit: no further progress to make",
            Self::MuLarge => "mu above its limit: no step lowers the error",
            Self::LambdaLarge => "lambda above its limit: no step lowers the error",
            Self::ValidationRose => "validation error no longer falls",
            Self::Diverged => "diverged: the error grew above that of the start",
            Self::Stopped => "stopped by you",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reasons_in_files_keep_their_names() {
        let table = [
            ("epochs_reached", StopReason::EpochsReached),
            ("goal_reached", StopReason::GoalReached),
            ("gradient_small", StopReason::GradientSmall),
            ("mu_large", StopReason::MuLarge),
            ("lambda_large", StopReason::LambdaLarge),
            ("validation_rose", StopReason::ValidationRose),
            ("diverged", StopReason::Diverged),
            ("stopped", StopReason::Stopped),
        ];
        for (name, reason) in table {
            let text = format!("\"{name}\"");
            assert_eq!(serde_json::from_str::<StopReason>(&text).unwrap(), reason);
            assert_eq!(serde_json::to_string(&reason).unwrap(), text);
        }
    }
}
