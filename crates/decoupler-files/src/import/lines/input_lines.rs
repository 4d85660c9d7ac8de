use std::hash::{DefaultHasher, Hash, Hasher};

use decoupler_core::{
    dataset::{MemoryStream, Place, Series},
    problem::Channel,
};
use thiserror::Error;

use super::{
    super::{
        Derived, InputColumns, InputError, OtherColumns,
        derived_stream::{self, DerivedStream},
        selection,
        time_stamp::TimeStamp,
    },
    resistance_reader::{CsvFields, number},
};

/// Parser of a stream of CSV lines with the inputs of a network. Columns are identified by a header or, without one, are
/// the inputs in their order, after the number of the row-wire if each row-wire has a network.
#[derive(Debug)]
pub struct InputLines {
    inputs: Vec<Channel>,
    others: OtherColumns,
    /// Columns computed from others.
    derive: Vec<Derived>,
    /// Channels by which a header is recognised: the inputs, and the columns from which derived inputs are computed.
    read: Vec<Channel>,
    /// The derived columns, once the columns of the lines are known.
    derived: Option<DerivedStream>,
    /// Group of each line of the start, which is waited for.
    groups_of_start: Vec<u64>,
    /// State of the memory, if there is one.
    memory: Option<MemoryStream>,
    /// Row-wires of the networks, from 0, if each has one.
    row_wires: Option<Vec<usize>>,
    fields: CsvFields,
    /// Columns of the lines, from the header or the first parsed line.
    columns: Option<InputColumns>,
    /// `true` once a line had inputs.
    has_readings: bool,
    /// First time stamp, if times are stamps.
    start: Option<TimeStamp>,
    /// Cells of the line as numbers; NaN if they are not numbers.
    cells: Vec<f64>,
    readings: Vec<f64>,
    kept: Vec<KeptCell>,
}

/// Cell of a line that is copied to the output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptCell {
    /// Name of its column, with the unit in brackets if there is one.
    pub title: String,
    /// Its text.
    pub text: String,
}

