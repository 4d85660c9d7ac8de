use std::{
    collections::{HashMap, HashSet},
    io::{Cursor, Read},
    path::Path,
};

use decoupler_core::text::{clean_name, counted, original_name};

use super::{
    Cells, Column, Dialect, DialectChoice, Encoding, Fault, Format, Missing, Table, TableError,
    columns::position,
    detection::{BEGINNING, detect},
    dialect::utf8_of_utf16,
    format::{Cell, parse},
    progress::table_error,
    rows::{Rows, commonest},
    table::{Excess, Labels, Lines, excerpt, name_and_unit},
    time_stamp::TimeStamp,
};
use crate::machine::ReadingBudget;

/// Maximum number of rows; ten hours at 1 kHz are fewer.
const LARGEST_ROWS: usize = 50_000_000;
/// Memory of a number in bytes, in a vector that has just doubled.
const NUMBER: u64 = 2 * size_of::<f64>() as u64;
/// Memory of a short text in bytes, without its letters.
const TEXT: u64 = 64;
/// Number of rows that determine the number of columns, by their most common length, if there is no header.
const FIRST_ROWS: usize = 500;

/// Columns that are not read as numbers, and markers of missing values.
#[derive(Clone, Debug, Default)]
pub(super) struct Reading<'a> {
    pub(super) choice: DialectChoice,
    /// Markers of missing values in this file: the column, or `None` for all, and the text.
    pub(super) missing: Vec<(Option<String>, &'a Missing)>,
    /// Column of labels.
    pub(super) label: Option<String>,
    /// Columns or ranges that are used, which choose among the arrays of a file.
    pub(super) used: Vec<String>,
}

/// Markers and kind of the cells of a column.
pub(super) struct Role<'a> {
    pub(super) missing: Vec<&'a Missing>,
    pub(super) has_labels: bool,
}

impl<'a> Reading<'a> {
    /// Returns the role of each column.
    pub(super) fn roles(&self, columns: &[Column]) -> Vec<Role<'a>> {
        let find = |name: &String| position(columns, name);
        let label = self.label.as_ref().and_then(find);
        let markers = self.missing.iter();
        let markers =
            Vec::from_iter(markers.map(|(name, missing)| (name.is_none(), name.as_ref().and_then(find), *missing)));
        let role = |column| Role {
            missing: markers
                .iter()
                .filter(|(is_of_all, of, _)| *is_of_all || *of == Some(column))
                .map(|(.., missing)| *missing)
                .collect(),
            has_labels: label == Some(column),
        };
        (0..columns.len()).map(role).collect()
    }
}

/// Reads a table from text. `budget` limits its memory.
pub(super) fn read(
    path: &Path,
    mut source: impl Read,
    reading: &Reading<'_>,
    budget: &mut ReadingBudget,
) -> Result<Table, TableError> {
    let mut beginning = Vec::new();
    (&mut source)
        .take(BEGINNING as u64)
        .read_to_end(&mut beginning)
        .map_err(table_error)?;
    let dialect = detect(&beginning, beginning.len() < BEGINNING, &reading.choice)?;
    let whole = Cursor::new(beginning).chain(source);
    match dialect.encoding {
        Encoding::Utf8 | Encoding::Latin1 => read_rows(path, whole, dialect, reading, budget),
        Encoding::Utf16Le | Encoding::Utf16Be => {
            let text = utf8_of_utf16(whole, dialect.encoding == Encoding::Utf16Le);
            read_rows(path, text, dialect, reading, budget)
        }
    }
}

fn read_rows(
    path: &Path,
    text: impl Read,
    dialect: Dialect,
    reading: &Reading<'_>,
    budget: &mut ReadingBudget,
) -> Result<Table, TableError> {
    let mut rows = Rows::new(text, dialect.separator, dialect.carriage_returns);
    rows.skip(dialect.skipped_lines + usize::from(dialect.sep_line))?;
    let mut headers = Vec::new();
    if dialect.header && rows.advance()? {
        headers = rows.cells().map(|cell| text_of(cell, dialect.encoding)).collect();
    }
    let mut body = Body {
        dialect,
        reading,
        budget,
        first: Vec::new(),
        builders: Vec::new(),
        rows: 0,
        lines: Lines::default(),
        too_long: Excess::default(),
        too_short: Excess::default(),
        torn_line: None,
    };
    while rows.advance()? {
        if body.is_torn(&rows, &headers) {
            body.torn_line = Some(rows.line());
        } else {
            body.push(&rows, &headers)?;
        }
    }
    body.finish(path, headers)
}

