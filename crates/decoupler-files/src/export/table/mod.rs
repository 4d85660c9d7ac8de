//! Tables: described once, and written as CSV for other programs or as text for papers and spreadsheets.
//! LaTeX has the rules of `booktabs` and the numeric columns of `siunitx`.

mod csv_row;
mod text;

pub use csv_row::{csv_cell, write_csv_row};
pub use text::TableForm;

use std::io::{self, Write};

use decoupler_core::text::{begins_formula, inert};
use serde::ser::{Serialize, SerializeMap as _, SerializeSeq as _, Serializer};

use crate::export::{format_number, format_r2};

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

/// Contents of a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A text.
    Text(String),
    /// An integer.
    Count(u64),
    /// A number; `None` where there is none.
    Number(Option<f64>),
    /// A coefficient of determination, near 1 with more digits for readers; `None` where there is none.
    R2(Option<f64>),
}

impl Cell {
    /// Returns the cell for readers: numbers with three significant digits; a dash where there is none.
    pub fn rounded(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) => format_number(*number),
            Self::R2(number) => format_r2(*number),
        }
    }

    /// Returns [`Self::exact`], quoted where a spreadsheet would treat the text as a formula.
    pub(super) fn for_spreadsheet(&self) -> String {
        match self {
            Self::Text(text) => inert(text),
            Self::Count(_) | Self::Number(_) | Self::R2(_) => self.exact(),
        }
    }

    /// Returns the cell with every digit, empty where there is not a number.
    pub fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) | Self::R2(number) => {
                let number = number.filter(|number| number.is_finite());
                number.map_or_else(String::new, |number| format!("{number:?}"))
            }
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

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        Self::Number(number)
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

    /// Returns true if the column contains only numbers.
    pub fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.get(column));
        cells.all(|cell| !matches!(cell, Cell::Text(_)))
    }

    /// Removes the column with this field.
    pub(in crate::export) fn remove_column(&mut self, field: &str) {
        if let Some(place) = self.columns.iter().position(|column| column.field == field) {
            self.columns.remove(place);
            for row in &mut self.rows {
                row.remove(place);
            }
        }
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

/// JSON: an array of the rows, each an object whose keys are the fields of the columns. Numbers keep every digit; where there
/// is none the value is `null`.
impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.rows.len()))?;
        for cells in &self.rows {
            rows.serialize_element(&Row {
                columns: &self.columns,
                cells,
            })?;
        }
        rows.end()
    }
}

struct Row<'a> {
    columns: &'a [TableColumn],
    cells: &'a [Cell],
}

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(Some(self.cells.len()))?;
        for (column, cell) in self.columns.iter().zip(self.cells) {
            fields.serialize_entry(&column.field, cell)?;
        }
        fields.end()
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Count(count) => serializer.serialize_u64(*count),
            Self::Number(number) | Self::R2(number) => number.filter(|number| number.is_finite()).serialize(serializer),
        }
    }
}

pub(super) fn latex(table: &Table) -> String {
    let columns = 0..table.columns.len();
    let alignments: Vec<String> = columns.map(|column| alignment(table, column)).collect();
    let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
    let headings = table.columns.iter().enumerate().map(|(number, column)| {
        let title = escaped(&column.title());
        // Braces keep siunitx from reading it as a number.
        if table.is_numeric(number) {
            format!("{{{title}}}")
        } else {
            title
        }
    });
    let mut text = "% \\usepackage{booktabs, siunitx}\n".to_owned();
    text += &format!("\\begin{{tabular}}{{{}}}\n\\toprule\n", alignments.join(" "));
    text += &line(headings.collect());
    text += "\\midrule\n";
    for row in &table.rows {
        let cells = row.iter().enumerate().map(|(column, cell)| match cell {
            Cell::Number(number) | Cell::R2(number)
                if table.is_numeric(column) && !number.is_some_and(f64::is_finite) =>
            {
                format!("{{{}}}", cell.rounded())
            }
            _ => escaped(&cell.rounded()),
        });
        text += &line(cells.collect());
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

/// Column type: names at the left, numbers at their decimal points, mixed columns at the right.
fn alignment(table: &Table, column: usize) -> String {
    if !table.is_numeric(column) {
        return if column == 0 { "l" } else { "r" }.to_owned();
    }
    let cells = table.rows.iter().filter_map(|row| row.get(column));
    let numbers = cells
        .map(Cell::rounded)
        .filter(|text| text.ends_with(|end: char| end.is_ascii_digit()));
    let mut widest = NumberWidth::default();
    for number in numbers {
        widest.take(&number);
    }
    format!("S[table-format={}]", widest.format())
}

/// Maximum number of digits of a column's numbers before and after the decimal point, and in the exponent.
#[derive(Default)]
struct NumberWidth {
    has_sign: bool,
    whole: usize,
    decimals: usize,
    exponent: usize,
    has_exponent_sign: bool,
}

impl NumberWidth {
    fn take(&mut self, number: &str) {
        let (mantissa, exponent) = number.split_once('e').unwrap_or((number, ""));
        let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        self.has_sign |= whole.starts_with('-');
        self.whole = self.whole.max(whole.trim_start_matches('-').len());
        self.decimals = self.decimals.max(decimals.len());
        self.has_exponent_sign |= exponent.starts_with('-');
        self.exponent = self.exponent.max(exponent.trim_start_matches('-').len());
    }

    /// The `table-format` of siunitx.
    fn format(&self) -> String {
        let sign = |has_sign| if has_sign { "-" } else { "" };
        let mut format = format!("{}{}.{}", sign(self.has_sign), self.whole.max(1), self.decimals);
        if self.exponent > 0 {
            format += &format!("e{}{}", sign(self.has_exponent_sign), self.exponent);
        }
        format
    }
}

/// Escapes the special characters of LaTeX.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    // After the end of a row, LaTeX takes [ and * for arguments of \\, and a number stays one for siunitx.
    if text.starts_with(['[', '*']) || begins_formula(text) {
        escaped += "{}";
    }
    for letter in text.chars() {
        match letter {
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '\n' | '\r' => escaped.push(' '),
            '{' | '}' | '$' | '&' | '#' | '%' | '_' => escaped.extend(['\\', letter]),
            _ => escaped.push(letter),
        }
    }
    escaped
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
