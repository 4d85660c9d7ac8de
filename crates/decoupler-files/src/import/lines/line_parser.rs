use std::{
    collections::BTreeSet,
    hash::{BuildHasher as _, BuildHasherDefault, DefaultHasher},
};

use decoupler_core::{
    dataset::{DatasetError, MemoryStream, Place, Series},
    problem::{Channel, Problem},
    scene::{RowModel, Rows, SceneError},
    sensor::ArrayScale,
    text::counted,
};

use super::{
    super::{
        Decimal, Derived, Recipe,
        derived::DerivedStream,
        fields::Fields,
        format,
        inputs::InputColumns,
        selection::{LAST_ROW_WIRE, row_wire},
        table::excerpt,
        time_stamp::TimeStamp,
    },
    LineError,
};

/// Parser of successive lines of CSV with the readings of a network, without allocation in steady state.
///
/// A header names the columns, in any order and among others; without one, the first line of readings determines the layout:
/// the inputs in their order, possibly after the number of the row-wire or, for an array, a whole snapshot row by row. A header
/// may be repeated, for example when a device restarts, and a comma may end a line.
#[derive(Debug, Default)]
pub struct LineParser {
    pub(super) problem: Problem,
    recipe: Recipe,
    /// Channels by which a header is recognised: the inputs, and the columns from which derived inputs are computed.
    read: Vec<Channel>,
    /// Row-wires with their own readings; `None` if one network of a recording reads all.
    rows: Option<RowWires>,
    /// `true` for the resistances of an array.
    is_array: bool,
    fields: Fields,
    /// Columns of the lines, from the header or the first line of readings; of width 0 until then.
    columns: InputColumns,
    has_names: bool,
    is_snapshot: bool,
    /// `true` once a line had readings.
    pub(super) has_readings: bool,
    /// Number of lines so far whose row-wire follows from their order, valid or not; `None` if it does not follow.
    pub(super) lines_in_turn: Option<usize>,
    /// The derived columns, once the columns of the lines are known.
    derived: DerivedStream,
    /// Group of each line of the start, which is waited for.
    groups_of_start: Vec<u64>,
    memory: Option<MemoryStream>,
    /// First time stamp, if times are stamps.
    start: Option<TimeStamp>,
    /// Cells of the line as numbers; NaN if they are not numbers.
    cells: Vec<f64>,
    readings: Vec<f64>,
    kept: Vec<KeptCell>,
}

const NO_ROW: &str = "it has no row number, and it is not known with which row a device begins; send the row number before \
                      the resistances, or whole snapshots in one line";

/// Row-wires that are read.
#[derive(Debug)]
struct RowWires {
    /// From 0, in the order of their networks.
    read: Vec<usize>,
    /// Largest number of a row-wire.
    last: usize,
    /// `false` if the network of a line does not depend on its row-wire.
    are_needed: bool,
}

/// Cell of a line that is copied to the output.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptCell {
    /// Name of its column, with the unit in brackets if there is one.
    pub title: String,
    /// Its text.
    pub text: String,
}

/// Contents of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParsedLine<'a> {
    /// An empty line or a header.
    NoReadings,
    /// Line at the start of the stream, from which the mean of a derived column is computed: there are no inputs before that.
    Start {
        /// `true` for the first of them.
        is_first: bool,
    },
    /// Readings of one row-wire, or of a recording.
    Row {
        /// Index of the row-wire among those read, 0 if one network of a recording reads all; `None` if unknown.
        row_index: Option<usize>,
        /// Readings in the order of the inputs; with a memory, their features.
        readings: &'a [f64],
        /// Time in seconds, if there is a time column.
        time_s: Option<f64>,
        /// Where the line comes in its group and row-wire, for a memory.
        place: Option<Place>,
        /// Time, group and row-wire of the line, as far as it has them.
        kept: &'a [KeptCell],
    },
    /// Resistances of all row-wires read, in ohm: rows × M4.
    Snapshot(&'a [f64]),
}

