use std::{
    io::{self, Read},
    ops::ControlFlow,
};

use decoupler_core::{
    dataset::MemoryStream,
    evaluation::Channel,
    text::{CsvFields, number},
};
use thiserror::Error;

use super::{InputColumns, InputError, OtherColumns, TableError};

/// Parser of a stream of CSV lines with the inputs of a network. Columns are identified by a header or, without one, are
/// the inputs in their order, after the number of the row-wire if each row-wire has a network.
#[derive(Debug)]
pub struct InputLines {
    inputs: Vec<Channel>,
    others: OtherColumns,
    /// State of the memory, if there is one.
    memory: Option<MemoryStream>,
    /// Row-wires of the networks, from 0, if each has one.
    row_wires: Option<Vec<usize>>,
    fields: CsvFields,
    /// Columns of the lines, from the header or the first parsed line.
    columns: Option<InputColumns>,
    /// Cells of the line as numbers; NaN if they are not numbers.
    cells: Vec<f64>,
    readings: Vec<f64>,
}

/// Parsed line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputLine<'a> {
    /// Header, or an empty line.
    NoReadings,
    /// Inputs of the network.
    Readings {
        /// Index of the network of its row-wire; 0 if there is one network.
        row_index: usize,
        /// Readings in the order of the inputs; with a memory, their features.
        readings: &'a [f64],
    },
}

/// Reason why a line has no readings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum InputLineError {
    /// A header without the inputs of the network: no line after it can be read.
    #[error(transparent)]
    Header(InputError),
    /// Without a header, the first line has a different number of cells than there are inputs.
    #[error(transparent)]
    Unnamed(InputError),
    /// The number of cells differs from that of earlier lines.
    #[error("{found} cells where {expected} are needed")]
    Cells {
        /// Number of cells.
        found: usize,
        /// Number needed.
        expected: usize,
    },
    /// A cell that is not a finite number.
    #[error("cell {0} is not a finite number")]
    NotFinite(usize),
    /// A row-wire without a network.
    #[error("there is no network for row {0}")]
    NoNetwork(f64),
}

impl InputLineError {
    /// Returns `true` if no line after this one can be read either.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Header(_))
    }
}

impl InputLines {
    /// Returns a parser of `inputs`. `others` are the names of the other columns; `row_wires` are the row-wires of the
    /// networks, from 0, if each row-wire has one.
    pub fn new(inputs: Vec<Channel>, others: OtherColumns, row_wires: Option<Vec<usize>>) -> Self {
        Self {
            inputs,
            others,
            memory: None,
            row_wires,
            fields: CsvFields::default(),
            columns: None,
            cells: Vec::new(),
            readings: Vec::new(),
        }
    }

    /// Returns the parser with a memory, whose state continues from `memory`: it has one state for each network.
    ///
    /// A line comes at the time in its time column. In a stream without one, a line comes one usual interval of the training
    /// after the line before, so that a stream is decoded like a file with the same lines, however it arrives.
    #[must_use]
    pub fn with_memory(self, memory: Option<MemoryStream>) -> Self {
        Self { memory, ..self }
    }

