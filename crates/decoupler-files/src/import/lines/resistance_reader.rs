use std::io::{self, BufRead, Read};

use csv_core::{ReadRecordResult, Reader};
use decoupler_core::text::counted;
use ndarray::Array2;
use thiserror::Error;

use crate::machine::system_cause;

/// Reads resistances from CSV block by block, so that large files need little memory.
///
/// The file has columns named `r_1` to `r_M4`, in any order and among others, or M4 columns without names.
pub struct ResistanceReader<R> {
    rows: Rows<R>,
    channels: usize,
    columns: ResistanceColumns,
    /// Number of row-wires of the array, if row-wires are to be read.
    row_wires: Option<usize>,
    /// `true` if the current row was already read while looking for column names.
    waiting: bool,
    /// `true` once a row of resistances was read.
    has_rows: bool,
    /// Last line, if it is cut off.
    torn_line: Option<u64>,
}

/// Rows of a CSV file with their line numbers.
struct Rows<R> {
    source: R,
    text: Vec<u8>,
    /// Line number of the current row, from 1.
    line: u64,
    fields: CsvFields,
}

/// A block of rows of resistances.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Resistances in ohm: rows × M4.
    pub resistances_ohm: Array2<f64>,
    /// Line number of each row in the file, from 1.
    pub lines: Vec<u64>,
    /// Row-wire of each row, from 0, if requested and the file has a column `row`.
    pub row_wires: Option<Vec<usize>>,
}

/// Error in a file of resistances. Lines and columns are counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file has no rows of resistances.
    #[error("there are no rows of resistances in it; give one line for each row-wire")]
    Empty,
    /// A column is missing.
    #[error("there is no column r_{0}; name the columns r_1 to r_{1}, or give {1} columns without names")]
    Missing(usize, usize),
    /// A column name occurs twice.
    #[error("there are two columns r_{0}; keep one")]
    Twice(usize),
    /// The number of columns in a row is wrong.
    #[error("line {line}: {} where {expected} are needed, separated by commas", counted(*.found, "column"))]
    Width {
        /// Line number.
        line: u64,
        /// Number of columns found.
        found: usize,
        /// Number of columns expected.
        expected: usize,
    },
    /// A field is not a resistance.
    #[error("line {line}, column {column}: '{text}' is not a resistance; give a finite number of ohm above 0")]
    Value {
        /// Line number.
        line: u64,
        /// Column number.
        column: usize,
        /// Text of the field.
        text: String,
    },
    /// A field is not a valid row-wire number.
    #[error("line {line}, column {column}: '{text}' is not a row-wire; give a number from 1 to {rows}")]
    RowWire {
        /// Line number.
        line: u64,
        /// Column number.
        column: usize,
        /// Text of the field.
        text: String,
        /// Number of row-wires of the array.
        rows: usize,
    },
    /// A line break does not end a row: it is within quotes, or is a single carriage return.
    #[error("line {0}: there is a line break within the row; end rows, and only rows, with LF or CR LF")]
    LineBreak(u64),
    /// A row has no end, or only blank lines follow.
    #[error("line {0}: no row ends within 1 MiB; give one line for each row-wire")]
    Endless(u64),
    /// The file could not be read.
    #[error("{}", system_cause(.0))]
    Io(#[from] io::Error),
}

/// Maximum number of bytes up to the end of the next row, blank lines included: 1 MiB. A row of the largest array takes
/// about 100 kB.
pub const LONGEST_ROW: u64 = 1 << 20;

impl<R: BufRead> Rows<R> {
    /// Advances to the next row that is not blank; returns `false` at the end.
    fn advance(&mut self) -> Result<bool, ReadError> {
        let mut left = LONGEST_ROW;
        loop {
            self.text.clear();
            let read = (&mut self.source).take(left).read_until(b'\n', &mut self.text)? as u64;
            if read == 0 && left > 0 {
                return Ok(false);
            }
            self.line += 1;
            left -= read;
            if left == 0 {
                return Err(ReadError::Endless(self.line));
            }
            let byte_order_mark: &[u8] = if self.line == 1 { b"\xef\xbb\xbf" } else { b"" };
            let text = self
                .text
                .strip_prefix(byte_order_mark)
                .unwrap_or(&self.text)
                .trim_ascii();
            if text.is_empty() {
                continue;
            }
            if text.contains(&b'\r') {
                return Err(ReadError::LineBreak(self.line));
            }
            self.fields.split(text);
            return Ok(true);
        }
    }
}

