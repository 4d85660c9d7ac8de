//! A row of the table, and the values it gives access to.

use std::{
    fmt::{self, Display},
    ops::RangeInclusive,
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{sensor::short, text::Named};

/// A setting of `S`: a row of a table.
#[derive(Clone, Copy, Debug)]
pub struct Setting<S: 'static> {
    /// Name in sentences, in lower case; options and keywords put dashes or underscores for its spaces.
    pub name: &'static str,
    /// Explanation, in one or two sentences.
    pub help: &'static str,
    /// Allowed values.
    pub kind: Kind,
    /// Gives access to the value; `None` where the setting does not apply.
    pub field: fn(&mut S) -> Option<Field<'_>>,
}

/// Allowed values of a setting, and in words what a value is.
#[derive(Clone, Copy, Debug, PartialEq, strum::Display)]
pub enum Kind {
    /// Number with its smallest and largest value.
    #[strum(to_string = "a number")]
    Number(f64, f64),
    /// Integer with its smallest and largest value.
    #[strum(to_string = "a whole number")]
    Integer(u64, u64),
    /// One of the names, as [`Field::Text`] lists them in its error.
    #[strum(to_string = "a name")]
    Choice,
    /// Text of a form of its own, such as an array scale.
    #[strum(to_string = "a text")]
    Text,
}

type ReadText<'a> = Box<dyn FnOnce(&str) -> Result<(), String> + 'a>;

/// Access to the value of a setting.
pub enum Field<'a> {
    /// Number; an integer if the [kind](Setting::kind) is [`Kind::Integer`].
    Number(&'a mut f64),
    /// Number of things.
    Count(&'a mut usize),
    /// Integer of 64 bits, such as a seed.
    Integer(&'a mut u64),
    /// Integer that may be absent; it then has no value, which is its default.
    Optional(&'a mut Option<u8>),
    /// Name or text, and how it is read; an error is a sentence that says what is possible instead.
    Text(String, ReadText<'a>),
}

impl<'a> Field<'a> {
    /// Gives access to an enum by the names of its variants.
    pub fn named<T: Named>(value: &'a mut T) -> Self {
        Self::text(value.name().to_owned(), value, T::parse)
    }

    /// Gives access to a value by its text, which `parse` reads.
    pub fn text<T, E: ToString + 'a>(text: String, value: &'a mut T, parse: fn(&str) -> Result<T, E>) -> Self {
        let read = move |text: &str| {
            *value = parse(text).map_err(|error| error.to_string())?;
            Ok(())
        };
        Self::Text(text, Box::new(read))
    }
}

/// Value of a setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// Integer.
    Integer(u64),
    /// Number.
    Number(f64),
    /// Name or text.
    Text(String),
}

impl Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => value.fmt(f),
            Self::Integer(value) => value.fmt(f),
            Self::Text(value) => f.pad(value),
        }
    }
}

impl Kind {
    /// Returns the text of a number of this kind: one that counts has all its digits.
    fn number(self, number: f64) -> String {
        match self {
            Self::Integer(..) if number.abs() < 1e15 => number.to_string(),
            _ => short(number),
        }
    }

    /// Describes the range of a number: `0 or more`, `from 1 to 1000000`.
    fn limits(self) -> String {
        match self {
            Self::Number(min, f64::MAX) => format!("{} or more", short(min)),
            Self::Number(min, max) => format!("from {} to {}", short(min), short(max)),
            Self::Integer(min, max) => format!("from {min} to {max}"),
            Self::Choice | Self::Text => self.to_string(),
        }
    }
}

