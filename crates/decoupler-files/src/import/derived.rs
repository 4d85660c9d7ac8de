//! Columns computed from others of the same file.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{Cells, Column, Faults, ImportError, Table, selection::seconds};

/// Column computed from others of the same file: a difference, a ratio, or either with the mean at the start of the file.
///
/// Written as `d=c1-c2`, `q=c1/c2`, `r=c1/start(2s)` for the mean of the first two seconds, or `r=c1-start(100)` for that of
/// the first 100 rows. Spaces around the operator are needed if a name contains `-` or `/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Derived {
    /// Name of the new column.
    pub name: String,
    /// Name of the first column.
    pub column: String,
    operator: Operator,
    reference: Reference,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operator {
    Minus,
    Over,
}

/// What a column is compared with.
#[derive(Clone, Debug, PartialEq)]
enum Reference {
    /// Another column, row by row.
    Column(String),
    /// Its own mean over the first rows.
    Rows(usize),
    /// Its own mean over the first seconds.
    Seconds(f64),
}

impl Derived {
    /// Returns the columns from which it is computed.
    pub(super) fn columns(&self) -> impl Iterator<Item = &String> {
        let other = match &self.reference {
            Reference::Column(other) => Some(other),
            Reference::Rows(_) | Reference::Seconds(_) => None,
        };
        std::iter::once(&self.column).chain(other)
    }

    /// Adds the column to a table, unless the table has its name already or does not have its first column. `own` returns the
    /// name of a column within the file, and `time` is the time column there.
    ///
    /// # Errors
    /// If the other column is missing, a cell is not a number, or the mean cannot be computed.
    pub(super) fn add_to(
        &self,
        table: &mut Table,
        own: impl Fn(&str) -> Option<String>,
        time: Option<&str>,
    ) -> Result<(), ImportError> {
        let find = |name: &str| table.columns.iter().find(|column| column.name == name);
        let Some(column) = own(&self.column).and_then(|name| find(&name)) else {
            return Ok(());
        };
        let Some(name) = own(&self.name).filter(|name| find(name).is_none()) else {
            return Ok(());
        };
        let refuse = |reason: String| ImportError::Derived {
            text: self.to_string(),
            reason,
        };
        let numbers = |column: &Column| match &column.cells {
            Cells::Numbers(_) if column.faults.count > 0 => Err(refuse(format!("'{}' has text", column.name))),
            Cells::Numbers(numbers) => Ok(numbers.clone()),
            Cells::Labels { .. } => Err(refuse(format!("'{}' is the group", column.name))),
        };
        let values = numbers(column)?;
        let (references, unit) = match &self.reference {
            Reference::Column(other) => {
                let found = own(other).and_then(|name| find(&name));
                let other = found.ok_or_else(|| refuse(format!("there is no column '{other}' in the same file")))?;
                (numbers(other)?, other.unit.clone())
            }
            Reference::Rows(rows) => (
                vec![mean(&values[..values.len().min(*rows)]); values.len()],
                column.unit.clone(),
            ),
            Reference::Seconds(limit_s) => {
                let time = time.and_then(find);
                let time =
                    time.ok_or_else(|| refuse("seconds need the time column; give a number of rows".to_owned()))?;
                let factor = seconds(time.unit.as_deref());
                let factor = factor.ok_or_else(|| refuse(format!("'{}' has no unit of time", time.name)))?;
                let times = numbers(time)?;
                let start = times.iter().copied().fold(f64::INFINITY, f64::min);
                let at_start = times.iter().zip(&values);
                let at_start = at_start.filter(|(time, _)| factor * (**time - start) <= *limit_s);
                let values_at_start = Vec::from_iter(at_start.map(|(_, value)| *value));
                (vec![mean(&values_at_start); values.len()], column.unit.clone())
            }
        };
        if references.iter().all(|reference| reference.is_nan()) {
            return Err(refuse("no cell at the start is a number".to_owned()));
        }
        let pairs = values.iter().zip(&references);
        let derived = Vec::from_iter(pairs.map(|(value, reference)| {
            let derived = match self.operator {
                Operator::Minus => value - reference,
                Operator::Over => value / reference,
            };
            // A quotient by zero is no number.
            if derived.is_finite() { derived } else { f64::NAN }
        }));
        let is_same_unit = column.unit == unit;
        let unit = match self.operator {
            Operator::Minus => column.unit.clone().filter(|_| is_same_unit),
            Operator::Over if is_same_unit => None,
            Operator::Over => column
                .unit
                .as_ref()
                .zip(unit.as_ref())
                .map(|(one, other)| format!("{one}/{other}")),
        };
        table.columns.push(Column {
            name,
            unit,
            missing: derived.iter().filter(|value| value.is_nan()).count(),
            cells: Cells::Numbers(derived),
            faults: Faults::default(),
            ..Column::default()
        });
        Ok(())
    }
}