impl<R: BufRead> ResistanceReader<R> {
    /// Creates a reader and reads the column names, if there are any; `channels` is M4.
    ///
    /// # Errors
    /// If the file cannot be read or is empty, or a column is missing or duplicated.
    pub fn new(source: R, channels: usize) -> Result<Self, ReadError> {
        let mut rows = Rows {
            source,
            text: Vec::new(),
            line: 0,
            fields: CsvFields::default(),
        };
        if !rows.advance()? {
            return Err(ReadError::Empty);
        }
        let fields = &rows.fields;
        let has_names =
            ResistanceColumns::has_name(fields, channels) || fields.iter().all(|field| number(field).is_none());
        let columns = if has_names {
            ResistanceColumns::named(fields, channels)?
        } else {
            ResistanceColumns::unnamed(channels, false)
        };
        Ok(Self {
            rows,
            channels,
            columns,
            row_wires: None,
            waiting: !has_names,
            has_rows: false,
            torn_line: None,
        })
    }

    /// Also reads the column `row`, if there is one: the row-wire number, from 1 to `row_wires`.
    #[must_use]
    pub fn with_row_wires(self, row_wires: usize) -> Self {
        Self {
            row_wires: Some(row_wires),
            ..self
        }
    }

    /// Returns the number of the last line if it is cut off: malformed and without a line break. It is ignored, unless it is
    /// the only row.
    pub fn torn_line(&self) -> Option<u64> {
        self.torn_line
    }

    /// Reads at most `most` further rows; returns `None` at the end.
    ///
    /// # Errors
    /// If the file cannot be read, or a row is malformed.
    pub fn read(&mut self, most: usize) -> Result<Option<Reading>, ReadError> {
        let mut resistances_ohm = Vec::with_capacity(most * self.channels);
        let mut lines = Vec::new();
        let of_array = self.row_wires.filter(|_| self.columns.has_row());
        let mut row_wires = of_array.map(|_| Vec::new());
        while lines.len() < most && (self.waiting || self.rows.advance()?) {
            self.waiting = false;
            let Rows { line, ref fields, .. } = self.rows;
            let whole = resistances_ohm.len();
            let read = self.columns.read(line, fields, &mut resistances_ohm).and_then(|()| {
                if let Some((row_wires, rows)) = row_wires.as_mut().zip(of_array) {
                    row_wires.extend(self.columns.row_wire(line, fields, rows)?);
                }
                Ok(())
            });
            if let Err(error) = read {
                if self.rows.text.ends_with(b"\n") || !self.has_rows {
                    return Err(error);
                }
                resistances_ohm.truncate(whole);
                self.torn_line = Some(line);
                break;
            }
            lines.push(line);
            self.has_rows = true;
        }
        if lines.is_empty() {
            return Ok(None);
        }
        let shape = (lines.len(), self.channels);
        let resistances_ohm = Array2::from_shape_vec(shape, resistances_ohm).expect("every row has M4 values");
        Ok(Some(Reading {
            resistances_ohm,
            lines,
            row_wires,
        }))
    }
}

/// Columns of resistances in lines of CSV: named `r_1` to `r_M4`, in any order and among others, or without names.
#[derive(Clone, Debug)]
pub struct ResistanceColumns {
    /// Column index of each resistance, in the order r_1 to r_M4.
    resistances: Vec<usize>,
    /// Column index of the row-wire, if there is such a column.
    row: Option<usize>,
    /// Number of columns in a line.
    width: usize,
}