/// What was found in a line, without its readings.
enum Found {
    NoReadings,
    Start { is_first: bool },
    Readings(Option<usize>, Option<Place>),
}

impl LineParser {
    /// Returns a parser of the resistances of `rows` of an array, in columns `r_1` to `r_M4`, with the row-wire from 1 in `row`
    /// and the time in `time_s` if there are such columns. `is_complete` means that the input is read from its beginning and no
    /// line is lost, so that the row of a line without a row number follows from counting lines.
    ///
    /// # Errors
    /// If the array does not have the row.
    pub fn of_array(scale: ArrayScale, rows: Rows, is_complete: bool) -> Result<Self, SceneError> {
        let read = rows.read(scale.rows())?;
        let are_needed = rows.model() == RowModel::Each;
        // A single row-wire is always in turn.
        let is_in_turn = are_needed && (is_complete || read.len() == 1);
        let channels = 1..=scale.columns();
        let inputs = Vec::from_iter(channels.map(|channel| Channel::new(format!("r_{channel}"), None)));
        Ok(Self {
            read: inputs.clone(),
            problem: Problem {
                inputs,
                ..Problem::default()
            },
            recipe: Recipe {
                row_wire: Some("row".to_owned()),
                time: Some("time_s".to_owned()),
                ..Recipe::default()
            },
            rows: Some(RowWires {
                read,
                last: scale.rows(),
                are_needed,
            }),
            lines_in_turn: is_in_turn.then_some(0),
            is_array: true,
            ..Self::default()
        })
    }

    /// Returns a parser of the inputs of a network of `problem`, with the other columns of `recipe`; `row_wires` are those of the
    /// networks, from 0, if each row-wire has one.
    ///
    /// Derived columns are computed as in a file with the same lines; the first lines, from which means at the start are
    /// computed, have no readings. A memory continues as in training, by the group, row-wire and time of each line. Without a
    /// time column, a line comes one usual interval of the training after the line before, so that a stream is decoded like a
    /// file with the same lines, however it arrives.
    ///
    /// # Errors
    /// If the memory of `problem` is invalid.
    pub fn of_recording(
        problem: &Problem,
        recipe: &Recipe,
        row_wires: Option<Vec<usize>>,
    ) -> Result<Self, DatasetError> {
        let inputs = &problem.inputs;
        let is_derived = |name: &String| recipe.derive.iter().any(|derived| derived.name == *name);
        let names = inputs.iter().map(|input| &input.name);
        let names = names.chain(recipe.derive.iter().flat_map(Derived::columns));
        let read = BTreeSet::from_iter(names.filter(|name| !is_derived(name)));
        let read = read.into_iter().map(|name| Channel::new(name, None)).collect();
        let memory = problem.memory.as_ref();
        let rows = row_wires.map(|read| RowWires {
            read,
            last: LAST_ROW_WIRE,
            are_needed: true,
        });
        Ok(Self {
            read,
            memory: memory
                .map(|memory| MemoryStream::new(memory, inputs.len()))
                .transpose()?,
            problem: problem.clone(),
            recipe: recipe.clone(),
            rows,
            ..Self::default()
        })
    }

    /// Counts a malformed line, which still advances the row counter.
    pub fn count_bad(&mut self) {
        let has_no_row = self.columns.width > 0 && self.columns.row_wire.is_none();
        self.lines_in_turn = self.lines_in_turn.map(|lines| lines + usize::from(has_no_row));
    }