/// The rows after the header.
struct Body<'a> {
    dialect: Dialect,
    reading: &'a Reading<'a>,
    budget: &'a mut ReadingBudget,
    /// Rows buffered until the number of columns is known, with their line numbers.
    first: Vec<(u64, Vec<Vec<u8>>)>,
    builders: Vec<Builder<'a>>,
    rows: usize,
    lines: Lines,
    too_long: Excess,
    too_short: Excess,
    torn_line: Option<u64>,
}

struct Builder<'a> {
    column: Column,
    numbers: Vec<f64>,
    /// `true` once a cell was a number.
    has_numbers: bool,
    labels: Option<Labels>,
    missing: Vec<&'a Missing>,
}

impl<'a> Body<'a> {
    /// Returns `true` if the row is the last of a file that is cut off, as when the disk was full: it ends without a line
    /// break, before the last column or within its number.
    fn is_torn<R: Read>(&self, rows: &Rows<R>, headers: &[String]) -> bool {
        if rows.is_ended() || self.rows + self.first.len() == 0 {
            return false;
        }
        let width = match (self.builders.len(), headers.len()) {
            (0, 0) => commonest(self.first.iter().map(|(_, cells)| cells.len())).0,
            (0, _) => return false,
            (width, _) => width,
        };
        let is_text = |cell: &[u8]| parse(cell, self.dialect.decimal) == Cell::Text;
        let has_numbers = |builder: &Builder<'_>| builder.has_numbers && builder.column.faults.count == 0;
        let is_within_number = || {
            let of_numbers = self.builders.last().is_some_and(has_numbers);
            of_numbers && rows.len() == width && rows.cells().last().is_some_and(is_text)
        };
        rows.len() < width || is_within_number()
    }

    fn push<R: Read>(&mut self, rows: &Rows<R>, headers: &[String]) -> Result<(), TableError> {
        if self.builders.is_empty() {
            if headers.is_empty() && self.first.len() < FIRST_ROWS {
                let texts = rows.cells().map(|cell| cell.len() as u64).sum::<u64>();
                self.budget.claim(texts + TEXT * rows.len() as u64)?;
                self.first
                    .push((rows.line(), rows.cells().map(<[u8]>::to_vec).collect()));
                return Ok(());
            }
            self.begin(headers)?;
        }
        self.add(rows.line(), rows.len(), rows.cells())
    }

    /// Creates the columns and adds the buffered rows.
    fn begin(&mut self, headers: &[String]) -> Result<(), TableError> {
        let waiting = std::mem::take(&mut self.first);
        let width = match headers.len() {
            0 => commonest(waiting.iter().map(|(_, cells)| cells.len())).0,
            width => width,
        };
        let empty_end = self.dialect.trailing_separator && headers.last().is_none_or(String::is_empty);
        let width = width - usize::from(empty_end && width > 1);
        let columns = named(headers, width);
        let roles = self.reading.roles(&columns);
        let columns = columns.into_iter().zip(roles);
        let builders = columns.map(|(column, role)| Builder {
            missing: role.missing,
            labels: role.has_labels.then(Labels::default),
            numbers: Vec::new(),
            has_numbers: false,
            column,
        });
        self.builders = builders.collect();
        for (line, cells) in waiting {
            self.add(line, cells.len(), cells.iter().map(Vec::as_slice))?;
        }
        Ok(())
    }

    fn add<'c>(
        &mut self,
        line: u64,
        count: usize,
        mut cells: impl Iterator<Item = &'c [u8]> + Clone,
    ) -> Result<(), TableError> {
        let width = self.builders.len();
        // A separator at the end of a row does not start another cell.
        if count > width && (count > width + 1 || cells.clone().last().is_some_and(|cell| !cell.is_empty())) {
            self.too_long.add(line);
            return Ok(());
        }
        if count < width {
            self.too_short.add(line);
        }
        if self.rows == LARGEST_ROWS {
            return Err(TableError::Long(LARGEST_ROWS));
        }
        self.budget.claim(NUMBER * width as u64)?;
        for builder in &mut self.builders {
            let added = builder.push(line, cells.next().unwrap_or_default(), &self.dialect);
            if let Some(length) = added {
                self.budget.claim(2 * (length as u64 + TEXT))?;
            }
        }
        self.lines.push(self.rows, line);
        self.rows += 1;
        Ok(())
    }

    fn finish(mut self, path: &Path, headers: Vec<String>) -> Result<Table, TableError> {
        if self.builders.is_empty() {
            self.begin(&headers)?;
        }
        if self.rows == 0 {
            return Err(TableError::Empty);
        }
        let mut notes = Vec::new();
        if let Some(line) = self.torn_line {
            notes.push(format!("line {line}, the last, is cut off and left out"));
        }
        for (excess, what) in [
            (self.too_short, "fewer cells than there are columns, which are missing"),
            (self.too_long, "more cells than there are columns, left out"),
        ] {
            if let Some(line) = excess.first_line {
                notes.push(format!(
                    "{} with {what}, the first on line {line}",
                    counted(excess.rows, "row")
                ));
            }
        }
        Ok(Table {
            variables: Vec::new(),
            path: path.to_owned(),
            columns: self.builders.into_iter().map(Builder::finish).collect(),
            rows: self.rows,
            format: Format::Text(self.dialect),
            notes,
            torn_line: self.torn_line,
            too_long: self.too_long,
            lines: self.lines,
        })
    }
}

