use std::{
    borrow::Cow,
    collections::HashMap,
    ops::Range,
    path::{Path, PathBuf},
};

use decoupler_core::text::{clean_name, counted};

use serde::Serialize;

use super::{Encoding, Format, TableError, format::Cell, time_stamp::TimeStamp};

/// Table read from a file: columns of equal length.
#[derive(Clone, Debug)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// Columns.
    pub columns: Vec<Column>,
    /// Named arrays of numbers in the file, such as the variables of a workspace; none in other formats.
    pub variables: Vec<Variable>,
    /// Number of rows.
    pub rows: usize,
    /// Format of the file.
    pub format: Format,
    /// Notes for the user: rows of unusual length, arrays left out.
    pub notes: Vec<String>,
    /// Last line of a text file, if it is cut off and therefore left out.
    pub torn_line: Option<u64>,
    /// Rows that were left out because they have more cells than there are columns.
    pub too_long: Faults,
    /// Rows that have fewer cells than there are columns.
    pub(super) too_short: Faults,
    /// Rows that do not start on the line after the previous row, with their line: mostly few.
    pub(super) jumps: Vec<(usize, u64)>,
}

/// Named array of numbers in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Variable {
    /// Name.
    pub name: String,
    /// Shape in the file, as text: `2000 × 3`.
    pub shape: String,
    /// Indices of its columns; empty if it is left out, because its rows are not those of the samples.
    pub columns: Range<usize>,
}

impl Table {
    /// Returns a table without rows.
    pub(super) fn new(path: &Path, format: Format) -> Self {
        Self {
            path: path.to_owned(),
            columns: Vec::new(),
            variables: Vec::new(),
            rows: 0,
            format,
            notes: Vec::new(),
            torn_line: None,
            too_long: Faults::default(),
            too_short: Faults::default(),
            jumps: Vec::new(),
        }
    }

    /// Returns the line of a row of a text file, else the number of the row; from 1.
    pub fn line(&self, row: usize) -> u64 {
        let after = self.jumps.partition_point(|(first, _)| *first <= row);
        match after.checked_sub(1).map(|index| self.jumps[index]) {
            Some((first, line)) => line + (row - first) as u64,
            None => row as u64 + 1,
        }
    }

    /// Adds a row that starts on this line, whose cells are in the columns.
    pub(super) fn add_row(&mut self, line: u64) {
        if self.line(self.rows) != line {
            self.jumps.push((self.rows, line));
        }
        self.rows += 1;
    }

    /// Refuses a table with rows that were left out because they are too long.
    pub(super) fn check_widths(&self) -> Result<(), TableError> {
        let reason = "the row has more cells than there are columns; correct it";
        let first = self.too_long.first.as_ref();
        first.map_or(Ok(()), |first| Err(TableError::in_row(first.line, reason)))
    }

    /// Leaves out the rows from this one on.
    pub(super) fn truncate(&mut self, rows: usize) {
        let kept = Vec::from_iter((0..rows as u32).map(Some));
        self.columns.iter_mut().for_each(|column| column.take_rows(&kept));
        self.rows = rows;
    }

    /// Returns a note on a table whose rows seem to be channels: few long rows.
    pub(super) fn transposed_note(&self) -> Option<String> {
        const LONGER: usize = 20;
        let columns = self.columns.len();
        let is_suspect = self.rows < LONGER && columns >= LONGER * self.rows.max(1);
        is_suspect.then(|| {
            format!(
                "it has {} and {columns} columns; each row is a sample: if each row of this file is a channel, transpose it",
                counted(self.rows, "row")
            )
        })
    }

    /// Returns `true` if the columns have names in the file.
    pub(super) fn has_header(&self) -> bool {
        match &self.format {
            Format::Text(dialect) => dialect.header,
            Format::Sheet { header, .. } => *header,
            Format::Npy | Format::Npz | Format::Matlab => true,
        }
    }
}

/// Name of a file without its folder and ending.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(|| "data".to_owned(), |stem| clean_name(&stem.to_string_lossy()))
}

/// Column of a table.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// Name without the unit.
    pub name: String,
    /// Unit, if the header has one in brackets.
    pub unit: Option<String>,
    /// Header in the file, with unprintable characters escaped, if the name lacks some of its characters.
    pub original: Option<String>,
    /// Cells, one per row; NaN if a cell is missing or not a number.
    pub numbers: Vec<f64>,
    /// Labels of a column of groups.
    pub(super) labels: Option<Labels>,
    /// Number of cells that are missing.
    pub missing: usize,
    /// Cells that are neither numbers nor missing.
    pub faults: Faults,
    /// First time stamp of a column of time stamps, whose numbers are the seconds since then.
    pub(super) start: Option<TimeStamp>,
}

/// Cells that are neither numbers nor missing, or rows of unusual length.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Number of such cells or rows.
    pub count: usize,
    /// The first of them.
    pub first: Option<Fault>,
}

impl Faults {
    pub(super) fn add(&mut self, line: u64, text: impl FnOnce() -> String) {
        self.count += 1;
        self.first.get_or_insert_with(|| Fault {
            line,
            text: excerpt(&text()),
        });
    }
}

/// Cell that is neither a number nor missing, or row of unusual length.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Line, from 1.
    pub line: u64,
    /// Text of the cell, shortened; empty for a row.
    pub text: String,
}