    /// Parses a line without its line break; `line` is its number, from 1.
    ///
    /// # Errors
    /// If the line has no readings; the next line can be read unless the error [is final](LineError::is_final).
    pub fn parse(&mut self, line: u64, text: &[u8]) -> Result<ParsedLine<'_>, LineError> {
        let found = self.find(line, text);
        if found.is_err() {
            self.count_bad();
            // Garbage before the first readings does not determine the layout.
            if !self.has_names && !self.has_readings {
                (self.columns, self.derived) = (InputColumns::default(), DerivedStream::default());
            }
        }
        Ok(match found? {
            Found::NoReadings => ParsedLine::NoReadings,
            Found::Start { is_first } => ParsedLine::Start { is_first },
            Found::Readings(..) if self.is_snapshot => ParsedLine::Snapshot(&self.readings),
            Found::Readings(row_index, place) => ParsedLine::Row {
                row_index,
                readings: &self.readings,
                time_s: self.columns.time_s(&self.cells),
                place,
                kept: &self.kept,
            },
        })
    }

    fn find(&mut self, line: u64, text: &[u8]) -> Result<Found, LineError> {
        let byte_order_mark: &[u8] = if line == 1 { b"\xef\xbb\xbf" } else { b"" };
        let text = text.strip_prefix(byte_order_mark).unwrap_or(text).trim_ascii();
        if text.is_empty() {
            return Ok(Found::NoReadings);
        }
        if text.contains(&b'\r') {
            let reason = "there is a line break within the line; end lines, and only lines, with LF or CR LF";
            return Err(LineError::Malformed(line, reason.to_owned()));
        }
        self.fields.split(text);
        let number = |cell| format::parse(cell, Decimal::Point).number().unwrap_or(f64::NAN);
        self.cells.clear();
        self.cells.extend(self.fields.iter().map(number));
        self.read_stamp();
        // Only the first line, or a line that cannot be used, may be a header: other lines need no strings.
        if self.check(line).is_err() {
            let cells = self.fields.iter().map(String::from_utf8_lossy);
            let cells = Vec::from_iter(cells.map(|cell| cell.into_owned()));
            // After a line with readings, a device that starts again repeats its header whole; other texts are garbage, or an
            // overflow of the device.
            let is_header = if self.has_readings {
                InputColumns::has_all(&cells, &self.read)
            } else {
                InputColumns::is_header(&cells, &self.read, line == 1)
            };
            if is_header {
                let found = self.find_columns(&cells, cells.len());
                found.map_err(|reason| LineError::Final(line, reason))?;
                return Ok(Found::NoReadings);
            }
            if self.columns.width == 0 {
                // A comma may end the line.
                let has_comma = cells.len() > 1 && cells.last().is_some_and(String::is_empty);
                let found = self.find_columns(&[], cells.len() - usize::from(has_comma));
                found.map_err(|reason| LineError::Malformed(line, reason))?;
                self.read_stamp();
            }
            self.check(line)?;
        }
        let row_index = self.row_index(line)?;
        self.has_readings = true;
        self.readings_of(line, row_index)
    }

    /// Checks that the cells can be used.
    fn check(&self, line: u64) -> Result<(), LineError> {
        let (columns, width, found) = (&self.columns, self.columns.width, self.fields.len());
        let has_trailing_comma = found == width + 1 && found > 1 && self.fields.get(width).is_empty();
        if found != width && !has_trailing_comma {
            let found = counted(found, "cell");
            let reason = format!("{found} where {width} are needed, separated by commas");
            return Err(LineError::Malformed(line, reason));
        }
        let refused = |column: usize, needed: &str| {
            let cell = excerpt(&String::from_utf8_lossy(self.fields.get(column)));
            Err(LineError::Cell(line, column + 1, format!("'{cell}' is not {needed}")))
        };
        let is_bad = |column: &usize| !self.cells[*column].is_finite();
        let mut read = columns.inputs.iter().copied().filter(|column| *column < width);
        let (needed, limit) = match self.is_array {
            true => ("a resistance; give a finite number of ohm above 0", 0.0),
            false => ("a finite number", f64::NEG_INFINITY),
        };
        if let Some(column) = read.find(|column| is_bad(column) || self.cells[*column] <= limit) {
            return refused(column, needed);
        }
        // A memory places the line in its series.
        let last = self.rows.as_ref().map_or(LAST_ROW_WIRE, |rows| rows.last);
        let needs_row_wire = self.memory.is_some() || self.rows.is_some();
        let is_row_wire = |column: &usize| {
            let number = self.cells.get(*column).copied();
            number.and_then(row_wire).is_some_and(|row| row < last)
        };
        if let Some(column) = columns.row_wire.filter(|column| needs_row_wire && !is_row_wire(column)) {
            return refused(column, &format!("a row-wire; give a number from 1 to {last}"));
        }
        if let Some(column) = self.derived.needed(width).find(is_bad) {
            return refused(column, "a finite number");
        }
        match columns.time {
            Some((column, _)) if self.memory.is_some() && column < width && is_bad(&column) => {
                refused(column, "a time, which the history of readings needs")
            }
            _ => Ok(()),
        }
    }

    /// Gathers the readings of a line whose cells can be used.
    fn readings_of(&mut self, line: u64, row_index: Option<usize>) -> Result<Found, LineError> {
        let (columns, width) = (&self.columns, self.columns.width);
        self.cells.truncate(width);
        let group = columns.group.filter(|&column| column < width);
        let hasher = BuildHasherDefault::<DefaultHasher>::default();
        let group = group.map_or(0, |column| hasher.hash_one(self.fields.get(column)));
        let taken = self.derived.take(&mut self.cells);
        let Some(start) = taken.map_err(|error| LineError::Final(line, error.to_string()))? else {
            self.groups_of_start.push(group);
            let is_first = self.groups_of_start.len() == 1;
            return Ok(Found::Start { is_first });
        };
        for (cells, group) in start.iter().zip(self.groups_of_start.drain(..)) {
            columns.gather(cells, &mut self.readings);
            // Lines without all inputs are no samples.
            if let Some(memory) = &mut self.memory
                && self.readings.iter().all(|reading| reading.is_finite())
            {
                memory.step(columns.series(group, cells), &self.readings, columns.time_s(cells));
            }
        }
        if let Some(column) = columns.inputs.iter().find(|&&column| !self.cells[column].is_finite()) {
            let name = self.derived.name(column - width);
            let reason = format!("the derived column '{name}' has no value");
            return Err(LineError::Malformed(line, reason));
        }
        columns.gather(&self.cells, &mut self.readings);
        for (&(column, _), kept) in columns.kept.iter().zip(&mut self.kept) {
            kept.text.clear();
            if column < width {
                kept.text.push_str(&String::from_utf8_lossy(self.fields.get(column)));
            } else if !self.cells[column].is_nan() {
                kept.text.push_str(&self.cells[column].to_string());
            }
        }
        let place = self.memory.as_mut().map(|memory| {
            let series = columns.series(group, &self.cells);
            let (features, place) = memory.step(series, &self.readings, columns.time_s(&self.cells));
            self.readings.clear();
            self.readings.extend_from_slice(features);
            place
        });
        Ok(Found::Readings(row_index, place))
    }

    /// Replaces a time stamp by the time since the first.
    fn read_stamp(&mut self) {
        if let Some((column, unit_s)) = self.columns.time
            && let Some(stamp) = TimeStamp::parse(self.fields.get(column))
        {
            let start = *self.start.get_or_insert(stamp);
            if start.has_zone == stamp.has_zone {
                // Stamps are in seconds, whatever unit the header has.
                self.cells[column] = stamp.seconds_since(start) / unit_s;
            }
        }
    }

    /// Index of the row-wire of a line whose cells can be used.
    fn row_index(&mut self, line: u64) -> Result<Option<usize>, LineError> {
        let Some(rows) = self.rows.as_ref().filter(|_| !self.is_snapshot) else {
            return Ok(Some(0));
        };
        let Some(column) = self.columns.row_wire else {
            return match &mut self.lines_in_turn {
                Some(lines) => {
                    *lines += 1;
                    Ok(Some((*lines - 1) % rows.read.len()))
                }
                None if rows.are_needed => Err(LineError::Final(line, NO_ROW.to_owned())),
                None => Ok(None),
            };
        };
        let row = self.cells[column] as usize;
        let index = rows.read.iter().position(|read| read + 1 == row);
        index.map(Some).ok_or_else(|| {
            let read = Vec::from_iter(rows.read.iter().map(|row| (row + 1).to_string())).join(", ");
            let noun = if rows.read.len() == 1 { "row" } else { "rows" };
            LineError::Malformed(
                line,
                format!("there is no network for row {row}, only for {noun} {read}"),
            )
        })
    }

    /// Finds the inputs in the cells of a header, or in lines of `width` cells without one.
    fn find_columns(&mut self, header: &[String], width: usize) -> Result<(), String> {
        let channels = self.problem.inputs.len();
        let all = self.rows.as_ref().map_or(0, |rows| rows.read.len()) * channels;
        let needs_row_wire = self.rows.is_some() && !self.is_array;
        let is_unnamed_array = self.is_array && header.is_empty();
        let is_snapshot = is_unnamed_array && width == all && width > channels;
        let (columns, derived) = if is_unnamed_array {
            let count = if is_snapshot { all } else { channels };
            let columns = InputColumns::in_order(count, !is_snapshot && width == count + 1);
            (columns, DerivedStream::default())
        } else {
            InputColumns::of(header, width, &self.problem, &self.recipe, needs_row_wire)?
        };
        if self.is_array
            && let Some(name) = InputColumns::named_twice(header, &self.problem.inputs)
        {
            return Err(format!("there are two columns '{name}'; keep one"));
        }
        if needs_row_wire && columns.row_wire.is_none() {
            let name = self.recipe.row_wire.as_deref().unwrap_or("row");
            return Err(format!(
                "there is no column '{name}', which is an input of the network; each row-wire has its own network, which is \
                 selected by this column"
            ));
        }
        // The header of a device that starts again does not begin another start.
        if self.columns != columns {
            let cells = columns.kept.iter().filter(|_| !self.is_array);
            let cells = cells.map(|(_, title)| KeptCell {
                title: title.clone(),
                text: String::new(),
            });
            self.kept = cells.collect();
            (self.columns, self.derived) = (columns, derived);
        }
        (self.has_names, self.is_snapshot) = (!header.is_empty(), is_snapshot);
        Ok(())
    }
}

