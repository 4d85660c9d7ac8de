//! Numbers that the user can set.

use std::ops::RangeInclusive;

use thiserror::Error;

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
