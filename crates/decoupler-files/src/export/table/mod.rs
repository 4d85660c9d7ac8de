//! Tables: described once, and written as CSV for other programs or as text for papers and spreadsheets.
//! LaTeX has the rules of `booktabs` and the numeric columns of `siunitx`.

mod text;

pub use text::TableForm;
pub(super) use text::escaped_html;

use std::{
    io::{self, Write},
    time::Duration,
};

use decoupler_core::{settings::Value, text::inert};
use serde::ser::{Serialize, Serializer};

use crate::export::{format_duration, format_number, format_r2, write_csv_row};

/// Contents of a table, independent of the form in which it is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Columns, from left to right.
    pub columns: Vec<TableColumn>,
    /// Rows, each with one cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableColumn {
    /// Name in CSV files: `z_percent`.
    pub field: String,
    /// Heading for readers: `Z`.
    pub heading: String,
    /// Unit of its numbers; empty where they have none.
    pub unit: &'static str,
    /// Definition of its numbers, shown as a tooltip; empty if the heading is enough.
    pub meaning: &'static str,
}

impl TableColumn {
    /// A column for readers.
    pub fn new(field: impl Into<String>, heading: impl Into<String>, unit: &'static str) -> Self {
        Self {
            field: field.into(),
            heading: heading.into(),
            unit,
            meaning: "",
        }
    }

    /// Returns the column with this definition.
    pub fn meaning(self, meaning: &'static str) -> Self {
        Self { meaning, ..self }
    }

    /// A column of a table that is only written for programs: its heading is the name of the field.
    pub fn field(name: impl Into<String>) -> Self {
        let field = name.into();
        Self::new(field.clone(), field, "")
    }

    /// Returns the heading with the unit: `Z (%)`.
    pub fn title(&self) -> String {
        if self.unit.is_empty() {
            self.heading.clone()
        } else {
            format!("{} ({})", self.heading, self.unit)
        }
    }
}

/// A column for readers: name in files, heading and unit.
impl From<(&str, &str, &'static str)> for TableColumn {
    fn from((field, heading, unit): (&str, &str, &'static str)) -> Self {
        Self::new(field, heading, unit)
    }
}

/// A column for programs.
impl From<&str> for TableColumn {
    fn from(field: &str) -> Self {
        Self::field(field)
    }
}

/// Returns a cell of a row, with its column: see [`Table::of_rows`].
pub(super) fn cell(column: impl Into<TableColumn>, value: impl Into<Cell>) -> (TableColumn, Cell) {
    (column.into(), value.into())
}

/// Contents of a cell. In JSON, numbers keep every digit, and are `null` where there is none.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// A text.
    Text(String),
    /// An integer.
    Count(u64),
    /// A number; `None` where there is none.
    Number(Option<f64>),
    /// A coefficient of determination, near 1 with more digits for readers; `None` where there is none.
    R2(Option<f64>),
    /// A time in seconds, with a fitting unit for readers; `None` where there is none.
    Seconds(Option<f64>),
}

impl Cell {
    /// Returns the cell for readers: numbers with three significant digits; a dash where there is none.
    pub fn rounded(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) => format_number(*number),
            Self::R2(number) => format_r2(*number),
            Self::Seconds(seconds) => {
                let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
                time.map_or_else(|| format_number(None), format_duration)
            }
        }
    }

    /// Returns [`Self::exact`], quoted where a spreadsheet would treat the text as a formula.
    pub(super) fn for_spreadsheet(&self) -> String {
        match self {
            Self::Text(text) => inert(text),
            _ => self.exact(),
        }
    }

    /// Returns the cell with every digit, empty where there is not a number.
    pub fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(_) | Self::R2(_) | Self::Seconds(_) => {
                let number = self.number().filter(|number| number.is_finite());
                number.map_or_else(String::new, |number| format!("{number:?}"))
            }
        }
    }

    /// Returns the number in the cell, if there is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Text(_) => None,
            Self::Count(count) => Some(*count as f64),
            Self::Number(number) | Self::R2(number) | Self::Seconds(number) => *number,
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(Some(number))
    }
}