impl InputColumns {
    fn series(&self, group: u64, cells: &[f64]) -> Series {
        let row_wire = self.row_wire.and_then(|column| row_wire(cells[column]));
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

    fn readings(lines: &mut LineParser, line: u64, text: &str) -> Option<(usize, Vec<f64>)> {
        match lines.parse(line, text.as_bytes()).unwrap() {
            ParsedLine::Row {
                row_index, readings, ..
            } => Some((row_index.unwrap(), readings.to_vec())),
            _ => None,
        }
    }

    /// Parser of these inputs, with the columns and the memory of `recipe`.
    fn lines(inputs: &[&str], recipe: &Recipe, row_wires: Option<Vec<usize>>) -> LineParser {
        let problem = Problem {
            inputs: channels(inputs),
            targets: channels(&["x"]),
            memory: recipe.memory.clone(),
            positions: Vec::new(),
            sensor: None,
        };
        LineParser::of_recording(&problem, recipe, row_wires).unwrap()
    }

    fn plain(inputs: &[&str]) -> LineParser {
        lines(inputs, &Recipe::default(), None)
    }

    /// Line, column and text of a cell that cannot be used.
    fn bad_cell(error: &LineError) -> (u64, usize, &str) {
        match error {
            LineError::Cell(line, column, reason) => (*line, *column, reason.split('\'').nth(1).unwrap()),
            _ => panic!("{error}"),
        }
    }

    #[test]
    fn inputs_are_found_by_name_or_by_order() {
        let mut lines = plain(&["u1", "u2"]);
        assert_eq!(readings(&mut lines, 1, "time,u2,u1"), None);
        assert_eq!(readings(&mut lines, 2, "0.1,2,1"), Some((0, vec![1.0, 2.0])));
        assert_eq!(readings(&mut lines, 3, ""), None);
        let error = lines.parse(4, b"0.2,?,1").unwrap_err();
        assert_eq!(bad_cell(&error), (4, 2, "?"));
        assert!(!error.is_final());
        let mut unnamed = plain(&["u1", "u2"]);
        assert_eq!(readings(&mut unnamed, 1, "1,2"), Some((0, vec![1.0, 2.0])));
        let other = unnamed.parse(2, b"1,2,3").unwrap_err();
        let expected = "line 2: 3 cells where 2 are needed, separated by commas";
        assert_eq!(other.to_string(), expected);
        let mut renamed = plain(&["u1", "u2"]);
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
            let mut lines = plain(&["u1", "u2"]);
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
            let mut lines = plain(&["u1", "u2"]);
            assert_eq!(readings(&mut lines, 1, header), None);
            assert_eq!(readings(&mut lines, 2, "1,2,"), Some((0, vec![1.0, 2.0])), "{header}");
            assert_eq!(readings(&mut lines, 3, "3,4,"), Some((0, vec![3.0, 4.0])), "{header}");
            assert!(lines.parse(4, b"1,2,3,4").is_err());
        }
    }

