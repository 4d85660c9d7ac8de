use decoupler_core::{
    scene::{RowModel, Rows, SceneError},
    sensor::ArrayScale,
};
use thiserror::Error;

use super::resistance_reader::{CsvFields, ReadError, ResistanceColumns, number as parsed_number};

/// Parses frames from successive CSV lines, without allocation in steady state.
///
/// A line has the resistances of one row-wire: in columns named as for `decode`, possibly among others; as M4 unnamed
/// columns; or as M4 + 1 unnamed columns, the first being the number of the row-wire. Or it has those of a whole
/// snapshot: rows × M4 unnamed columns, row by row. The first line of readings determines the layout; a header may be
/// repeated, for example when a device restarts, and a comma may end a line.
#[derive(Debug)]
pub struct LineParser {
    scale: ArrayScale,
    rows: Rows,
    /// Row-wires read.
    read: Vec<usize>,
    /// True if the input is read from its beginning, so that the row-wire follows from the line count.
    is_complete: bool,
    fields: CsvFields,
    layout: Option<Layout>,
    /// True once a line had readings.
    has_frames: bool,
    /// Number of single-row lines without a row number so far, valid or not.
    turns: usize,
    readings_ohm: Vec<f64>,
}

#[derive(Debug)]
struct Layout {
    columns: ResistanceColumns,
    has_names: bool,
    is_snapshot: bool,
}

/// Contents of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParsedLine<'a> {
    /// An empty line or a header.
    NoReadings,
    /// Resistances of one row-wire in ohm: M4.
    Row {
        /// Index among the row-wires read; `None` if unknown.
        row_index: Option<usize>,
        /// Readings: M4.
        readings_ohm: &'a [f64],
    },
    /// Resistances of all row-wires read, in ohm: rows × M4.
    Snapshot(&'a [f64]),
}

/// Error in a line. The next line can be read unless the error [is final](LineError::is_final).
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LineError {
    /// A field is missing or wrong.
    #[error(transparent)]
    Fields(#[from] ReadError),
    /// A resistance is missing from the header, or is named twice.
    #[error("line {line}: {source}")]
    Names {
        /// Line number.
        line: u64,
        /// Error in the header.
        source: ReadError,
    },
    /// The network does not read this row-wire.
    #[error("line {line}: it belongs to row {row}, but the network reads only row {rows}")]
    OtherRow {
        /// Line number.
        line: u64,
        /// Row-wire, from 1.
        row: usize,
        /// Rows that are read.
        rows: Rows,
    },
    /// The line has no row number, which the network needs.
    #[error(
        "line {0}: it has no row number, and it is not known with which row a device begins; send the row number before \
         the resistances, or whole snapshots in one line"
    )]
    NoRow(u64),
}

impl LineError {
    /// Returns `true` if later lines cannot be assigned to wires either, so that decoding must stop.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Names { .. } | Self::NoRow(_))
    }
}

impl LineParser {
    /// Prepares to read lines for a network of `rows` of an array. `is_complete` means that the input is read from its
    /// beginning and no line is lost, so that the row of a line without a row number follows from counting lines.
    ///
    /// # Errors
    /// If the array does not have the row.
    pub fn new(scale: ArrayScale, rows: Rows, is_complete: bool) -> Result<Self, SceneError> {
        Ok(Self {
            read: rows.read(scale.rows())?,
            scale,
            rows,
            is_complete,
            fields: CsvFields::default(),
            layout: None,
            has_frames: false,
            turns: 0,
            readings_ohm: Vec::with_capacity(scale.rows() * scale.columns()),
        })
    }

    /// Returns whether each line is a whole snapshot; `None` before the first line of readings.
    pub fn is_snapshot(&self) -> Option<bool> {
        self.layout.as_ref().map(|layout| layout.is_snapshot)
    }

