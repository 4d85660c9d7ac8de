//! Numbers that the user can set.

use std::ops::RangeInclusive;

use thiserror::Error;

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
    /// The present value.
    pub value: &'a mut f64,
}

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{name} is {value:?}: it must be from {:?} to {:?}", .range.start(), .range.end())]
pub struct SettingError {
    /// Name of the setting.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Allowed values.
    pub range: RangeInclusive<f64>,
}

impl Setting<'_> {
    /// Checks that the value is in range; NaN is in no range.
    ///
    /// # Errors
    /// The value is out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        if self.range.contains(self.value) {
            return Ok(());
        }
        Err(SettingError {
            name: self.name,
            value: *self.value,
            range: self.range.clone(),
        })
    }
}