    #[test]
    fn a_line_that_a_memory_cannot_place_is_bad() {
        let recipe = Recipe {
            time: Some("t".to_owned()),
            row_wire: Some("row".to_owned()),
            memory: Some(Memory {
                lags: vec![Span::Samples(1.0)],
                ..Memory::default()
            }),
            ..Recipe::default()
        };
        let mut lines = lines(&["u"], &recipe, None);
        assert_eq!(readings(&mut lines, 1, "t,row,u"), None);
        assert_eq!(
            readings(&mut lines, 2, "2026-11-24T12:00:00Z,1,5"),
            Some((0, vec![5.0, 5.0]))
        );
        for (text, column) in [
            ("2026-11-24T12:61:00Z,1,5", 1),
            ("nan,1,5", 1),
            ("2026-11-24T12:00:00.1Z,0.5,5", 2),
        ] {
            assert_eq!(
                bad_cell(&lines.parse(3, text.as_bytes()).unwrap_err()).1,
                column,
                "{text}"
            );
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
    fn a_time_may_be_a_derived_column() {
        let recipe = Recipe {
            time: Some("d".to_owned()),
            derive: vec!["d=a-b".parse().unwrap()],
            memory: Some(Memory {
                lags: vec![Span::Samples(1.0)],
                ..Memory::default()
            }),
            ..Recipe::default()
        };
        let mut lines = lines(&["u"], &recipe, None);
        assert_eq!(readings(&mut lines, 1, "a (s),b (s),u"), None);
        assert_eq!(readings(&mut lines, 2, "5,4,7"), Some((0, vec![7.0, 7.0])));
        assert_eq!(readings(&mut lines, 3, "6,4.5,8"), Some((0, vec![8.0, 7.0])));
    }

    #[test]
    fn the_row_wire_selects_the_network() {
        let recipe = Recipe {
            row_wire: Some("row".to_owned()),
            ..Recipe::default()
        };
        let mut lines = lines(&["u"], &recipe, Some(vec![0, 2]));
        assert_eq!(readings(&mut lines, 1, "row,u"), None);
        assert_eq!(readings(&mut lines, 2, "3,5"), Some((1, vec![5.0])));
        let error = lines.parse(3, b"2,5").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 3: there is no network for row 2, only for rows 1, 3"
        );
    }

    #[test]
    fn columns_are_copied_as_they_came_and_derived_ones_as_numbers() {
        let recipe = Recipe {
            time: Some("press".to_owned()),
            group: Some("gap".to_owned()),
            derive: vec!["gap=u1-u2".parse().unwrap()],
            ..Recipe::default()
        };
        let mut lines = lines(&["u1", "u2"], &recipe, None);
        assert_eq!(readings(&mut lines, 1, "press,u1,u2"), None);
        let Ok(ParsedLine::Row { kept, .. }) = lines.parse(2, b"\"007\",2.50,1") else {
            panic!("no readings")
        };
        let texts = kept.iter().map(|cell| (cell.title.as_str(), cell.text.as_str()));
        assert_eq!(Vec::from_iter(texts), [("press", "007"), ("gap", "1.5")]);
    }

    #[test]
    fn a_memory_continues_from_line_to_line_and_uses_the_time_column() {
        let recipe = Recipe {
            time: Some("t".to_owned()),
            memory: Some(Memory {
                interval_s: Some(0.1),
                averages: vec![Span::Seconds(2.0)],
                ..Memory::default()
            }),
            ..Recipe::default()
        };
        let new = || lines(&["u"], &recipe, None);
        let mut lines = new();
        let average = |elapsed_s: f64| 1.0 - f64::exp(-elapsed_s / 2.0);
        let mut check = |line: u64, text: &str, expected: f64| {
            let (_, found) = readings(&mut lines, line, text).unwrap();
            assert!((found[1] - expected).abs() < 1e-14, "{text}: {found:?}");
        };
        check(1, "0", 0.0);
        check(2, "1", average(0.1));
        check(3, "1", average(0.2));
        let mut timed = new();
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

    fn parser(rows: Rows, is_complete: bool) -> LineParser {
        LineParser::of_array("2x1_1x3".parse().unwrap(), rows, is_complete).unwrap()
    }

    fn row(row_index: Option<usize>, readings: &[f64]) -> ParsedLine<'_> {
        ParsedLine::Row {
            row_index,
            readings,
            time_s: None,
            place: None,
            kept: &[],
        }
    }

    #[test]
    fn rows_are_identified_by_name_by_number_or_by_count() {
        let mut named = parser(Rows::Known, false);
        assert_eq!(
            named.parse(1, b"clock,row,r_2,r_1,r_3").unwrap(),
            ParsedLine::NoReadings
        );
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
        let message = parser.parse(2, b"1,2,3").unwrap_err().to_string();
        assert!(message.starts_with("line 2: 3 cells where 6"), "{message}");
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
            ("time,r_1,r_2", "line 1: there is no column 'r_3'"),
            ("R1,R2,R3", "line 1: there is no column 'r_1'"),
            ("r_1,r_2,r_3,r_2", "line 1: there are two columns 'r_2'"),
        ] {
            let error = parser(Rows::Known, true).parse(1, names.as_bytes()).unwrap_err();
            assert!(error.is_final() && error.to_string().starts_with(words), "{error}");
        }
    }

    #[test]
    fn garbage_before_the_first_frame_does_not_determine_the_layout() {
        let mut parser = parser(Rows::Known, false);
        assert!(parser.parse(1, b"4,5,").is_err());
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
        assert_eq!(message, "line 3: there is no network for row 2, only for row 1");
        assert_eq!(
            parser(Rows::One(1), false).parse(3, b"4,5,6").unwrap(),
            row(Some(0), &[4.0, 5.0, 6.0])
        );
    }

    #[test]
    fn the_time_of_a_line_is_that_of_its_column() {
        let mut parser = parser(Rows::Known, false);
        parser.parse(1, b"row,time_s,r_1,r_2,r_3").unwrap();
        for (text, expected) in [("1,0.25,4,5,6", Some(0.25)), ("2,?,4,5,6", None)] {
            let ParsedLine::Row { time_s, .. } = parser.parse(2, text.as_bytes()).unwrap() else {
                panic!("no row")
            };
            assert_eq!(time_s, expected, "{text}");
        }
    }
}