impl Builder<'_> {
    /// Adds a cell; returns the length of its text if that is a new label.
    fn push(&mut self, line: u64, cell: &[u8], dialect: &Dialect) -> Option<usize> {
        let found = parse(cell, dialect.decimal);
        let is_missing = found == Cell::Missing || self.missing.iter().any(|missing| missing.is(cell, found));
        self.column.missing += usize::from(is_missing);
        if let Some(labels) = &mut self.labels {
            let text = text_of(cell, dialect.encoding);
            let number = match found {
                Cell::Number(number) => Some(number),
                _ => None,
            };
            let is_new = labels.push((!is_missing).then_some((&text, number)));
            return is_new.then_some(text.len());
        }
        let number = match found {
            Cell::Number(number) if !is_missing && self.column.start.is_none() => {
                self.has_numbers = true;
                number
            }
            Cell::Missing => f64::NAN,
            _ if is_missing => f64::NAN,
            _ => match self.seconds(cell) {
                Some(seconds) => seconds,
                None => {
                    let faults = &mut self.column.faults;
                    faults.count += 1;
                    faults.first.get_or_insert_with(|| Fault {
                        line,
                        text: excerpt(&text_of(cell, dialect.encoding)),
                    });
                    f64::NAN
                }
            },
        };
        self.numbers.push(number);
        None
    }

    /// Returns the seconds since the first time stamp of a column; `None` unless all of its cells are time stamps, all with or
    /// all without a zone.
    fn seconds(&mut self, cell: &[u8]) -> Option<f64> {
        let stamp = TimeStamp::parse(cell)?;
        if self.has_numbers || self.column.faults.count > 0 {
            return None;
        }
        let start = *self.column.start.get_or_insert(stamp);
        (start.has_zone == stamp.has_zone).then(|| stamp.seconds_since(start))
    }

    fn finish(mut self) -> Column {
        if self.column.start.is_some() {
            // Whatever the header says, such as a time zone.
            self.column.unit = Some("s".to_owned());
        }
        Column {
            cells: match self.labels {
                Some(labels) => labels.into_cells(),
                None => Cells::Numbers(self.numbers),
            },
            ..self.column
        }
    }
}

/// Returns `width` columns without cells, with names and units from the cells of the header, if there is one.
pub(super) fn named(headers: &[String], width: usize) -> Vec<Column> {
    let mut columns: Vec<Column> = Vec::new();
    for index in 0..width {
        let given = headers.get(index).map_or("", String::as_str);
        let header = clean_name(given);
        let (name, unit) = name_and_unit(&header);
        let wanted = if name.is_empty() {
            format!("c{}", index + 1)
        } else {
            name.to_owned()
        };
        columns.push(Column {
            name: wanted,
            unit: unit.map(str::to_owned),
            original: original_name(given),
            ..Column::default()
        });
    }
    name_apart(&mut columns);
    columns
}

/// Numbers columns of the same name; a number that is in the header already is left out.
fn name_apart(columns: &mut [Column]) {
    let mut names: HashSet<String> = HashSet::from_iter(columns.iter().map(|column| column.name.clone()));
    let mut counts: HashMap<String, usize> = HashMap::new();
    for column in columns {
        let count = counts.entry(column.name.clone()).or_default();
        *count += 1;
        while *count > 1 {
            let numbered = format!("{}#{count}", column.name);
            if names.insert(numbered.clone()) {
                column.name = numbered;
                break;
            }
            *count += 1;
        }
    }
}

/// Returns the text of a cell. Invalid UTF-8 is read as Latin-1, which maps to the first 256 characters of Unicode.
fn text_of(cell: &[u8], encoding: Encoding) -> String {
    match std::str::from_utf8(cell) {
        Ok(text) if encoding != Encoding::Latin1 => text.to_owned(),
        _ => cell.iter().copied().map(char::from).collect(),
    }
}
