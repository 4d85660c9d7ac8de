use std::{
    collections::{HashMap, HashSet},
    io::{Cursor, Read},
    path::Path,
};

use decoupler_core::text::{clean_name, counted, original_name};

use super::{
    Column, Decimal, Dialect, DialectChoice, Encoding, Fault, Format, Missing, Table, TableError,
    columns::position,
    detection::{BEGINNING, detect, encoding_of},
    dialect::utf8_of_utf16,
    format::{Cell, parse},
    rows::Rows,
    table::{Labels, name_and_unit},
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
    /// Gives labels to the column that has them, and returns the markers of missing values of each column.
    pub(super) fn give_roles(&self, columns: &mut [Column]) -> Vec<Vec<&'a Missing>> {
        if let Some(label) = self.label.as_ref().and_then(|name| position(columns, name)) {
            columns[label].labels = Some(Labels::default());
        }
        let mut markers = vec![Vec::new(); columns.len()];
        for (name, missing) in &self.missing {
            let of = name.as_ref().map(|name| position(columns, name));
            let is_marked = |column: &usize| of.is_none_or(|of| of == Some(*column));
            let marked = (0..columns.len()).filter(is_marked);
            marked.for_each(|column| markers[column].push(*missing));
        }
        markers
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
    let mut rows = Rows::new(table.chain(text), dialect.separator, dialect.carriage_returns);
    rows.skip(dialect.skipped_lines + usize::from(dialect.sep_line))?;
    let mut headers = Vec::new();
    if dialect.header && rows.advance()? {
        headers = rows.cells().map(|cell| encoding.text(cell)).collect();
    }
    let mut has_row = rows.advance()?;
    let width = match headers.len() {
        // No row ends within the beginning.
        0 if width == 0 => rows.len(),
        0 => width,
        of_headers => of_headers,
    };
    let empty_end = dialect.trailing_separator && headers.last().is_none_or(String::is_empty);
    let mut columns = named(&headers, width - usize::from(empty_end && width > 1));
    let markers = reading.give_roles(&mut columns);
    let width = if headers.is_empty() { width } else { columns.len() };
    let mut table = Table {
        columns,
        ..Table::new(path, Format::Text(dialect))
    };
    while has_row {
        if is_torn(&table, &rows, width, dialect.decimal) {
            let line = rows.line;
            table.torn_line = Some(line);
            let note = format!("line {line}, the last, is cut off and left out");
            table.notes.push(note);
        } else {
            add(&mut table, &rows, &markers, dialect, budget)?;
        }
        has_row = rows.advance()?;
    }
    if table.rows == 0 {
        return Err(TableError::Empty);
    }
    for (rows, what) in [
        (
            &table.too_short,
            "fewer cells than there are columns, which are missing",
        ),
        (&table.too_long, "more cells than there are columns, left out"),
    ] {
        if let Some(Fault { line, .. }) = &rows.first {
            let rows = counted(rows.count, "row");
            let note = format!("{rows} with {what}, the first on line {line}");
            table.notes.push(note);
        }
    }
    Ok(table)
}

/// Reads the beginning, by which the layout is detected.
fn beginning_of(source: &mut impl Read) -> Result<Vec<u8>, TableError> {
    let mut beginning = Vec::new();
    source.take(BEGINNING as u64).read_to_end(&mut beginning)?;
    Ok(beginning)
}

/// Returns `true` if the row is the last of a file that is cut off, as when the disk was full: it ends without a line break,
/// before the last of `width` columns or within its number.
fn is_torn<R: Read>(table: &Table, rows: &Rows<R>, width: usize, decimal: Decimal) -> bool {
    if rows.is_ended || table.rows == 0 {
        return false;
    }
    let is_text = |cell: &[u8]| parse(cell, decimal) == Cell::Text;
    let has_numbers = |column: &Column| column.has_numbers() && column.faults.count == 0;
    let ends_in_text = || rows.len() == table.columns.len() && rows.cells().last().is_some_and(is_text);
    rows.len() < width || (table.columns.last().is_some_and(has_numbers) && ends_in_text())
}

/// Adds a row; `markers` are those of missing values of each column.
fn add<R: Read>(
    table: &mut Table,
    rows: &Rows<R>,
    markers: &[Vec<&Missing>],
    dialect: Dialect,
    budget: &mut ReadingBudget,
) -> Result<(), TableError> {
    let (line, count) = (rows.line, rows.len());
    let (mut cells, width) = (rows.cells(), table.columns.len());
    // A separator at the end of a row does not start another cell.
    if count > width && (count > width + 1 || cells.clone().last().is_some_and(|cell| !cell.is_empty())) {
        table.too_long.add(line, String::new);
        return Ok(());
    }
    if count < width {
        table.too_short.add(line, String::new);
    }
    if table.rows == LARGEST_ROWS {
        let reason = format!("it has more than {LARGEST_ROWS} rows; use every second row, or a part of the file");
        return Err(TableError::Contents(reason));
    }
    budget.claim(NUMBER * width as u64)?;
    for (column, missing) in table.columns.iter_mut().zip(markers) {
        let cell = cells.next().unwrap_or_default();
        let found = match parse(cell, dialect.decimal) {
            found if missing.iter().any(|missing| missing.is(cell, found)) => Cell::Missing,
            found => found,
        };
        if let Some(length) = column.push(line, cell, found, dialect.encoding) {
            budget.claim(2 * (length as u64 + TEXT))?;
        }
    }
    table.add_row(line);
    Ok(())
}

/// Returns `width` columns without cells, with names and units from the cells of the header, if there is one.
pub(super) fn named(headers: &[String], width: usize) -> Vec<Column> {
    let column = |index: usize| {
        let given = headers.get(index).map_or("", String::as_str);
        let header = clean_name(given);
        let (name, unit) = match name_and_unit(&header) {
            ("", unit) => (format!("c{}", index + 1), unit),
            (name, unit) => (name.to_owned(), unit),
        };
        Column {
            name,
            unit: unit.map(str::to_owned),
            original: original_name(given),
            ..Column::default()
        }
    };
    let mut columns = Vec::from_iter((0..width).map(column));
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
        while *count > 1 && !names.insert(format!("{}#{count}", column.name)) {
            *count += 1;
        }
        if *count > 1 {
            column.name = format!("{}#{count}", column.name);
        }
    }
}
