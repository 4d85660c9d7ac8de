//! Columns computed from others of the same file, in tables and in [streams](super::derived_stream).

use std::{fmt, str::FromStr};

use decoupler_core::text::{in_one_line, is_unprintable};
use serde::{Deserialize, Serialize};

use super::{Cells, Column, Faults, ImportError, Table, selection::seconds, table::column_called};

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

    /// Returns `true` if it needs a time column.
    pub(super) fn needs_time(&self) -> bool {
        matches!(self.reference, Reference::Seconds(_))
    }

    /// Finds its columns among `columns`; `None` if they have its name already or do not have its first column. `own` returns
    /// the name of a column within the file, and `time` is the time column there.
    ///
    /// # Errors
    /// If the other column or the time column is missing, or the times have no unit of time.
    pub(super) fn located(
        &self,
        columns: &[Column],
        own: impl Fn(&str) -> Option<String>,
        time: Option<TimeColumn<'_>>,
    ) -> Result<Option<LocatedDerived>, ImportError> {
        let find = |name: &str| column_called(columns, name);
        let Some(column) = own(&self.column).and_then(|name| find(&name)) else {
            return Ok(None);
        };
        let Some(name) = own(&self.name).filter(|name| find(name).is_none()) else {
            return Ok(None);
        };
        let (reference, unit) = match &self.reference {
            Reference::Column(other) => {
                let found = own(other).and_then(|name| find(&name));
                let other =
                    found.ok_or_else(|| self.refused(format!("there is no column '{other}' in the same file")))?;
                (LocatedReference::Column(other), &columns[other].unit)
            }
            Reference::Rows(rows) => (LocatedReference::Rows(*rows), &columns[column].unit),
            Reference::Seconds(limit_s) => {
                let found = time.and_then(|time| Some((find(time.name)?, time.given_unit)));
                let (time, given_unit) = found
                    .ok_or_else(|| self.refused("seconds need the time column; give a number of rows".to_owned()))?;
                let of_stamps = columns[time].start.map(|_| "s");
                let of_times = of_stamps.or(given_unit).or(columns[time].unit.as_deref());
                let unit_s = seconds(of_times)
                    .ok_or_else(|| self.refused(format!("'{}' has no unit of time", columns[time].name)))?;
                let reference = LocatedReference::Seconds {
                    time,
                    unit_s,
                    limit_s: *limit_s,
                };
                (reference, &columns[column].unit)
            }
        };
        let is_same_unit = columns[column].unit == *unit;
        let unit = match self.operator {
            Operator::Minus => columns[column].unit.clone().filter(|_| is_same_unit),
            Operator::Over if is_same_unit => None,
            Operator::Over => {
                let units = columns[column].unit.as_ref().zip(unit.as_ref());
                units.map(|(one, other)| format!("{one}/{other}"))
            }
        };
        Ok(Some(LocatedDerived {
            name,
            unit,
            column,
            operator: self.operator,
            reference,
        }))
    }

    /// Adds the column to a table, unless the table has its name already or does not have its first column; `own` and `time`
    /// are as for [`Self::located`].
    ///
    /// # Errors
    /// If another column is missing, a cell is not a number, or the mean cannot be computed.
    pub(super) fn add_to(
        &self,
        table: &mut Table,
        own: impl Fn(&str) -> Option<String>,
        time: Option<TimeColumn<'_>>,
    ) -> Result<(), ImportError> {
        let Some(located) = self.located(&table.columns, own, time)? else {
            return Ok(());
        };
        for place in located.columns() {
            let column = &table.columns[place];
            match &column.cells {
                Cells::Numbers(_) if column.faults.count > 0 => {
                    return Err(self.refused(format!("'{}' has text", column.name)));
                }
                Cells::Numbers(_) => {}
                Cells::Labels { .. } => return Err(self.refused(format!("'{}' is the group", column.name))),
            }
        }
        let cell = |row: usize, column: usize| table.columns[column].cells.number(row);
        let mean = located.mean_at_start(table.rows, cell);
        if mean.is_some_and(f64::is_nan) {
            return Err(self.refused(NOTHING_AT_START.to_owned()));
        }
        let of_row = |row| located.value(|column| cell(row, column), mean);
        let derived = Vec::from_iter((0..table.rows).map(of_row));
        table.columns.push(Column {
            missing: derived.iter().filter(|value| value.is_nan()).count(),
            cells: Cells::Numbers(derived),
            faults: Faults::default(),
            ..located.column_of()
        });
        Ok(())
    }

    pub(super) fn refused(&self, reason: String) -> ImportError {
        ImportError::Derived {
            text: in_one_line(&self.to_string()),
            reason: in_one_line(&reason),
        }
    }
}

