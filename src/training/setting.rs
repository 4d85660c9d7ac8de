use std::ops::RangeInclusive;

use thiserror::Error;

/// One number that can be set: what the window and the terminal need to offer it.
#[derive(Debug)]
pub struct Setting<'a> {
    /// The field's word for it.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub meaning: &'static str,
    /// The field's usual value.
    pub default: f64,
    /// What is allowed.
    pub range: RangeInclusive<f64>,
    /// The present value.
    pub value: &'a mut f64,
}

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{name} is {value:?}: it must be from {:?} to {:?}", .range.start(), .range.end())]
pub struct SettingError {
    /// Which setting.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What is allowed.
    pub range: RangeInclusive<f64>,
}

impl Setting<'_> {
    /// Checks that the value is in range; NaN is in no range.
    ///
    /// # Errors
    /// It is not.
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