/// Parsed line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputLine<'a> {
    /// Header, or an empty line.
    NoReadings,
    /// Line at the start of the stream, from which the mean of a derived column is computed: there are no inputs before that.
    Start {
        /// `true` for the first of them.
        is_first: bool,
    },
    /// Inputs of the network.
    Readings {
        /// Index of the network of its row-wire; 0 if there is one network.
        row_index: usize,
        /// Readings in the order of the inputs; with a memory, their features.
        readings: &'a [f64],
        /// Where the line comes in its group and row-wire, for a memory.
        place: Option<Place>,
        /// Time, group and row-wire of the line, as far as it has them.
        kept: &'a [KeptCell],
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
    /// A time that is missing or not understood, which a memory needs.
    #[error("cell {0} is not a time, which the history of readings needs")]
    NoTime(usize),
    /// A cell that is not the number of a row-wire, which a memory needs.
    #[error("cell {0} is not the number of a row-wire, from 1")]
    RowWire(usize),
    /// A derived column without a value, such as a quotient by zero.
    #[error("the derived column '{0}' has no value")]
    NoValue(String),
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
            read: inputs.clone(),
            inputs,
            others,
            derive: Vec::new(),
            derived: None,
            groups_of_start: Vec::new(),
            memory: None,
            row_wires,
            fields: CsvFields::default(),
            columns: None,
            has_readings: false,
            start: None,
            cells: Vec::new(),
            readings: Vec::new(),
            kept: Vec::new(),
        }
    }

    /// Returns the parser with columns computed from others as in a file with the same lines. The first lines, from which means
    /// at the start are computed, have no inputs.
    #[must_use]
    pub fn with_derived(self, derive: Vec<Derived>) -> Self {
        let is_derived = |name: &String| derive.iter().any(|derived| derived.name == *name);
        let inputs = self.inputs.iter().map(|input| &input.name);
        let names = inputs.chain(derive.iter().flat_map(Derived::columns));
        let mut read: Vec<Channel> = Vec::new();
        for name in names.filter(|name| !is_derived(name)) {
            if read.iter().all(|channel| channel.name != *name) {
                read.push(Channel::new(name, None));
            }
        }
        Self { read, derive, ..self }
    }

    /// Returns the parser with a memory, whose state continues from `memory` as it does in training: by the group, row-wire
    /// and time of each line.
    ///
    /// In a stream without a time column, a line comes one usual interval of the training after the line before, so that a
    /// stream is decoded like a file with the same lines, however it arrives.
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
        self.read_stamp();
        // Only the first line, or a line with cells that are not numbers, may be a header: other lines need no strings.
        if self.columns.is_none() || self.cells.iter().any(|value| value.is_nan()) {
            let cells: Vec<String> = self
                .fields
                .iter()
                .map(|field| String::from_utf8_lossy(field).into_owned())
                .collect();
            // After a line with inputs, a device that starts again repeats its header whole; other texts are garbage, or an
            // overflow of the device.
            let is_header = if self.has_readings {
                InputColumns::has_all(&cells, &self.read)
            } else {
                InputColumns::is_header(&cells, &self.read, line == 1)
            };
            if is_header {
                self.find_columns(&cells).map_err(InputLineError::Header)?;
                return Ok(InputLine::NoReadings);
            }
        }
        if self.columns.is_none() {
            if self.fields.ends_with_comma() {
                self.cells.pop();
            }
            self.find_columns(&[]).map_err(InputLineError::Unnamed)?;
            self.read_stamp();
        }
        let Some(columns) = &self.columns else {
            return Ok(InputLine::NoReadings);
        };
        let width = columns.width;
        if !self.fields.has_width(width) {
            let (found, expected) = (self.cells.len(), width);
            return Err(InputLineError::Cells { found, expected });
        }
        self.cells.truncate(width);
        let has_rows = self.row_wires.is_some();
        let rows = columns.row_wire.into_iter().filter(|_| has_rows);
        let read = columns.inputs.iter().copied().filter(|&column| column < width);
        let needed = self.derived.iter().flat_map(|derived| derived.needed(width));
        if let Some(column) = read
            .chain(rows)
            .chain(needed)
            .find(|&column| !self.cells[column].is_finite())
        {
            return Err(InputLineError::NotFinite(column + 1));
        }
        if self.memory.is_some() {
            columns.check_place(&self.cells)?;
        }
        let row_index = self.row_index(columns, &self.cells)?;
        let group = columns.group.filter(|&column| column < width);
        let group = group.map_or(0, |column| key(self.fields.get(column)));
        if let Some(derived) = &mut self.derived {
            let taken = derived.take(&mut self.cells);
            match taken.map_err(|error| InputLineError::Header(InputError::Derived(error.to_string())))? {
                derived_stream::Progress::Start { is_first } => {
                    self.groups_of_start.push(group);
                    return Ok(InputLine::Start { is_first });
                }
                derived_stream::Progress::Complete(start) => self.remember(&start),
            }
        }
        let (Some(columns), derived) = (&self.columns, &self.derived) else {
            return Ok(InputLine::NoReadings);
        };
        if let Some(column) = columns.inputs.iter().find(|&&column| !self.cells[column].is_finite()) {
            let name = derived.as_ref().map_or("", |derived| derived.name(column - width));
            return Err(InputLineError::NoValue(name.to_owned()));
        }
        columns.gather(&self.cells, &mut self.readings);
        self.has_readings = true;
        for (&(column, _), kept) in columns.kept.iter().zip(&mut self.kept) {
            kept.text.clear();
            if column < width {
                kept.text.push_str(&String::from_utf8_lossy(self.fields.get(column)));
            } else if !self.cells[column].is_nan() {
                kept.text.push_str(&self.cells[column].to_string());
            }
        }
        let (readings, place) = match &mut self.memory {
            None => (&*self.readings, None),
            Some(memory) => {
                let series = columns.series(group, &self.cells);
                let (features, place) = memory.step(series, &self.readings, columns.time_s(&self.cells));
                (features, Some(place))
            }
        };
        Ok(InputLine::Readings {
            row_index,
            readings,
            place,
            kept: &self.kept,
        })
    }

    /// Replaces a time stamp by the time since the first.
    fn read_stamp(&mut self) {
        let time = self.columns.as_ref().and_then(|columns| columns.time);
        let Some(time) = time.filter(|time| time.column < self.cells.len().min(self.fields.count())) else {
            return;
        };
        if let Some(stamp) = TimeStamp::parse(self.fields.get(time.column)) {
            let start = *self.start.get_or_insert(stamp);
            if start.has_zone == stamp.has_zone {
                // Stamps are in seconds, whatever unit the header has.
                self.cells[time.column] = stamp.seconds_since(start) / time.unit_s;
            }
        }
    }

    /// Takes the lines of the start into the memory; those without all inputs are no samples.
    fn remember(&mut self, start: &[Vec<f64>]) {
        let (Some(columns), Some(mut memory)) = (&self.columns, self.memory.take()) else {
            return;
        };
        for (cells, group) in start.iter().zip(self.groups_of_start.drain(..)) {
            columns.gather(cells, &mut self.readings);
            if self.readings.iter().all(|reading| reading.is_finite()) {
                memory.step(columns.series(group, cells), &self.readings, columns.time_s(cells));
            }
        }
        self.memory = Some(memory);
    }

    /// Index of the network of a line.
    fn row_index(&self, columns: &InputColumns, cells: &[f64]) -> Result<usize, InputLineError> {
        match (&self.row_wires, columns.row_wire) {
            (None, _) => Ok(0),
            (Some(read), Some(column)) => {
                let row = cells[column];
                let index = read.iter().position(|read| (*read + 1) as f64 == row);
                index.ok_or(InputLineError::NoNetwork(row))
            }
            (Some(_), None) => {
                let name = self.others.row_wire.clone().unwrap_or_else(|| "row".to_owned());
                let near = "each row-wire has its own network, which is selected by this column".to_owned();
                Err(InputLineError::Header(InputError::Missing { name, near }))
            }
        }
    }

    /// Finds the inputs in the cells of a header; it is empty for lines without one.
    fn find_columns(&mut self, header: &[String]) -> Result<(), InputError> {
        let has_rows = self.row_wires.is_some();
        let width = self.cells.len();
        let (columns, derived) = if self.derive.is_empty() {
            let columns = match header {
                [] => InputColumns::unnamed(width, &self.inputs, &self.others, has_rows)?,
                header => InputColumns::of_header(header, &self.inputs, &self.others)?,
            };
            (columns, None)
        } else {
            // Derived columns have names.
            let found = InputColumns::with_derived(header, width, &self.inputs, &self.others, &self.derive)?;
            (found.0, Some(found.1))
        };
        // The header of a device that starts again does not begin another start.
        if self.columns.as_ref() != Some(&columns) {
            let titles = columns.kept.iter().map(|(_, title)| title.clone());
            let cells = titles.map(|title| KeptCell {
                title,
                ..KeptCell::default()
            });
            self.kept = cells.collect();
            (self.columns, self.derived) = (Some(columns), derived);
        }
        Ok(())
    }
}