impl From<Value> for Cell {
    fn from(value: Value) -> Self {
        match value {
            Value::Integer(value) => Self::Count(value),
            Value::Number(value) => value.into(),
            Value::Text(value) => value.into(),
        }
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Number(None), T::into)
    }
}

impl Table {
    /// A table for readers, with these headings.
    pub fn of_headings<H: Into<String>>(
        headings: impl IntoIterator<Item = H>,
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) -> Self {
        Self {
            columns: headings.into_iter().map(TableColumn::field).collect(),
            rows: rows.into_iter().collect(),
        }
    }

    /// A table of rows that have the same columns.
    pub(super) fn of_rows(rows: impl IntoIterator<Item = Vec<(TableColumn, Cell)>>) -> Self {
        let mut table = Self::default();
        for row in rows {
            let (columns, cells) = row.into_iter().unzip();
            table.columns = columns;
            table.rows.push(cells);
        }
        table
    }

    /// Returns true if the column contains only numbers.
    pub fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.get(column));
        cells.all(|cell| !matches!(cell, Cell::Text(_)))
    }

    /// Writes the table as CSV. Numbers read back bit for bit; where there is none the field is empty.
    ///
    /// # Errors
    /// Any error of `writer`.
    pub fn write_csv(&self, writer: &mut dyn Write) -> io::Result<()> {
        write_csv_row(self.columns.iter().map(|column| inert(&column.field)), writer)?;
        let mut rows = self.rows.iter();
        rows.try_for_each(|row| write_csv_row(row.iter().map(Cell::for_spreadsheet), writer))
    }
}

/// JSON: an array of the rows, each an object whose keys are the fields of the columns, in their order.
impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let row = |cells| Row(&self.columns, cells);
        serializer.collect_seq(self.rows.iter().map(row))
    }
}

struct Row<'a>(&'a [TableColumn], &'a Vec<Cell>);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let fields = self.0.iter().map(|column| &column.field);
        serializer.collect_map(fields.zip(self.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_round_trips_every_bit_and_every_letter() {
        let awkward = "a, \"b\"\nc";
        let numbers = [0.1 + 0.2, -1e-300, 5e-324, f64::MAX, 1.0];
        let table = Table {
            columns: vec![TableColumn::new("name", "Name", ""), TableColumn::new("z", "Z", "%")],
            rows: numbers.iter().map(|&z| vec![awkward.into(), z.into()]).collect(),
        };
        let mut written = Vec::new();
        table.write_csv(&mut written).unwrap();
        let mut reader = csv::Reader::from_reader(&*written);
        assert_eq!(reader.headers().unwrap(), vec!["name", "z"]);
        let read: Vec<_> = reader.records().map(Result::unwrap).collect();
        assert_eq!(read.len(), numbers.len());
        for (record, number) in read.iter().zip(numbers) {
            assert_eq!(&record[0], awkward);
            assert_eq!(record[1].parse::<f64>().unwrap().to_bits(), number.to_bits());
        }
    }

    #[test]
    fn json_is_an_array_of_objects_by_field_in_the_order_of_the_columns() {
        let table = Table {
            columns: vec![
                TableColumn::new("name", "Name", ""),
                TableColumn::new("z_percent", "Z", "%"),
                TableColumn::new("r2", "R²", ""),
                TableColumn::new("epochs", "epochs", ""),
            ],
            rows: vec![
                vec![
                    "a \"b\"".into(),
                    (0.1 + 0.2).into(),
                    Cell::R2(Some(0.99999)),
                    3_usize.into(),
                ],
                vec!["=1".into(), f64::NAN.into(), Cell::R2(None), 0_usize.into()],
            ],
        };
        let expected = "[{\"name\":\"a \\\"b\\\"\",\"z_percent\":0.30000000000000004,\"r2\":0.99999,\"epochs\":3},\
                        {\"name\":\"=1\",\"z_percent\":null,\"r2\":null,\"epochs\":0}]";
        assert_eq!(serde_json::to_string(&table).unwrap(), expected);
    }

    #[test]
    fn missing_numbers_are_empty_for_programs_and_a_dash_for_readers() {
        for cell in [Cell::Number(None), f64::NAN.into(), f64::INFINITY.into()] {
            assert_eq!((cell.exact().as_str(), cell.rounded().as_str()), ("", "–"));
        }
    }
}
