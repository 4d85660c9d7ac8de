use std::{convert::Infallible, fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::number::Cell;

/// A text or number that means missing, in one column or in all.
///
/// Written as `-1` or, for one column, as `states.c5=-1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub struct Missing {
    /// Column; `None` for all.
    pub column: Option<String>,
    /// Text of the cell.
    pub text: String,
    /// The text as a number, which any other spelling of it means too.
    number: Option<f64>,
}

impl Missing {
    /// Returns `true` for a cell that means missing.
    pub(super) fn is(&self, cell: &[u8], found: Cell) -> bool {
        match (found, self.number) {
            (Cell::Number(found), Some(number)) => found == number,
            _ => cell == self.text.as_bytes(),
        }
    }

    /// Returns `true` for a number that means missing.
    pub(super) fn is_number(&self, found: f64) -> bool {
        self.number == Some(found)
    }
}

impl From<String> for Missing {
    fn from(text: String) -> Self {
        let (column, value) = match text.split_once('=') {
            Some((column, value)) if !column.trim().is_empty() => (Some(column.trim().to_owned()), value),
            _ => (None, text.as_str()),
        };
        let value = value.trim().to_owned();
        Self {
            column,
            number: value.parse().ok().filter(|number: &f64| number.is_finite()),
            text: value,
        }
    }
}

impl FromStr for Missing {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(text.to_owned().into())
    }
}

impl From<Missing> for String {
    fn from(missing: Missing) -> Self {
        missing.to_string()
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.column {
            Some(column) => write!(f, "{column}={}", self.text),
            None => f.write_str(&self.text),
        }
    }
}