    /// Parses the line of this number, from 1.
    ///
    /// # Errors
    /// If the line has no readings.
    pub fn parse(&mut self, line: u64, text: &[u8]) -> Result<InputLine<'_>, InputLineError> {
        let byte_order_mark: &[u8] = if line == 1 { b"\xef\xbb\xbf" } else { b"" };
        let text = text.strip_prefix(byte_order_mark).unwrap_or(text).trim_ascii();
        if text.is_empty() {
            return Ok(InputLine::NoReadings);
        }
        self.fields.split(text);
        self.cells.clear();
        self.cells
            .extend(self.fields.iter().map(|field| number(field).unwrap_or(f64::NAN)));
        // Only the first line, or a line with cells that are not numbers, may be a header: other lines need no strings.
        if self.columns.is_none() || self.cells.iter().any(|value| value.is_nan()) {
            let cells: Vec<String> = self
                .fields
                .iter()
                .map(|field| String::from_utf8_lossy(field).into_owned())
                .collect();
            if InputColumns::is_header(&cells, &self.inputs, line == 1) {
                let columns = InputColumns::of_header(&cells, &self.inputs, &self.others);
                self.columns = Some(columns.map_err(InputLineError::Header)?);
                return Ok(InputLine::NoReadings);
            }
        }
        let has_rows = self.row_wires.is_some();
        let columns = match &self.columns {
            Some(columns) => columns,
            None => {
                let columns = InputColumns::unnamed(self.cells.len(), &self.inputs, &self.others, has_rows);
                self.columns.insert(columns.map_err(InputLineError::Unnamed)?)
            }
        };
        if self.cells.len() != columns.width {
            let (found, expected) = (self.cells.len(), columns.width);
            return Err(InputLineError::Cells { found, expected });
        }
        let used = columns
            .inputs
            .iter()
            .chain(columns.row_wire.iter().filter(|_| has_rows));
        if let Some(column) = used.copied().find(|&column| !self.cells[column].is_finite()) {
            return Err(InputLineError::NotFinite(column + 1));
        }
        let row_index = match (&self.row_wires, columns.row_wire) {
            (None, _) => 0,
            (Some(read), Some(column)) => {
                let row = self.cells[column];
                let index = read.iter().position(|read| (*read + 1) as f64 == row);
                index.ok_or(InputLineError::NoNetwork(row))?
            }
            (Some(_), None) => {
                let name = self.others.row_wire.clone().unwrap_or_else(|| "row".to_owned());
                let near = "each row-wire has its own network, which is selected by this column".to_owned();
                return Err(InputLineError::Header(InputError::Missing { name, near }));
            }
        };
        self.readings.clear();
        self.readings
            .extend(columns.inputs.iter().map(|&column| self.cells[column]));
        let time_s = columns.time.map(|time| time.unit_s * self.cells[time.column]);
        let readings = match &mut self.memory {
            None => &self.readings,
            Some(memory) => memory.step(row_index, &self.readings, time_s.filter(|time_s| time_s.is_finite())),
        };
        Ok(InputLine::Readings { row_index, readings })
    }
}

/// Number of bytes between two progress reports.
const INTERVAL: u64 = 1 << 20;

/// Progress of reading one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of bytes read.
    pub bytes: u64,
    /// Size of the file in bytes; `None` for a pipe.
    pub of: Option<u64>,
}

/// Callback for every megabyte read; [`ControlFlow::Break`] cancels the import.
pub type Watch<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// Source that reports the number of bytes read.
pub(super) struct Watched<'a, 'w, R> {
    source: R,
    progress: Progress,
    next: u64,
    watch: &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + 'w),
}

impl<'a, 'w, R: Read> Watched<'a, 'w, R> {
    pub(super) fn new(
        source: R,
        of: Option<u64>,
        watch: &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + 'w),
    ) -> Self {
        Self {
            source,
            progress: Progress { bytes: 0, of },
            next: 0,
            watch,
        }
    }
}

impl<R: Read> Read for Watched<'_, '_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.progress.bytes >= self.next {
            self.next = self.progress.bytes + INTERVAL;
            if (self.watch)(self.progress).is_break() {
                return Err(io::Error::other(Cancelled));
            }
        }
        let read = self.source.read(buffer)?;
        self.progress.bytes += read as u64;
        Ok(read)
    }
}

/// Cancellation, passed as an I/O error through readers that support no other.
#[derive(Debug, thiserror::Error)]
#[error("cancelled")]
struct Cancelled;