/// Mean of the numbers that are not missing; NaN without any.
fn mean(values: &[f64]) -> f64 {
    let present = || values.iter().filter(|value| !value.is_nan());
    present().sum::<f64>() / present().count() as f64
}

impl FromStr for Derived {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, ImportError> {
        let refuse = |reason: &str| ImportError::Derived {
            text: text.to_owned(),
            reason: reason.to_owned(),
        };
        let (name, expression) = text.split_once('=').ok_or_else(|| refuse("it has no name"))?;
        let spaced = [(" - ", Operator::Minus), (" / ", Operator::Over)];
        let close = [("-", Operator::Minus), ("/", Operator::Over)];
        let at = |operators: [(&str, Operator); 2]| {
            let found = operators.into_iter().filter_map(|(sign, operator)| {
                let place = expression.find(sign)?;
                Some((place, sign.len(), operator))
            });
            found.min_by_key(|(place, ..)| *place)
        };
        let (place, length, operator) = at(spaced)
            .or_else(|| at(close))
            .ok_or_else(|| refuse("it has neither - nor /"))?;
        let (column, reference) = (expression[..place].trim(), expression[place + length..].trim());
        let reference = match reference.strip_prefix("start(").and_then(|rest| rest.strip_suffix(')')) {
            None => Reference::Column(reference.to_owned()),
            Some(span) => match span.trim().strip_suffix('s') {
                Some(seconds) => {
                    let seconds = seconds
                        .trim()
                        .parse()
                        .ok()
                        .filter(|seconds: &f64| seconds.is_finite() && *seconds > 0.0);
                    Reference::Seconds(seconds.ok_or_else(|| refuse("start(…s) needs a number of seconds above 0"))?)
                }
                None => {
                    let rows = span.trim().parse().ok().filter(|rows| *rows > 0);
                    Reference::Rows(
                        rows.ok_or_else(|| refuse("start(…) needs a number of rows, or seconds such as 2s"))?,
                    )
                }
            },
        };
        let is_empty = |name: &str| name.trim().is_empty();
        if is_empty(name) || is_empty(column) || matches!(&reference, Reference::Column(other) if other.is_empty()) {
            return Err(refuse("a name is missing"));
        }
        Ok(Self {
            name: name.trim().to_owned(),
            column: column.to_owned(),
            operator,
            reference,
        })
    }
}

impl TryFrom<String> for Derived {
    type Error = ImportError;

    fn try_from(text: String) -> Result<Self, ImportError> {
        text.parse()
    }
}

impl From<Derived> for String {
    fn from(derived: Derived) -> Self {
        derived.to_string()
    }
}

impl fmt::Display for Derived {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = match self.operator {
            Operator::Minus => "-",
            Operator::Over => "/",
        };
        write!(f, "{}={} {sign} ", self.name, self.column)?;
        match &self.reference {
            Reference::Column(other) => f.write_str(other),
            Reference::Rows(rows) => write!(f, "start({rows})"),
            Reference::Seconds(seconds) => write!(f, "start({seconds}s)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_columns_are_read_and_written() {
        for (text, written) in [
            ("d=c1-c2", "d=c1 - c2"),
            (" r = c1 / start( 2.5s ) ", "r=c1 / start(2.5s)"),
            ("p=flow-rate - start(100)", "p=flow-rate - start(100)"),
            ("q=states.c2/states.c3", "q=states.c2 / states.c3"),
        ] {
            let derived: Derived = text.parse().unwrap();
            assert_eq!(derived.to_string(), written);
            assert_eq!(written.parse::<Derived>().unwrap(), derived);
        }
        for (text, reason) in [
            ("c1-c2", "it has no name"),
            ("d=c1", "neither - nor /"),
            ("d=c1-", "a name is missing"),
            ("=c1-c2", "a name is missing"),
            ("d=c1-start(0)", "a number of rows"),
            ("d=c1-start(-2s)", "a number of seconds above 0"),
        ] {
            let error = text.parse::<Derived>().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