impl ResistanceColumns {
    /// Finds the columns in a line of names.
    ///
    /// # Errors
    /// If a column is missing or duplicated.
    pub fn named(names: &CsvFields, channels: usize) -> Result<Self, ReadError> {
        let mut resistances = vec![None; channels];
        for (column, name) in names.iter().enumerate() {
            if let Some(channel) = channel_of(name, channels)
                && resistances[channel - 1].replace(column).is_some()
            {
                return Err(ReadError::Twice(channel));
            }
        }
        let missing = |index: usize| ReadError::Missing(index + 1, channels);
        let resistances = resistances.iter().enumerate();
        Ok(Self {
            resistances: resistances
                .map(|(index, column)| column.ok_or_else(|| missing(index)))
                .collect::<Result<_, _>>()?,
            row: names.iter().position(|name| name == b"row"),
            width: names.count(),
        })
    }

    /// Columns without names: `count` resistances, after the row-wire if lines begin with it.
    pub fn unnamed(count: usize, begins_with_row: bool) -> Self {
        let before = usize::from(begins_with_row);
        Self {
            resistances: (before..before + count).collect(),
            row: begins_with_row.then_some(0),
            width: before + count,
        }
    }

    /// Returns `true` for a line with the name of a resistance column.
    pub fn has_name(fields: &CsvFields, channels: usize) -> bool {
        fields.iter().any(|name| channel_of(name, channels).is_some())
    }

    /// Returns `true` if lines contain their row-wire.
    pub fn has_row(&self) -> bool {
        self.row.is_some()
    }

    /// Appends the resistances of a line.
    ///
    /// # Errors
    /// If the line has the wrong number of columns, or a field is not a resistance.
    pub fn read(&self, line: u64, fields: &CsvFields, resistances_ohm: &mut Vec<f64>) -> Result<(), ReadError> {
        let (found, expected) = (fields.count(), self.width);
        if !fields.has_width(expected) {
            return Err(ReadError::Width { line, found, expected });
        }
        for &column in &self.resistances {
            let field = fields.get(column);
            let value = number(field).filter(|ohm| *ohm > 0.0 && ohm.is_finite());
            resistances_ohm.push(value.ok_or_else(|| ReadError::Value {
                line,
                column: column + 1,
                text: excerpt(field),
            })?);
        }
        Ok(())
    }

    /// Returns the row-wire of a line, from 0, if lines contain it; `rows` is the number of row-wires of the array.
    ///
    /// # Errors
    /// If the field is not the number of a row-wire.
    pub fn row_wire(&self, line: u64, fields: &CsvFields, rows: usize) -> Result<Option<usize>, ReadError> {
        let Some(column) = self.row else {
            return Ok(None);
        };
        let field = fields.get(column);
        let number: Option<usize> = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
        match number.filter(|number| (1..=rows).contains(number)) {
            Some(number) => Ok(Some(number - 1)),
            None => Err(ReadError::RowWire {
                line,
                column: column + 1,
                text: excerpt(field),
                rows,
            }),
        }
    }
}

/// Returns the text of a field, shortened to 40 characters for a message, control characters escaped.
fn excerpt(field: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(field).chars().take(40).collect();
    if text.contains(char::is_control) {
        text.escape_debug().to_string()
    } else {
        text
    }
}

/// Parses a number; `None` if the field is not a number.
pub fn number(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.trim().parse().ok()
}

/// Returns k for a column named `r_k`, with k from 1 to `channels`.
fn channel_of(name: &[u8], channels: usize) -> Option<usize> {
    let number = std::str::from_utf8(name).ok()?.strip_prefix("r_")?;
    number.parse().ok().filter(|channel| (1..=channels).contains(channel))
}

/// Fields of one line of CSV, reused between lines to avoid allocation.
#[derive(Debug)]
pub struct CsvFields {
    parser: Reader,
    text: Vec<u8>,
    /// End of each field in `text`.
    ends: Vec<usize>,
    count: usize,
}

impl Default for CsvFields {
    fn default() -> Self {
        Self {
            // `Reader::default` has no tables.
            parser: Reader::new(),
            text: Vec::new(),
            ends: Vec::new(),
            count: 0,
        }
    }
}

