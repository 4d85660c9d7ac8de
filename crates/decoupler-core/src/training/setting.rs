//! Numeric settings, stopping rules, the reasons why a training ends, and defects of a training that has ended.

use std::{fmt, ops::RangeInclusive};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{EpochRecord, Method, Trainer};
use crate::{sensor::short, text::counted};

/// Numeric setting, as offered by the window and the terminal.
#[derive(Debug)]
pub struct Setting<'a> {
    /// Name of the setting.
    pub name: &'static str,
    /// Explanation, in one or two sentences.
    pub meaning: &'static str,
    /// Default value.
    pub default: f64,
    /// Allowed values.
    pub range: RangeInclusive<f64>,
    /// `true` if the value must be an integer.
    pub is_whole: bool,
    /// Current value.
    pub value: &'a mut f64,
}

/// Settings of a method, for display and editing.
pub(super) trait Settings: Default {
    /// Returns the settings, given the method's defaults.
    fn list(&mut self, default: Self) -> Vec<Setting<'_>>;
}

/// Marks an integer setting.
pub(super) const WHOLE: bool = true;

/// Defines the settings of a method: for each number its field, [WHOLE] if it is an integer, its name, the field's
/// usual default, the allowed values, and its meaning.
macro_rules! settings {
    (
        $(#[$doc:meta])*
        pub struct $Settings:ident {
            $($field:ident $([$whole:ident])?: $name:literal = $default:expr, in $range:expr, $meaning:literal;)*
        }
    ) => {
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $(#[$doc])*
        pub struct $Settings {
            $(#[doc = $meaning] pub $field: f64,)*
        }

        impl Default for $Settings {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl crate::training::setting::Settings for $Settings {
            fn list(&mut self, default: Self) -> Vec<crate::training::Setting<'_>> {
                vec![$(crate::training::Setting {
                    name: $name,
                    meaning: $meaning,
                    default: default.$field,
                    range: $range,
                    is_whole: false $(|| $whole)?,
                    value: &mut self.$field,
                },)*]
            }
        }
    };
}
pub(super) use settings;

/// Error for an invalid setting.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SettingError {
    /// A setting is out of its range.
    #[error("{name} is {}: it must be from {} to {}", short(*.value), short(*.range.start()), short(*.range.end()))]
    Range {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Allowed values.
        range: RangeInclusive<f64>,
    },
    /// An integer setting has a fraction.
    #[error("{name} is {}: it must be a whole number", short(*.value))]
    NotWhole {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// An initial value is above the largest that the method may reach.
    #[error(
        "{name} is {}, above {limit_name}, which is {}: lower {name}, or raise {limit_name}",
        short(*.value), short(*.limit)
    )]
    AboveLimit {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Name of the setting that limits it.
        limit_name: &'static str,
        /// Value of the limit.
        limit: f64,
    },
}

impl Setting<'_> {
    /// Checks that the value is in range; NaN is always out of range.
    ///
    /// # Errors
    /// If the value is out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        if self.range.contains(self.value) {
            return if self.is_whole && self.value.fract() != 0.0 {
                Err(SettingError::NotWhole {
                    name: self.name,
                    value: *self.value,
                })
            } else {
                Ok(())
            };
        }
        Err(SettingError::Range {
            name: self.name,
            value: *self.value,
            range: self.range.clone(),
        })
    }
}

/// Maximum share of the previous step in each step. At 1 the gradient has no share, and no weight ever moves.
pub(super) const MAX_MOMENTUM: f64 = 0.999_999;