/// Number of a group, from its text.
fn key(group: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    group.hash(&mut hasher);
    hasher.finish()
}

impl InputColumns {
    /// Checks that a memory can place the line: it has a time and a row-wire, if there are such columns.
    fn check_place(&self, cells: &[f64]) -> Result<(), InputLineError> {
        if let Some(time) = self.time
            && !cells[time.column].is_finite()
        {
            return Err(InputLineError::NoTime(time.column + 1));
        }
        match self.row_wire {
            Some(column) if selection::row_wire("", cells[column]).is_err() => Err(InputLineError::RowWire(column + 1)),
            _ => Ok(()),
        }
    }

    fn series(&self, group: u64, cells: &[f64]) -> Series {
        let row_wire = self
            .row_wire
            .and_then(|column| selection::row_wire("", cells[column]).ok());
        Series {
            group,
            row_wire: row_wire.unwrap_or(0),
        }
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::dataset::{Memory, Span};

    use super::*;

    fn channels(names: &[&str]) -> Vec<Channel> {
        let channel = |name: &&str| Channel::new(*name, None);
        names.iter().map(channel).collect()
    }

    fn readings(lines: &mut InputLines, line: u64, text: &str) -> Option<(usize, Vec<f64>)> {
        match lines.parse(line, text.as_bytes()).unwrap() {
            InputLine::NoReadings | InputLine::Start { .. } => None,
            InputLine::Readings {
                row_index, readings, ..
            } => Some((row_index, readings.to_vec())),
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
        let mut renamed = InputLines::new(channels(&["u1", "u2"]), OtherColumns::default(), None);
        let missing = renamed.parse(1, b"time,u1,v2").unwrap_err();
        assert!(missing.is_final() && missing.to_string().contains("u2"), "{missing}");
    }

    /// Arduino prints ovf for a float that is too large, multimeters print OL.
    #[test]
    fn garbage_after_the_first_line_is_a_bad_line_and_a_whole_header_still_counts() {
        for (header, garbage) in [
            ("u1,u2", "ovf,ovf"),
            ("u1,u2", "OL,OL"),
            ("u1,u2", "-,-"),
            ("u1,u2", "ERR"),
            ("u1,u2", "u1,\u{fffd}x"),
            ("", "ovf,ovf"),
        ] {
            let mut lines = InputLines::new(channels(&["u1", "u2"]), OtherColumns::default(), None);
            assert_eq!(readings(&mut lines, 1, header), None);
            assert_eq!(readings(&mut lines, 2, "93,91"), Some((0, vec![93.0, 91.0])));
            let error = lines.parse(3, garbage.as_bytes()).unwrap_err();
            assert!(!error.is_final(), "{garbage}: {error}");
            assert_eq!(readings(&mut lines, 4, "93,90"), Some((0, vec![93.0, 90.0])));
            assert_eq!(readings(&mut lines, 5, "time,u2,u1"), None);
            assert_eq!(readings(&mut lines, 6, "0.1,2,1"), Some((0, vec![1.0, 2.0])));
        }
    }

    #[test]
    fn a_line_may_end_with_a_comma() {
        for header in ["u1,u2", "u1,u2,", ""] {
            let mut lines = InputLines::new(channels(&["u1", "u2"]), OtherColumns::default(), None);
            assert_eq!(readings(&mut lines, 1, header), None);
            assert_eq!(readings(&mut lines, 2, "1,2,"), Some((0, vec![1.0, 2.0])), "{header}");
            assert_eq!(readings(&mut lines, 3, "3,4,"), Some((0, vec![3.0, 4.0])), "{header}");
            assert!(lines.parse(4, b"1,2,3,4").is_err());
        }
    }

    #[test]
    fn a_line_that_a_memory_cannot_place_is_bad() {
        let others = OtherColumns {
            time: Some("t".to_owned()),
            row_wire: Some("row".to_owned()),
            ..OtherColumns::default()
        };
        let stream = MemoryStream::new(
            &Memory {
                lags: vec![Span::Samples(1.0)],
                ..Memory::default()
            },
            1,
        )
        .unwrap();
        let mut lines = InputLines::new(channels(&["u"]), others, None).with_memory(Some(stream));
        assert_eq!(readings(&mut lines, 1, "t,row,u"), None);
        assert_eq!(
            readings(&mut lines, 2, "2026-11-24T12:00:00Z,1,5"),
            Some((0, vec![5.0, 5.0]))
        );
        for (text, expected) in [
            ("2026-11-24T12:61:00Z,1,5", InputLineError::NoTime(1)),
            ("nan,1,5", InputLineError::NoTime(1)),
            ("2026-11-24T12:00:00.1Z,0.5,5", InputLineError::RowWire(2)),
        ] {
            assert_eq!(lines.parse(3, text.as_bytes()).unwrap_err(), expected, "{text}");
        }
        assert_eq!(
            readings(&mut lines, 4, "2026-11-24T12:00:00.2Z,2,6"),
            Some((0, vec![6.0, 6.0]))
        );
        assert_eq!(
            readings(&mut lines, 5, "2026-11-24T12:00:00.3Z,1,7"),
            Some((0, vec![7.0, 5.0]))
        );
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
    fn columns_are_copied_as_they_came_and_derived_ones_as_numbers() {
        let others = OtherColumns {
            kept: ["press", "gap"].map(str::to_owned).into(),
            ..OtherColumns::default()
        };
        let derive = vec!["gap=u1-u2".parse().unwrap()];
        let mut lines = InputLines::new(channels(&["u1", "u2"]), others, None).with_derived(derive);
        assert_eq!(readings(&mut lines, 1, "press,u1,u2"), None);
        let Ok(InputLine::Readings { kept, .. }) = lines.parse(2, b"\"007\",2.50,1") else {
            panic!("no readings")
        };
        let texts = kept.iter().map(|cell| (cell.title.as_str(), cell.text.as_str()));
        assert_eq!(Vec::from_iter(texts), [("press", "007"), ("gap", "1.5")]);
    }

    #[test]
    fn a_memory_continues_from_line_to_line_and_uses_the_time_column() {
        let memory = Memory {
            interval_s: Some(0.1),
            averages: vec![Span::Seconds(2.0)],
            ..Memory::default()
        };
        let others = OtherColumns {
            time: Some("t".to_owned()),
            ..OtherColumns::default()
        };
        let new = |stream| InputLines::new(channels(&["u"]), others.clone(), None).with_memory(Some(stream));
        let start = MemoryStream::new(&memory, 1).unwrap();
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