impl CsvFields {
    /// Splits a line without its line break.
    pub fn split(&mut self, line: &[u8]) {
        self.parser.reset();
        // Lines of similar length need no reallocation.
        self.text.resize(self.text.len().max(line.len().next_power_of_two()), 0);
        let (mut rest, mut written) = (line, 0);
        self.count = 0;
        loop {
            let (result, read, text, ends) =
                self.parser
                    .read_record(rest, &mut self.text[written..], &mut self.ends[self.count..]);
            rest = &rest[read..];
            written += text;
            self.count += ends;
            match result {
                // The parser treats the empty rest as the end of the record.
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len() + 1, 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len() + 8, 0),
                ReadRecordResult::Record | ReadRecordResult::End => break,
            }
        }
    }

    /// Number of fields.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns `true` for a line of `width` fields. An empty field behind them is that of a trailing comma.
    pub fn has_width(&self, width: usize) -> bool {
        self.count == width || self.ends_with_comma() && self.count == width + 1
    }

    /// Returns `true` if the last of several fields is empty.
    pub fn ends_with_comma(&self) -> bool {
        self.count > 1 && self.get(self.count - 1).is_empty()
    }

    /// Field with this index, without surrounding spaces.
    ///
    /// # Panics
    /// If there are not this many fields.
    pub fn get(&self, index: usize) -> &[u8] {
        let ends = &self.ends[..self.count];
        let start = if index == 0 { 0 } else { ends[index - 1] };
        self.text[start..ends[index]].trim_ascii()
    }

    /// Iterates over the fields of the line.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.count).map(|index| self.get(index))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn read(text: &str) -> Result<Reading, ReadError> {
        ResistanceReader::new(text.as_bytes(), 2)?
            .read(100)?
            .ok_or(ReadError::Empty)
    }

    #[test]
    fn columns_are_found_by_name_or_order() {
        for text in [
            "1.5,2\n3,4e0\n",
            " 1.5 , 2\r\n3,4",
            "r_2,note,r_1\n2,\"a, b\",1.5\n4,,3\n",
            "\u{feff}r_1,r_2\n1.5,2\n\n3,4\n",
            "\u{feff}1.5,2\n3,4\n",
        ] {
            assert_eq!(
                read(text).unwrap().resistances_ohm,
                array![[1.5, 2.0], [3.0, 4.0]],
                "{text}"
            );
        }
    }

    #[test]
    fn endless_rows_are_refused() {
        let endless = |byte| {
            ResistanceReader::new(io::BufReader::new(io::repeat(byte)), 2)
                .err()
                .unwrap()
        };
        for byte in [b'1', b'\n', b',', b'"', 0, 255] {
            assert!(matches!(endless(byte), ReadError::Endless(_)), "{byte}");
        }
        let long = format!("1,2\n{}\n", "1".repeat(1 << 20));
        assert!(matches!(read(&long), Err(ReadError::Endless(2))));
        let with_note = format!("r_1,r_2,note\n1,2,{}\n", "x".repeat(1 << 19));
        assert_eq!(read(&with_note).unwrap().lines, [2]);
    }

    #[test]
    fn a_last_line_that_is_cut_off_is_ignored_and_reported() {
        for (text, rows, torn) in [
            ("r_1,r_2\n1,2\n3,4\n5", 2, Some(4)),
            ("1,2\n3,4\n5,", 2, Some(3)),
            ("1,2\n3,4\n5,6e-", 2, Some(3)),
            ("1,2\n3,4\n5,6", 3, None),
        ] {
            let mut reader = ResistanceReader::new(text.as_bytes(), 2).unwrap();
            let mut lines = 0;
            while let Some(block) = reader.read(2).unwrap() {
                lines += block.lines.len();
            }
            assert_eq!((lines, reader.torn_line()), (rows, torn), "{text}");
        }
        for refused in ["1,2\n3\n5,6", "1,2\n3\n", "r_1,r_2\n1"] {
            assert!(matches!(read(refused), Err(ReadError::Width { .. })), "{refused}");
        }
    }

    #[test]
    fn blocks_follow_each_other_without_gaps() {
        let text: String = (1..=7).map(|k| format!("{k},{k}.5\n")).collect();
        let mut reader = ResistanceReader::new(text.as_bytes(), 2).unwrap();
        let mut read = Vec::new();
        while let Some(block) = reader.read(3).unwrap() {
            read.extend(block.lines);
        }
        assert_eq!(read, [1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn row_wires_are_read_if_requested_and_present() {
        let rows = |text: &str, wanted: Option<usize>| {
            let reader = ResistanceReader::new(text.as_bytes(), 2)?;
            let mut reader = match wanted {
                Some(rows) => reader.with_row_wires(rows),
                None => reader,
            };
            Ok::<_, ReadError>(reader.read(100)?.and_then(|reading| reading.row_wires))
        };
        let text = "row,r_1,r_2\n3,1,2\n1,1,2\n";
        assert_eq!(rows(text, Some(3)).unwrap(), Some(vec![2, 0]));
        assert_eq!(rows(text, None).unwrap(), None);
        assert_eq!(rows("r_1,r_2\n1,2\n", Some(3)).unwrap(), None);
        assert_eq!(
            rows("row,r_1,r_2\nx,1,2\n", None).unwrap(),
            None,
            "the column is ignored if not requested"
        );
        let message = rows(text, Some(2)).unwrap_err().to_string();
        assert!(message.contains("line 2, column 1: '3'"), "{message}");
    }

    #[test]
    fn errors_name_line_and_column() {
        let cases = [
            ("nothing", "", "no rows"),
            ("names only", "r_1,r_2\n", "no rows"),
            ("a channel too few", "r_1,b\n1,2\n", "no column r_2"),
            ("other names", "a,b\n1,2\n", "no column r_1"),
            ("a channel twice", "r_1,r_2,r_2\n", "two columns r_2"),
            ("a short row", "r_1,r_2\n1,2\n3\n", "line 3: 1 column where 2"),
            ("too many columns", "1,2,3\n", "line 1: 3 columns where 2"),
            ("semicolons", "r_1;r_2\n1;2\n", "no column r_1"),
            ("a word", "1,2\n3,many\n", "line 2, column 2: 'many'"),
            ("a word in the first row", "1,many\n", "line 1, column 2: 'many'"),
            ("NaN", "r_1,r_2\nNaN,1\n", "line 2, column 1: 'NaN'"),
            ("infinity", "1,inf\n", "column 2: 'inf'"),
            ("overflow", "1,1e999\n", "column 2: '1e999'"),
            ("negative", "1,-2\n", "column 2: '-2'"),
            ("zero", "0,2\n", "column 1: '0'"),
            ("empty", "r_1,r_2\n\n\n1,\n", "line 4, column 2: ''"),
            ("old line ends", "1,2\r3,4\r", "line 1: there is a line break"),
            ("not text", "1,\u{0}\u{1b}[2J\n", "column 2: '\\0\\u{1b}[2J'"),
        ];
        for (sentence, text, expected) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{sentence}: {message}");
        }
    }

    #[test]
    fn fields_are_split_as_by_the_csv_crate() {
        let long = format!("\"{}\",{}", "x".repeat(5000), "1,".repeat(500));
        let mut fields = CsvFields::default();
        for line in [
            "1.5, 2 ,3",
            "a",
            "\"a, b\",\"say \"\"yes\"\"\",",
            ",,",
            long.as_str(),
            "\"unbalanced,1",
            "1\"2,3",
        ] {
            fields.split(line.as_bytes());
            let mut record = csv::ByteRecord::new();
            let mut reader = csv::ReaderBuilder::new()
                .has_headers(false)
                .from_reader(line.as_bytes());
            assert!(reader.read_byte_record(&mut record).unwrap());
            record.trim();
            assert!(fields.iter().eq(&record), "{line}");
        }
    }
}