/// Error for an invalid setting, which each variant names first.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SettingError {
    /// A value is out of its range.
    #[error("{} is {}: it must be {}", .0, .2.number(*.1), .2.limits())]
    Range(&'static str, f64, Kind),
    /// The value of an integer has a fraction.
    #[error("{} is {}: it must be a whole number", .0, short(*.1))]
    NotWhole(&'static str, f64),
    /// An initial value is above the largest that the method may reach, whose name and value follow.
    #[error("{} is {}, above {}, which is {}: lower {}, or raise {}", .0, short(*.1), .2, short(*.3), .0, .2)]
    AboveLimit(&'static str, f64, &'static str, f64),
    /// A text is not a value of the setting; what is wrong, and what is possible instead.
    #[error("{0}: {1}")]
    Text(&'static str, String),
}

impl<S: Clone> Setting<S> {
    /// Returns `true` if `of` has this setting.
    pub fn applies(&self, of: &S) -> bool {
        (self.field)(&mut of.clone()).is_some()
    }

    /// Returns the value, if `of` has this setting.
    pub fn get(&self, of: &S) -> Option<Value> {
        Some(match (self.field)(&mut of.clone())? {
            Field::Number(value) => Value::Number(*value),
            Field::Count(value) => Value::Integer(*value as u64),
            Field::Integer(value) => Value::Integer(*value),
            Field::Optional(value) => Value::Integer((*value)?.into()),
            Field::Text(text, _) => Value::Text(text),
        })
    }

    /// Returns the value of a numeric setting, if `of` has it.
    pub fn number(&self, of: &S) -> Option<f64> {
        match self.get(of)? {
            Value::Number(value) => Some(value),
            Value::Integer(value) => Some(value as f64),
            Value::Text(_) => None,
        }
    }

    /// Sets the value, unless `of` does not have this setting. The range of a number is checked by [`Self::check`].
    ///
    /// # Errors
    /// If the value has another type, or is not one of the names.
    pub fn set(&self, of: &mut S, value: &Value) -> Result<(), SettingError> {
        match ((self.field)(of), value) {
            (None, _) => {}
            (Some(Field::Number(field)), Value::Number(value)) => *field = *value,
            (Some(Field::Number(field)), Value::Integer(value)) => *field = *value as f64,
            (Some(Field::Count(field)), Value::Integer(value)) => {
                *field = usize::try_from(*value).unwrap_or(usize::MAX);
            }
            (Some(Field::Integer(field)), Value::Integer(value)) => *field = *value,
            (Some(Field::Optional(field)), Value::Integer(value)) => {
                *field = Some((*value).try_into().unwrap_or(u8::MAX));
            }
            (Some(Field::Text(_, read)), Value::Text(text)) => {
                read(text).map_err(|message| self.refusal(message))?;
            }
            (Some(_), value) => return Err(self.refusal(format!("'{value}' is not {}", self.kind))),
        }
        Ok(())
    }

    /// Checks that the value is in range; NaN is always out of range.
    ///
    /// # Errors
    /// If the value is out of range.
    pub fn check(&self, of: &S) -> Result<(), SettingError> {
        let Some((value, range)) = self.number(of).zip(self.range()) else {
            return Ok(());
        };
        let name = self.name;
        if !range.contains(&value) {
            return Err(SettingError::Range(name, value, self.kind));
        }
        if matches!(self.kind, Kind::Integer(..)) && value.fract() != 0.0 {
            return Err(SettingError::NotWhole(name, value));
        }
        Ok(())
    }

    /// Creates a row.
    pub const fn new(
        name: &'static str,
        kind: Kind,
        help: &'static str,
        field: fn(&mut S) -> Option<Field<'_>>,
    ) -> Self {
        Self {
            name,
            help,
            kind,
            field,
        }
    }

    /// Returns the allowed values of a number.
    pub fn range(&self) -> Option<RangeInclusive<f64>> {
        match self.kind {
            Kind::Number(min, max) => Some(min..=max),
            Kind::Integer(min, max) => Some(min as f64..=max as f64),
            Kind::Choice | Kind::Text => None,
        }
    }

    /// Returns the value that a text says.
    ///
    /// # Errors
    /// If the setting is a number, and the text is not.
    pub fn parse(&self, text: &str) -> Result<Value, SettingError> {
        let value = match self.kind {
            Kind::Number(..) => text.parse().ok().map(Value::Number),
            Kind::Integer(..) => text.parse().ok().map(Value::Integer),
            Kind::Choice | Kind::Text => Some(Value::Text(text.to_owned())),
        };
        value.ok_or_else(|| self.refusal(format!("'{text}' is not {}", self.kind)))
    }

    fn refusal(&self, message: String) -> SettingError {
        SettingError::Text(self.name, message)
    }

    /// Returns the name with `between` in place of its spaces, as an option or a keyword.
    pub fn word(&self, between: &str) -> String {
        self.name.replace(' ', between)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Two {
        length: f64,
        seed: u64,
        day: Option<usize>,
    }

    const LENGTH: Setting<Two> = Setting {
        name: "step length",
        help: "Length.",
        kind: Kind::Number(0.0, 2.0),
        field: |two| Some(Field::Number(&mut two.length)),
    };

    #[test]
    fn values_are_read_written_and_checked() {
        let mut two = Two {
            length: 1.0,
            seed: 0,
            day: None,
        };
        let seed = Setting::<Two> {
            kind: Kind::Integer(0, u64::MAX),
            field: |two| Some(Field::Integer(&mut two.seed)),
            ..LENGTH
        };
        seed.set(&mut two, &seed.parse("18446744073709551615").unwrap())
            .unwrap();
        assert_eq!(seed.get(&two), Some(Value::Integer(u64::MAX)), "every digit is kept");
        for (text, message) in [
            ("x", "step length: 'x' is not a number"),
            ("1,5", "step length: '1,5' is not a number"),
        ] {
            assert_eq!(LENGTH.parse(text).unwrap_err().to_string(), message);
        }
        let open = Kind::Number(0.0, f64::MAX);
        let counted = Kind::Integer(0, 1_000_000);
        for (value, kind, message) in [
            (2.1, LENGTH.kind, "length is 2.1: it must be from 0 to 2"),
            (-1.0, open, "length is -1: it must be 0 or more"),
            (1_000_001.0, counted, "length is 1000001: it must be from 0 to 1000000"),
        ] {
            assert_eq!(SettingError::Range("length", value, kind).to_string(), message);
        }
        for (length, is_valid) in [(0.0, true), (2.0, true), (2.1, false), (f64::NAN, false)] {
            LENGTH.set(&mut two, &Value::Number(length)).unwrap();
            assert_eq!(LENGTH.check(&two).is_ok(), is_valid, "{length}");
        }
        let day = Setting::<Two> {
            field: |two| two.day.as_mut().map(Field::Count),
            ..LENGTH
        };
        assert!(!day.applies(&two) && day.check(&two).is_ok() && day.get(&two).is_none());
        assert_eq!(LENGTH.word("-"), "step-length");
    }
}
