use std::{
    collections::{HashMap, HashSet},
    io::{Cursor, Read},
    path::Path,
};

use decoupler_core::text::{clean_name, counted, original_name};

use super::{
    Column, Dialect, DialectChoice, Encoding, Format, Missing, Table, TableError,
    columns::position,
    detection::{BEGINNING, detect, encoding_of},
    dialect::utf8_of_utf16,
    format::{Cell, parse},
    progress::table_error,
    rows::Rows,
    table::{Excess, Labels, name_and_unit},
    time_stamp::TimeStamp,
};
use crate::machine::ReadingBudget;

/// Maximum number of rows; ten hours at 1 kHz are fewer.
const LARGEST_ROWS: usize = 50_000_000;
/// Memory of a number in bytes, in a vector that has just doubled.
const NUMBER: u64 = 2 * size_of::<f64>() as u64;
/// Memory of a short text in bytes, without its letters.
const TEXT: u64 = 64;

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

impl<'a> Reading<'a> {
    /// Returns the markers of missing values of each column, and `true` if it holds labels.
    pub(super) fn roles(&self, columns: &[Column]) -> Vec<(Vec<&'a Missing>, bool)> {
        let find = |name: &String| position(columns, name);
        let label = self.label.as_ref().and_then(find);
        let markers = self
            .missing
            .iter()
            .map(|(name, missing)| (name.as_ref().map(find), *missing));
        let markers = Vec::from_iter(markers);
        let of = |column| {
            let is_marker = |of: &Option<Option<usize>>| of.is_none_or(|of| of == Some(column));
            let markers = markers.iter().filter(|(of, _)| is_marker(of));
            (markers.map(|(_, missing)| *missing).collect(), label == Some(column))
        };
        (0..columns.len()).map(of).collect()
    }
}

/// Reads a table from text. `budget` limits its memory.
pub(super) fn read(
    path: &Path,
    mut source: impl Read,
    reading: &Reading<'_>,
    budget: &mut ReadingBudget,
) -> Result<Table, TableError> {
    let bytes = beginning_of(&mut source)?;
    let encoding = reading.choice.encoding.unwrap_or_else(|| encoding_of(&bytes));
    let whole = Cursor::new(bytes).chain(source);
    let mut text: Box<dyn Read + '_> = match encoding {
        Encoding::Utf8 | Encoding::Latin1 => Box::new(whole),
        Encoding::Utf16Le | Encoding::Utf16Be => Box::new(utf8_of_utf16(whole, encoding == Encoding::Utf16Le)),
    };
    let beginning = beginning_of(&mut text)?;
    let is_whole = beginning.len() < BEGINNING;
    let table = beginning.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&beginning);
    let (dialect, width) = detect(table, is_whole, encoding, &reading.choice)?;
    let text = table.chain(text);
    let mut rows = Rows::new(text, dialect.separator, dialect.carriage_returns);
    rows.skip(dialect.skipped_lines + usize::from(dialect.sep_line))?;
    let mut headers = Vec::new();
    if dialect.header && rows.advance()? {
        headers = rows.cells().map(|cell| text_of(cell, encoding)).collect();
    }
    let mut has_row = rows.advance()?;
    let width = match headers.len() {
        // No row ends within the beginning.
        0 if width == 0 => rows.len(),
        0 => width,
        of_headers => of_headers,
    };
    let empty_end = dialect.trailing_separator && headers.last().is_none_or(String::is_empty);
    let columns = named(&headers, width - usize::from(empty_end && width > 1));
    let roles = reading.roles(&columns);
    let builders = columns
        .into_iter()
        .zip(roles)
        .map(|(column, (missing, has_labels))| Builder {
            column: Column {
                labels: has_labels.then(Labels::default),
                ..column
            },
            has_numbers: false,
            missing,
        });
    let mut body = Body {
        dialect,
        budget,
        builders: builders.collect(),
        table: Table::new(path, Format::Text(dialect)),
        too_short: Excess::default(),
    };
    let width = if headers.is_empty() { width } else { body.builders.len() };
    while has_row {
        if body.is_torn(&rows, width) {
            body.table.torn_line = Some(rows.line());
        } else {
            body.add(&rows)?;
        }
        has_row = rows.advance()?;
    }
    body.finish()
}