    /// Parses a line without its line break; `number` is used in messages.
    ///
    /// # Errors
    /// If the line is not a frame.
    pub fn parse(&mut self, number: u64, line: &[u8]) -> Result<ParsedLine<'_>, LineError> {
        let byte_order_mark: &[u8] = if number == 1 { b"\xef\xbb\xbf" } else { b"" };
        let text = line.strip_prefix(byte_order_mark).unwrap_or(line).trim_ascii();
        if text.is_empty() {
            return Ok(ParsedLine::NoReadings);
        }
        if text.contains(&b'\r') {
            self.count_bad();
            return Err(ReadError::LineBreak(number).into());
        }
        self.fields.split(text);
        if self.has_names() {
            let columns = ResistanceColumns::named(&self.fields, self.scale.columns());
            // After a frame, a device that starts again repeats its header whole; other texts are garbage, or an overflow.
            if !self.has_frames || columns.is_ok() {
                self.layout = Some(Layout {
                    columns: columns.map_err(|source| LineError::Names { line: number, source })?,
                    has_names: true,
                    is_snapshot: false,
                });
                return Ok(ParsedLine::NoReadings);
            }
        }
        let is_first = self.layout.is_none();
        let layout = self.layout.get_or_insert_with(|| {
            let found = self.fields.count() - usize::from(self.fields.ends_with_comma());
            Layout::unnamed(found, self.scale, self.read.len())
        });
        self.readings_ohm.clear();
        let columns = &layout.columns;
        let read = columns.read(number, &self.fields, &mut self.readings_ohm);
        let row_wire = read.and_then(|()| columns.row_wire(number, &self.fields, self.scale.rows()));
        let is_snapshot = layout.is_snapshot;
        self.has_frames |= row_wire.is_ok();
        match row_wire {
            Err(error) => {
                self.count_bad();
                if is_first && !self.layout.as_ref().is_some_and(|layout| layout.has_names) {
                    self.layout = None;
                }
                Err(error.into())
            }
            Ok(_) if is_snapshot => Ok(ParsedLine::Snapshot(&self.readings_ohm)),
            Ok(row_wire) => Ok(ParsedLine::Row {
                row_index: self.row_index(number, row_wire)?,
                readings_ohm: &self.readings_ohm,
            }),
        }
    }

    /// Returns `true` for a line with the name of a resistance, or with at least as many text cells as there are
    /// resistances.
    fn has_names(&self) -> bool {
        let channels = self.scale.columns();
        let is_text = |field: &[u8]| !field.is_empty() && parsed_number(field).is_none();
        ResistanceColumns::has_name(&self.fields, channels)
            || (self.fields.count() >= channels.max(2) && self.fields.iter().all(is_text))
    }

    /// Counts a malformed line, which still advances the row counter.
    pub fn count_bad(&mut self) {
        self.turns += usize::from(self.layout.as_ref().is_some_and(|layout| !layout.columns.has_row()));
    }

    /// Index of the line's row-wire among those read: from its row number `row_wire`, or else from the line count.
    fn row_index(&mut self, line: u64, row_wire: Option<usize>) -> Result<Option<usize>, LineError> {
        if let Some(row_wire) = row_wire {
            let index = self.read.iter().position(|&other| other == row_wire);
            return index.map(Some).ok_or(LineError::OtherRow {
                line,
                row: row_wire + 1,
                rows: self.rows,
            });
        }
        match self.rows.model() {
            RowModel::Shared => Ok(None),
            RowModel::Each if self.read.len() == 1 => Ok(Some(0)),
            RowModel::Each if self.is_complete => {
                let turn = self.turns % self.read.len();
                self.turns += 1;
                Ok(Some(turn))
            }
            RowModel::Each => Err(LineError::NoRow(line)),
        }
    }
}