/// Returns the error as reported by the import.
pub(super) fn table_error(error: io::Error) -> TableError {
    if error.get_ref().is_some_and(|inner| inner.is::<Cancelled>()) {
        TableError::Cancelled
    } else {
        TableError::Io(error)
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::dataset::Memory;

    use super::*;

    fn channels(names: &[&str]) -> Vec<Channel> {
        let channel = |name: &&str| Channel {
            name: (*name).to_owned(),
            unit: None,
        };
        names.iter().map(channel).collect()
    }

    fn readings(lines: &mut InputLines, line: u64, text: &str) -> Option<(usize, Vec<f64>)> {
        match lines.parse(line, text.as_bytes()).unwrap() {
            InputLine::NoReadings => None,
            InputLine::Readings { row_index, readings } => Some((row_index, readings.to_vec())),
        }
    }

    #[test]
    fn inputs_are_found_by_name_or_by_order() {
        let mut lines = InputLines::new(channels(&["u1", "u2"]), OtherColumns::default(), None);
        assert_eq!(readings(&mut lines, 1, "time,u2,u1"), None);
        assert_eq!(readings(&mut lines, 2, "0.1,2,1"), Some((0, vec![1.0, 2.0])));
        assert_eq!(readings(&mut lines, 3, ""), None);
        let error = lines.parse(4, b"0.2,?,1").unwrap_err();
        assert_eq!(error, InputLineError::NotFinite(2));
        assert!(!error.is_final());
        let mut unnamed = InputLines::new(channels(&["u1", "u2"]), OtherColumns::default(), None);
        assert_eq!(readings(&mut unnamed, 1, "1,2"), Some((0, vec![1.0, 2.0])));
        let other = unnamed.parse(2, b"1,2,3").unwrap_err();
        assert_eq!(other, InputLineError::Cells { found: 3, expected: 2 });
        let missing = unnamed.parse(3, b"time,u1,v2").unwrap_err();
        assert!(missing.is_final() && missing.to_string().contains("u2"), "{missing}");
    }

    #[test]
    fn the_row_wire_selects_the_network() {
        let others = OtherColumns {
            row_wire: Some("row".to_owned()),
            ..OtherColumns::default()
        };
        let mut lines = InputLines::new(channels(&["u"]), others, Some(vec![0, 2]));
        assert_eq!(readings(&mut lines, 1, "row,u"), None);
        assert_eq!(readings(&mut lines, 2, "3,5"), Some((1, vec![5.0])));
        assert_eq!(lines.parse(3, b"2,5").unwrap_err(), InputLineError::NoNetwork(2.0));
    }

    #[test]
    fn a_memory_continues_from_line_to_line_and_uses_the_time_column() {
        let memory = Memory {
            interval_s: Some(0.1),
            ..Memory::of_averages_s(&[2.0])
        };
        let others = OtherColumns {
            time: Some("t".to_owned()),
            ..OtherColumns::default()
        };
        let new = |stream| InputLines::new(channels(&["u"]), others.clone(), None).with_memory(Some(stream));
        let start = MemoryStream::new(&memory, 1, 1).unwrap();
        let mut lines = new(start.clone());
        let average = |elapsed_s: f64| 1.0 - f64::exp(-elapsed_s / 2.0);
        let mut check = |line: u64, text: &str, expected: f64| {
            let (_, found) = readings(&mut lines, line, text).unwrap();
            assert!((found[1] - expected).abs() < 1e-14, "{text}: {found:?}");
        };
        check(1, "0", 0.0);
        check(2, "1", average(0.1));
        check(3, "1", average(0.2));
        let mut timed = new(start.clone());
        assert_eq!(readings(&mut timed, 1, "u,t (ms)"), None);
        readings(&mut timed, 2, "0,50");
        let (_, found) = readings(&mut timed, 3, "1,450").unwrap();
        assert!((found[1] - average(0.4)).abs() < 1e-14);
        assert!(timed.parse(4, b"?,500").is_err());
        let (_, found) = readings(&mut timed, 5, "1,550").unwrap();
        assert!((found[1] - average(0.5)).abs() < 1e-14, "a bad line is no sample");
        let (_, found) = readings(&mut timed, 6, "3,90000").unwrap();
        assert_eq!(found, [3.0, 3.0], "it starts again after a gap");
    }
}