/// Reads the beginning, by which the layout is detected.
fn beginning_of(source: &mut impl Read) -> Result<Vec<u8>, TableError> {
    let mut beginning = Vec::new();
    let read = source.take(BEGINNING as u64).read_to_end(&mut beginning);
    read.map_err(table_error)?;
    Ok(beginning)
}

/// The rows after the header.
struct Body<'a> {
    dialect: Dialect,
    budget: &'a mut ReadingBudget,
    builders: Vec<Builder<'a>>,
    /// The table without its columns.
    table: Table,
    too_short: Excess,
}

struct Builder<'a> {
    column: Column,
    /// `true` once a cell was a number.
    has_numbers: bool,
    missing: Vec<&'a Missing>,
}

impl Body<'_> {
    /// Returns `true` if the row is the last of a file that is cut off, as when the disk was full: it ends without a line
    /// break, before the last of `width` columns or within its number.
    fn is_torn<R: Read>(&self, rows: &Rows<R>, width: usize) -> bool {
        if rows.is_ended() || self.table.rows == 0 {
            return false;
        }
        let is_text = |cell: &[u8]| parse(cell, self.dialect.decimal) == Cell::Text;
        let has_numbers = |builder: &Builder<'_>| builder.has_numbers && builder.column.faults.count == 0;
        let ends_in_text = || rows.len() == self.builders.len() && rows.cells().last().is_some_and(is_text);
        rows.len() < width || (self.builders.last().is_some_and(has_numbers) && ends_in_text())
    }

    fn add<R: Read>(&mut self, rows: &Rows<R>) -> Result<(), TableError> {
        let (line, width, count) = (rows.line(), self.builders.len(), rows.len());
        let mut cells = rows.cells();
        // A separator at the end of a row does not start another cell.
        if count > width && (count > width + 1 || cells.clone().last().is_some_and(|cell| !cell.is_empty())) {
            self.table.too_long.add(line);
            return Ok(());
        }
        if count < width {
            self.too_short.add(line);
        }
        if self.table.rows == LARGEST_ROWS {
            let reason = format!("it has more than {LARGEST_ROWS} rows; use every second row, or a part of the file");
            return Err(TableError::Contents(reason));
        }
        self.budget.claim(NUMBER * width as u64)?;
        for builder in &mut self.builders {
            let added = builder.push(line, cells.next().unwrap_or_default(), &self.dialect);
            if let Some(length) = added {
                self.budget.claim(2 * (length as u64 + TEXT))?;
            }
        }
        self.table.lines.push(self.table.rows, line);
        self.table.rows += 1;
        Ok(())
    }

    fn finish(self) -> Result<Table, TableError> {
        let mut table = self.table;
        if table.rows == 0 {
            return Err(TableError::Empty);
        }
        let torn = table
            .torn_line
            .map(|line| format!("line {line}, the last, is cut off and left out"));
        table.notes.extend(torn);
        for (excess, what) in [
            (self.too_short, "fewer cells than there are columns, which are missing"),
            (table.too_long, "more cells than there are columns, left out"),
        ] {
            if let Some(line) = excess.first_line {
                let rows = counted(excess.rows, "row");
                table
                    .notes
                    .push(format!("{rows} with {what}, the first on line {line}"));
            }
        }
        table.columns = self.builders.into_iter().map(Builder::finish).collect();
        Ok(table)
    }
}

impl Builder<'_> {
    /// Adds a cell; returns the length of its text if that is a new label.
    fn push(&mut self, line: u64, cell: &[u8], dialect: &Dialect) -> Option<usize> {
        let found = parse(cell, dialect.decimal);
        let is_missing = found == Cell::Missing || self.missing.iter().any(|missing| missing.is(cell, found));
        self.column.missing += usize::from(is_missing);
        let mut added = None;
        let number = match (found.number(), &mut self.column.labels) {
            (number, Some(labels)) => {
                let text = text_of(cell, dialect.encoding);
                added = labels.push((!is_missing).then_some(&text)).then_some(text.len());
                number.filter(|_| !is_missing).unwrap_or(f64::NAN)
            }
            _ if is_missing => f64::NAN,
            (Some(number), None) if self.column.start.is_none() => {
                self.has_numbers = true;
                number
            }
            _ => self.seconds(cell).unwrap_or_else(|| {
                self.column.faults.add(line, || text_of(cell, dialect.encoding));
                f64::NAN
            }),
        };
        self.column.numbers.push(number);
        added
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
        self.column
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