impl Layout {
    fn unnamed(found: usize, scale: ArrayScale, rows: usize) -> Self {
        let (one, all) = (scale.columns(), rows * scale.columns());
        let is_snapshot = found == all && rows > 1;
        let count = if is_snapshot { all } else { one };
        Self {
            columns: ResistanceColumns::unnamed(count, found == one + 1 && !is_snapshot),
            has_names: false,
            is_snapshot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parser(rows: Rows, is_complete: bool) -> LineParser {
        LineParser::new("2x1_1x3".parse().unwrap(), rows, is_complete).unwrap()
    }

    fn row(row_index: Option<usize>, readings_ohm: &[f64]) -> ParsedLine<'_> {
        ParsedLine::Row {
            row_index,
            readings_ohm,
        }
    }

    #[test]
    fn rows_are_identified_by_name_by_number_or_by_count() {
        let mut named = parser(Rows::Known, false);
        assert_eq!(named.parse(1, b"time,row,r_2,r_1,r_3").unwrap(), ParsedLine::NoReadings);
        assert_eq!(
            named.parse(2, b"0.1,2,5,4,6\r").unwrap(),
            row(Some(1), &[4.0, 5.0, 6.0])
        );
        let mut numbered = parser(Rows::Known, false);
        assert_eq!(numbered.parse(1, b" 2, 4,5,6").unwrap(), row(Some(1), &[4.0, 5.0, 6.0]));
        let mut in_turn = parser(Rows::Known, true);
        for (line, index) in [(1, 0), (2, 1), (3, 0)] {
            assert_eq!(
                in_turn.parse(line, b"4,5,6").unwrap(),
                row(Some(index), &[4.0, 5.0, 6.0])
            );
        }
        let mut shared = parser(Rows::All, false);
        assert_eq!(shared.parse(1, b"4,5,6").unwrap(), row(None, &[4.0, 5.0, 6.0]));
    }

    #[test]
    fn a_line_may_hold_a_whole_snapshot() {
        let mut parser = parser(Rows::Known, false);
        assert_eq!(
            parser.parse(1, b"1,2,3,4,5,6").unwrap(),
            ParsedLine::Snapshot(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        );
        assert_eq!(parser.is_snapshot(), Some(true));
        let message = parser.parse(2, b"1,2,3").unwrap_err().to_string();
        assert!(message.starts_with("line 2: 3 columns where 6"), "{message}");
    }

    /// Arduino prints ovf for a float that is too large.
    #[test]
    fn garbage_after_a_frame_is_a_bad_line_and_lines_may_end_with_a_comma() {
        for header in ["r_1,r_2,r_3", ""] {
            let mut parser = parser(Rows::All, true);
            assert_eq!(parser.parse(1, header.as_bytes()).unwrap(), ParsedLine::NoReadings);
            assert_eq!(parser.parse(2, b"4,5,6,").unwrap(), row(None, &[4.0, 5.0, 6.0]));
            for garbage in ["ovf,ovf,ovf", "OL,OL,OL", "-,-,-", "r_1,?,x"] {
                let error = parser.parse(3, garbage.as_bytes()).unwrap_err();
                assert!(!error.is_final(), "{garbage}: {error}");
            }
            assert_eq!(parser.parse(4, b"7,8,9").unwrap(), row(None, &[7.0, 8.0, 9.0]));
            assert_eq!(parser.parse(5, b"r_3,r_2,r_1").unwrap(), ParsedLine::NoReadings);
            assert_eq!(parser.parse(6, b"7,8,9,").unwrap(), row(None, &[9.0, 8.0, 7.0]));
        }
    }

    #[test]
    fn a_bad_line_is_reported_and_the_next_one_read() {
        let mut parser = parser(Rows::Known, true);
        assert_eq!(parser.parse(1, b"4,5,6").unwrap(), row(Some(0), &[4.0, 5.0, 6.0]));
        for (line, bad) in [
            (2, "#!?"),
            (3, "4,5"),
            (4, "4,nan,6"),
            (5, "4,5\r,6"),
            (6, "\u{ff},1,2"),
        ] {
            let message = parser.parse(line, bad.as_bytes()).unwrap_err().to_string();
            assert!(message.starts_with(&format!("line {line}")), "{message}");
        }
        // Five bad lines advanced the row counter by five.
        assert_eq!(parser.parse(7, b"4,5,6").unwrap(), row(Some(0), &[4.0, 5.0, 6.0]));
        assert_eq!(parser.parse(8, b"  ").unwrap(), ParsedLine::NoReadings);
    }

    #[test]
    fn a_header_that_lacks_a_resistance_is_refused() {
        for (names, words) in [
            ("time,r_1,r_2", "line 1: there is no column r_3"),
            ("R1,R2,R3", "line 1: there is no column r_1"),
            ("r_1,r_2,r_3,r_2", "line 1: there are two columns r_2"),
        ] {
            let error = parser(Rows::Known, true).parse(1, names.as_bytes()).unwrap_err();
            assert!(error.is_final() && error.to_string().starts_with(words), "{error}");
        }
    }

    #[test]
    fn garbage_before_the_first_frame_does_not_determine_the_layout() {
        let mut parser = parser(Rows::Known, false);
        assert!(parser.parse(1, b"5,6").is_err());
        assert!(parser.parse(2, b"boot ok").is_err());
        assert!(parser.parse(3, b"1,4,5,6").is_ok());
    }

    #[test]
    fn lines_of_unknown_rows_are_refused() {
        let message = parser(Rows::Known, false).parse(3, b"4,5,6").unwrap_err().to_string();
        assert!(message.starts_with("line 3: it has no row number"), "{message}");
        let message = parser(Rows::One(0), false)
            .parse(3, b"2,4,5,6")
            .unwrap_err()
            .to_string();
        assert_eq!(message, "line 3: it belongs to row 2, but the network reads only row 1");
        assert_eq!(
            parser(Rows::One(1), false).parse(3, b"4,5,6").unwrap(),
            row(Some(0), &[4.0, 5.0, 6.0])
        );
    }
}