/// Reason why there is no mean at the start.
pub(super) const NOTHING_AT_START: &str = "no cell at the start is a number";

/// Time column of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeColumn<'a> {
    /// Name within the file.
    pub(super) name: &'a str,
    /// Unit given by the recipe instead of the header.
    pub(super) given_unit: Option<&'a str>,
}

/// Derived column with the places of its columns in a table or in the lines of a stream.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LocatedDerived {
    name: String,
    unit: Option<String>,
    column: usize,
    operator: Operator,
    reference: LocatedReference,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum LocatedReference {
    Column(usize),
    Rows(usize),
    Seconds { time: usize, unit_s: f64, limit_s: f64 },
}

impl LocatedDerived {
    /// Name and unit of the new column, without cells.
    pub(super) fn column_of(&self) -> Column {
        Column {
            name: self.name.clone(),
            unit: self.unit.clone(),
            ..Column::default()
        }
    }

    /// Places of the columns from which it is computed.
    pub(super) fn columns(&self) -> impl Iterator<Item = usize> + use<> {
        let other = match self.reference {
            LocatedReference::Column(other) => Some(other),
            LocatedReference::Seconds { time, .. } => Some(time),
            LocatedReference::Rows(_) => None,
        };
        std::iter::once(self.column).chain(other)
    }

    /// Returns `true` if `rows` rows are the whole start, or all of it and more; `cell` returns a cell by row and column.
    pub(super) fn has_start(&self, rows: usize, cell: impl Fn(usize, usize) -> f64) -> bool {
        match self.reference {
            LocatedReference::Column(_) => true,
            LocatedReference::Rows(needed) => rows >= needed,
            LocatedReference::Seconds { time, unit_s, limit_s } => {
                let elapsed = |row| unit_s * (cell(row, time) - cell(0, time));
                rows > 0 && elapsed(rows - 1) > limit_s
            }
        }
    }

    /// Mean of its first column at the start of `rows` rows, NaN if no cell there is a number; `None` if it needs none. `cell`
    /// returns a cell by row and column.
    pub(super) fn mean_at_start(&self, rows: usize, cell: impl Fn(usize, usize) -> f64) -> Option<f64> {
        let mean = |start: &mut dyn Iterator<Item = usize>| {
            let present = start.map(|row| cell(row, self.column)).filter(|value| !value.is_nan());
            let (sum, count) = present.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
            sum / f64::from(count)
        };
        match self.reference {
            LocatedReference::Column(_) => None,
            LocatedReference::Rows(limit) => Some(mean(&mut (0..rows.min(limit)))),
            LocatedReference::Seconds { time, unit_s, limit_s } => {
                let first = (0..rows).map(|row| cell(row, time)).fold(f64::INFINITY, f64::min);
                let is_at_start = |row: &usize| unit_s * (cell(*row, time) - first) <= limit_s;
                Some(mean(&mut (0..rows).filter(is_at_start)))
            }
        }
    }

    /// Value in a row; NaN if there is none, such as for a quotient by zero. `cell` returns a cell of the row by column, and
    /// `mean` is the mean at the start.
    pub(super) fn value(&self, cell: impl Fn(usize) -> f64, mean: Option<f64>) -> f64 {
        let reference = match self.reference {
            LocatedReference::Column(other) => cell(other),
            LocatedReference::Rows(_) | LocatedReference::Seconds { .. } => mean.unwrap_or(f64::NAN),
        };
        let value = match self.operator {
            Operator::Minus => cell(self.column) - reference,
            Operator::Over => cell(self.column) / reference,
        };
        if value.is_finite() { value } else { f64::NAN }
    }
}

impl FromStr for Derived {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, ImportError> {
        let refuse = |reason: &str| ImportError::Derived {
            text: in_one_line(text),
            reason: reason.to_owned(),
        };
        // Names of columns contain no other white space, and signs are found between spaces.
        let spaced = text.replace(|c: char| c.is_whitespace() || is_unprintable(c), " ");
        let (name, expression) = spaced.split_once('=').ok_or_else(|| refuse("it has no name"))?;
        let apart = [(" - ", Operator::Minus), (" / ", Operator::Over)];
        let close = [("-", Operator::Minus), ("/", Operator::Over)];
        let at = |operators: [(&str, Operator); 2]| {
            let found = operators.into_iter().filter_map(|(sign, operator)| {
                let place = expression.find(sign)?;
                Some((place, sign.len(), operator))
            });
            found.min_by_key(|(place, ..)| *place)
        };
        let (place, length, operator) = at(apart)
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
            ("r = c1\r -\t - c2", "r=c1 - - c2"),
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