impl Column {
    /// Adds a cell with this text, parsed as `found`. The first value decides whether the column has numbers or time stamps,
    /// which become the seconds since the first. Returns the length of the text if it is a new label.
    pub(super) fn push(&mut self, line: u64, cell: &[u8], found: Cell, encoding: Encoding) -> Option<usize> {
        let (mut added, is_missing) = (None, found == Cell::Missing);
        self.missing += usize::from(is_missing);
        let number = match (found, &mut self.labels) {
            (found, Some(labels)) => {
                let text = encoding.text(cell);
                added = labels.push((!is_missing).then_some(&text)).then_some(text.len());
                found.number().unwrap_or(f64::NAN)
            }
            (Cell::Number(number), None) if self.start.is_none() => number,
            (Cell::Missing, None) => f64::NAN,
            _ => self.seconds(cell).unwrap_or_else(|| {
                self.faults.add(line, || encoding.text(cell));
                f64::NAN
            }),
        };
        self.numbers.push(number);
        added
    }

    /// Returns the seconds since the first time stamp; `None` unless all values are time stamps, all with or all without a zone.
    fn seconds(&mut self, cell: &[u8]) -> Option<f64> {
        let stamp = TimeStamp::parse(cell)?;
        if self.start.is_none() && self.numbers.len() == self.missing {
            // Whatever the header says, such as a time zone.
            (self.start, self.unit) = (Some(stamp), Some("s".to_owned()));
        }
        let start = self.start.filter(|_| self.faults.count == 0)?;
        (start.has_zone == stamp.has_zone).then(|| stamp.seconds_since(start))
    }

    /// Returns `true` if the values are numbers, and there is one.
    pub(super) fn has_numbers(&self) -> bool {
        self.labels.is_none() && self.start.is_none() && self.numbers.len() > self.missing + self.faults.count
    }

    /// Returns `true` if the cell is missing, or not a number in a column without labels.
    pub(super) fn is_missing(&self, row: usize) -> bool {
        match &self.labels {
            None => self.numbers[row].is_nan(),
            Some(labels) => labels.of_rows[row].is_none(),
        }
    }

    /// Returns the cell as text; empty if it is missing. A number reads back bit for bit.
    pub(super) fn text(&self, row: usize) -> Cow<'_, str> {
        match &self.labels {
            _ if self.is_missing(row) => Cow::default(),
            None => self.numbers[row].to_string().into(),
            Some(labels) => {
                labels.of_rows[row].map_or(Cow::default(), |label| Cow::from(&labels.texts[label as usize]))
            }
        }
    }

    /// Replaces the cells by those of these rows; missing where there is none.
    pub(super) fn take_rows(&mut self, rows: &[Option<u32>]) {
        let number = |row: &Option<u32>| row.map_or(f64::NAN, |row| self.numbers[row as usize]);
        self.numbers = rows.iter().map(number).collect();
        if let Some(Labels { of_rows, .. }) = &mut self.labels {
            *of_rows = rows.iter().map(|row| of_rows[(*row)? as usize]).collect();
        }
    }

    /// Frees the cells.
    pub(super) fn clear(&mut self) {
        (self.numbers, self.labels) = (Vec::new(), None);
    }

    /// Returns the first label that is not a number.
    pub(super) fn wordy_label(&self) -> Option<&str> {
        let is_wordy = |row: &usize| self.numbers[*row].is_nan() && !self.is_missing(*row);
        let labels = self.labels.as_ref()?;
        let row = (0..self.numbers.len()).find(is_wordy)?;
        Some(&labels.texts[labels.of_rows[row]? as usize])
    }
}

/// Labels of the groups in a column.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    /// Index into `texts` for each cell; `None` if it is missing.
    of_rows: Vec<Option<u32>>,
    /// Labels in order of first occurrence.
    texts: Vec<String>,
    known: HashMap<String, u32>,
}

impl Labels {
    /// Adds a cell. Returns `true` if its label is new.
    pub(super) fn push(&mut self, label: Option<&str>) -> bool {
        let before = self.texts.len();
        let number = label.map(|text| {
            self.known.get(text).copied().unwrap_or_else(|| {
                self.texts.push(clean_name(text));
                self.known.insert(text.to_owned(), before as u32);
                before as u32
            })
        });
        self.of_rows.push(number);
        self.texts.len() > before
    }
}

/// Splits a header such as "x (mm)" or "x [mm]" into name and unit.
pub(super) fn name_and_unit(header: &str) -> (&str, Option<&str>) {
    let header = header.trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some(rest) = header.strip_suffix(close)
            && let Some((name, unit)) = rest.rsplit_once(open)
            && !name.trim().is_empty()
            && !unit.trim().is_empty()
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    (header, None)
}

/// Returns the text for a message: the first 40 characters, with control characters escaped.
pub(super) fn excerpt(text: &str) -> String {
    let text: String = text.chars().take(40).collect();
    if text.contains(char::is_control) {
        text.escape_debug().to_string()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_across_gaps() {
        let mut table = Table::new(Path::new(""), Format::Npy);
        let known = [2, 3, 4, 7, 8, 12];
        for (row, line) in known.into_iter().enumerate() {
            assert_eq!(table.rows, row);
            table.add_row(line);
        }
        assert_eq!(table.jumps.len(), 3);
        for (row, line) in known.into_iter().enumerate() {
            assert_eq!(table.line(row), line);
        }
        assert_eq!(Table::new(Path::new(""), Format::Npy).line(4), 5);
    }

    #[test]
    fn units_are_in_brackets_at_the_end() {
        let cases = [
            ("x (mm)", "x", Some("mm")),
            (" force [N] ", "force", Some("N")),
            ("B(µT)", "B", Some("µT")),
            ("f(x) (1/s)", "f(x)", Some("1/s")),
            ("x", "x", None),
            ("(mm)", "(mm)", None),
            ("x ()", "x ()", None),
            ("x (mm) raw", "x (mm) raw", None),
        ];
        for (header, name, unit) in cases {
            assert_eq!(name_and_unit(header), (name, unit), "{header}");
        }
    }
}
