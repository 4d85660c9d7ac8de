//! Numbers that the user can set.
//!
//! Defects of a training that has ended.

use std::{fmt, ops::RangeInclusive};

use thiserror::Error;

use super::{EpochRecord, Method, StopReason, Trainer};
use crate::sensor::short;

/// One number that can be set, as the window and the terminal offer it.
#[derive(Debug)]
pub struct Setting<'a> {
    /// Name.
    pub name: &'static str,
    /// Explanation, in one or two sentences.
    pub meaning: &'static str,
    /// Default value.
    pub default: f64,
    /// Allowed values.
    pub range: RangeInclusive<f64>,
    /// True for a number that counts.
    pub is_whole: bool,
    /// The current value.
    pub value: &'a mut f64,
}

/// The settings of a method, to be shown and changed.
pub(super) trait Settings: Default {
    /// Lists them, given the method's defaults.
    fn list(&mut self, default: Self) -> Vec<Setting<'_>>;
}

/// Marks a setting that is a whole number.
pub(super) const WHOLE: bool = true;

/// Defines the settings of a method: for each number its field, [WHOLE] if it counts, its name, the field's usual default, the allowed values,
/// and its meaning.
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

/// A setting with which no training can work.
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
    /// A number that counts has a fraction.
    #[error("{name} is {}: it must be a whole number", short(*.value))]
    NotWhole {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A first value is above the largest that the method may reach.
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
    /// Checks that the value is in range; NaN is in no range.
    ///
    /// # Errors
    /// The value is out of range.
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

/// Largest share of the previous step in each step. At 1 the gradient has no share, and no weight ever moves.
pub(super) const LARGEST_MOMENTUM: f64 = 0.999_999;

/// Checks that the first value of `name` does not exceed its limit.
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

/// Defect of a training that has ended: what happened, and what to change. Its text says both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingDefect {
    /// Epoch in which the error grew above that of the start and stayed there, if it did.
    pub diverged_in: Option<usize>,
    /// True if the best network is hardly better than the random start: [`TrainingDefect::MIN_GAIN`].
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
    /// Share by which the error that decides (validation, or training where nothing is held out) must fall below that of
    /// the start for the network to count as trained.
    pub const MIN_GAIN: f64 = 0.01;

    /// Finds the defect of a training; `None` for a sound one and for one that has not ended.
    pub fn of(trainer: &Trainer) -> Option<Self> {
        let reason = trainer.stop_reason()?;
        let start = trainer.history().first()?;
        let start_mse = start.validation_mse.unwrap_or(start.training_mse);
        let enough = (1.0 - Self::MIN_GAIN) * start_mse;
        let defect = Self {
            diverged_in: diverged_in(trainer.history(), reason),
            // False for a start without any error, which nothing can improve; true for one that is not a number.
            is_at_start: start_mse != 0.0 && (trainer.best_mse() >= enough || enough.is_nan()),
            best_epoch: trainer.best_epoch(),
            epochs: trainer.latest().epoch,
            reason,
            method: trainer.settings().method,
        };
        (defect.diverged_in.is_some() || defect.is_at_start).then_some(defect)
    }

    /// Returns the setting to change, in words.
    pub fn cure(&self) -> String {
        match self.reason {
            StopReason::GoalReached => "set a lower goal".to_owned(),
            StopReason::GradientSmall if self.diverged_in.is_none() => {
                format!("set a lower smallest gradient; or {}", self.method.cure())
            }
            StopReason::Stopped if self.diverged_in.is_none() => "let it run longer".to_owned(),
            _ => self.method.cure(),
        }
    }
}

/// First epoch of those at the end whose training error is above that of the start; an epoch that ended in no number is
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
                "the network is no better than its random start after {epochs} epochs ({})",
                self.reason
            )?,
        }
        write!(f, ": {}", self.cure())
    }
}

#[cfg(test)]
mod tests {
    use crate::training::{Method, RegularizationSettings};

    #[test]
    fn numbers_that_count_have_no_fraction() {
        for (groups, correlation_epoch, is_sound) in [
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
            assert_eq!(checked.is_ok(), is_sound, "{groups} {correlation_epoch}: {checked:?}");
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
}