/// Checks that the initial value of `name` does not exceed its limit.
pub(super) fn check_limit(
    (name, value): (&'static str, f64),
    (limit_name, limit): (&'static str, f64),
) -> Result<(), SettingError> {
    if value <= limit {
        return Ok(());
    }
    Err(SettingError::AboveLimit {
        name,
        value,
        limit_name,
        limit,
    })
}

/// Defect of a training that has ended. Its text describes the problem and the remedy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingDefect {
    /// Epoch from which on the error stayed above its initial value, if the training diverged.
    pub diverged_in: Option<usize>,
    /// `true` if the best network is hardly better than the random start: [`TrainingDefect::MIN_GAIN`].
    pub is_at_start: bool,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Number of epochs run.
    pub epochs: usize,
    /// Reason why the training ended.
    pub reason: StopReason,
    /// The method with its settings.
    pub method: Method,
}

impl TrainingDefect {
    /// Relative decrease of the selection error (validation error, or training error if nothing is held out) from the
    /// start at which the network counts as trained.
    pub const MIN_GAIN: f64 = 0.01;

    /// Returns the defect of a training; `None` if it has no defect or has not ended.
    pub fn of(trainer: &Trainer) -> Option<Self> {
        let reason = trainer.stop_reason()?;
        let start = trainer.history().first()?;
        let start_mse = start.validation_mse.unwrap_or(start.training_mse);
        let enough = (1.0 - Self::MIN_GAIN) * start_mse;
        let defect = Self {
            diverged_in: diverged_in(trainer.history(), reason),
            // False if the start has no error, which nothing can improve; true if its error is NaN.
            is_at_start: start_mse != 0.0 && (trainer.best_mse() >= enough || enough.is_nan()),
            best_epoch: trainer.best_epoch(),
            epochs: trainer.latest().epoch,
            reason,
            method: trainer.settings().method,
        };
        (defect.diverged_in.is_some() || defect.is_at_start).then_some(defect)
    }

    /// Returns advice on the setting to change.
    pub fn remedy(&self) -> String {
        match self.reason {
            StopReason::GoalReached => "set a lower goal".to_owned(),
            StopReason::GradientSmall if self.diverged_in.is_none() => {
                format!("set a lower smallest gradient; or {}", self.method.remedy())
            }
            StopReason::Stopped if self.diverged_in.is_none() => "let it run longer".to_owned(),
            _ => self.method.remedy(),
        }
    }
}

/// Returns the first epoch from which on the training error is above its initial value; an epoch whose error was NaN is
/// not in the history.
fn diverged_in(history: &[EpochRecord], reason: StopReason) -> Option<usize> {
    let start_mse = history.first()?.training_mse;
    let is_below = |record: &EpochRecord| record.training_mse <= start_mse;
    let after = history.iter().rposition(is_below).map_or(0, |last| last + 1);
    (after < history.len() || reason == StopReason::Diverged).then_some(after)
}

impl fmt::Display for TrainingDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { epochs, best_epoch, .. } = self;
        match (self.diverged_in, self.is_at_start) {
            (Some(epoch), true) => write!(
                f,
                "training diverged in epoch {epoch}, and the network is no better than its random start"
            )?,
            (Some(epoch), false) => write!(
                f,
                "training diverged in epoch {epoch}; the network is the best before that, of epoch {best_epoch}"
            )?,
            (None, _) => write!(
                f,
                "the network is no better than its random start after {} ({})",
                counted(*epochs, "epoch"),
                self.reason
            )?,
        }
        write!(f, ": {}", self.remedy())
    }
}

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
    /// Maximum number of validation failures: epochs since the last new best validation error at which the error was
    /// above the best. An error equal to the best is neither a failure nor a new best.
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
    /// Returns the default rules for a training on a recording with this method.
    ///
    /// Methods that [follow gradients](Method::follows_gradients) get more epochs and more patience: their validation
    /// error rises for some epochs long before the end, and 6 failures stop them far from any minimum.
    pub fn recorded(method: &Method) -> Self {
        let (epochs, max_fail) = if method.follows_gradients() {
            (2000, 100)
        } else {
            (300, 6)
        };
        Self {
            epochs,
            max_fail,
            ..Self::default()
        }
    }

    /// Largest number of epochs that can be set.
    pub const MAX_EPOCHS: usize = 1_000_000;

    /// Checks that the rules are in range.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        let max = Self::MAX_EPOCHS as f64;
        let values = [
            ("epochs", self.epochs as f64, 1.0..=max),
            ("goal", self.goal_mse, 0.0..=f64::MAX),
            ("smallest gradient", self.min_gradient, 0.0..=f64::MAX),
            ("validation failures", self.max_fail as f64, 1.0..=max),
        ];
        match values.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => Err(SettingError::Range { name, value, range }),
            None => Ok(()),
        }
    }
}

/// Reason why a training ended: a result, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The maximum number of epochs was run.
    EpochsReached,
    /// The training error reached the goal.
    GoalReached,
    /// The length of the gradient reached its lower limit.
    GradientSmall,
    /// No step with a damping mu up to its limit lowers the error.
    MuLarge,
    /// The scale lambda of the scaled conjugate gradient overflowed: no step along its direction lowers the error.
    LambdaLarge,
    /// The validation error did not reach a new best for [`StoppingRules::max_fail`] epochs.
    ValidationRose,
    /// The error or its gradient was no longer finite, or the training error was above its initial value when the
    /// validation failures reached their limit. The best weights before that are kept.
    Diverged,
    /// The user stopped the training.
    Stopped,
}

impl StopReason {
    /// Returns `true` if the training did not diverge.
    pub fn was_successful(self) -> bool {
        self != Self::Diverged
    }

    /// Returns advice for a training of this method that ended for this reason with a network that is not good enough.
    pub fn remedy(self, method: &Method) -> String {
        match self {
            Self::Diverged => method.remedy(),
            Self::EpochsReached | Self::Stopped => "train for more epochs, or with more hidden nodes".to_owned(),
            Self::ValidationRose => {
                "draw more training samples, or try another seed or another number of hidden nodes".to_owned()
            }
            Self::GoalReached => "set a lower goal".to_owned(),
            Self::GradientSmall | Self::MuLarge | Self::LambdaLarge => {
                "the training is stuck: try another seed, or more hidden nodes".to_owned()
            }
        }
    }

    /// Returns `true` if other stopping rules could have let the training continue, and `false` if the user stopped it
    /// or the method found no further step.
    pub(super) fn depends_on_rules(self) -> bool {
        !matches!(self, Self::Stopped | Self::Diverged | Self::MuLarge | Self::LambdaLarge)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::EpochsReached => "all epochs done",
            Self::GoalReached => "goal reached",
            Self::GradientSmall => "gradient below its limit: no further progress possible",
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
    use crate::training::{Method, RegularizationSettings};

    #[test]
    fn integer_settings_reject_fractions() {
        for (groups, correlation_epoch, is_valid) in [
            (2.0, 0.0, true),
            (2.5, 0.0, false),
            (4.0, 100.0, true),
            (4.0, 0.5, false),
            (f64::NAN, 0.0, false),
        ] {
            let settings = RegularizationSettings {
                groups,
                correlation_epoch,
                ..RegularizationSettings::default()
            };
            let checked = Method::BayesianRegularization(settings).check();
            assert_eq!(checked.is_ok(), is_valid, "{groups} {correlation_epoch}: {checked:?}");
        }
        let settings = RegularizationSettings {
            groups: 2.5,
            ..RegularizationSettings::default()
        };
        let message = Method::BayesianRegularization(settings)
            .check()
            .unwrap_err()
            .to_string();
        assert_eq!(message, "groups of weights is 2.5: it must be a whole number");
    }

    #[test]
    fn stop_reasons_have_fixed_names_in_files() {
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
