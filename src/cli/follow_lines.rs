//! Lines as they come, parsed for the network that decodes them.

use std::fmt;

use super::failure::Failure;
use crate::{
    dataset::{CsvFields, SimulationError, number},
    export::NetworkFile,
    import::{InputColumns, InputError},
    live::{LineError, LineParser, ParsedLine, Source},
};

/// Parser of the lines of an array or of a recording.
pub(super) enum Parser<'a> {
    /// Resistances, row by row or in whole snapshots.
    Array(LineParser),
    /// Columns under the names of the inputs.
    Columns(Box<ColumnParser<'a>>),
}

/// Error in a line.
pub(super) enum ParseError {
    Array(LineError),
    /// It has other columns than the network has inputs, so that no later line can be decoded.
    OtherColumns {
        line: u64,
        source: InputError,
    },
    Bad {
        line: u64,
        reason: String,
    },
}

impl<'a> Parser<'a> {
    /// Prepares to read lines for the network of `file`. `is_complete` is true if no line of the input is lost.
    pub(super) fn new(file: &'a NetworkFile, is_complete: bool) -> Result<Self, Failure> {
        Ok(match file.settings.source.simulation() {
            Some(simulation) => {
                let parser = LineParser::new(simulation.sensor.scale, simulation.scene.rows, is_complete);
                Self::Array(parser.map_err(SimulationError::from)?)
            }
            None => Self::Columns(Box::new(ColumnParser::new(file))),
        })
    }

    pub(super) fn parse(&mut self, line: u64, text: &[u8]) -> Result<ParsedLine<'_>, ParseError> {
        match self {
            Self::Array(parser) => parser.parse(line, text).map_err(ParseError::Array),
            Self::Columns(parser) => parser.parse(line, text),
        }
    }

    /// Counts a line that is too long to be parsed.
    pub(super) fn count_bad(&mut self) {
        if let Self::Array(parser) = self {
            parser.count_bad();
        }
    }
}

impl ParseError {
    /// Returns true if the later lines cannot be decoded either.
    pub(super) fn is_final(&self) -> bool {
        match self {
            Self::Array(error) => error.is_final(),
            Self::OtherColumns { .. } => true,
            Self::Bad { .. } => false,
        }
    }

    /// The failure of a program that stops at this error in the lines of `input`.
    pub(super) fn failure(self, input: Source) -> Failure {
        match self {
            Self::Array(error) => Failure::Line(input, error),
            Self::OtherColumns { line, source } => Failure::OtherColumns { input, line, source },
            error @ Self::Bad { .. } => Failure::NothingDecoded {
                input,
                reason: error.to_string(),
            },
        }
    }
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Array(error) => error.fmt(f),
            Self::OtherColumns { line, source } => write!(f, "line {line}: {source}"),
            Self::Bad { line, reason } => write!(f, "line {line}: {reason}"),
        }
    }
}

/// Parses lines with the inputs of a network under their names or, without a header, in their order, after the number of the
/// row-wire where each has a network.
pub(super) struct ColumnParser<'a> {
    file: &'a NetworkFile,
    /// Column of the row-wires in the recording.
    row_wire: Option<&'a str>,
    fields: CsvFields,
    /// Columns of the lines, by their header or else by the first line that was decoded.
    columns: Option<InputColumns>,
    /// Cells of the line as numbers, NaN where they are none.
    cells: Vec<f64>,
    /// Readings in the order of the network's inputs.
    readings: Vec<f64>,
}

impl<'a> ColumnParser<'a> {
    fn new(file: &'a NetworkFile) -> Self {
        let recorded = file.recorded.as_ref();
        Self {
            file,
            row_wire: recorded.and_then(|recorded| recorded.plan.import.row_wire.as_deref()),
            fields: CsvFields::default(),
            columns: None,
            cells: Vec::new(),
            readings: Vec::new(),
        }
    }

    fn parse(&mut self, line: u64, text: &[u8]) -> Result<ParsedLine<'_>, ParseError> {
        let bad = |reason: String| Err(ParseError::Bad { line, reason });
        let other = |source| ParseError::OtherColumns { line, source };
        let byte_order_mark: &[u8] = if line == 1 { b"\xef\xbb\xbf" } else { b"" };
        let text = text.strip_prefix(byte_order_mark).unwrap_or(text).trim_ascii();
        if text.is_empty() {
            return Ok(ParsedLine::NoReadings);
        }
        self.fields.split(text);
        let (inputs, row_wire) = (&self.file.problem.inputs, self.row_wire);
        self.cells.clear();
        self.cells
            .extend(self.fields.iter().map(|field| number(field).unwrap_or(f64::NAN)));
        // Only a line that is not made of numbers, or the first, may be a header: the others need no strings.
        if self.columns.is_none() || self.cells.iter().any(|value| value.is_nan()) {
            let fields = self.fields.iter();
            let fields = Vec::from_iter(fields.map(|field| String::from_utf8_lossy(field).into_owned()));
            if InputColumns::is_header(&fields, inputs, line == 1) {
                self.columns = Some(InputColumns::of_header(&fields, inputs, row_wire).map_err(other)?);
                return Ok(ParsedLine::NoReadings);
            }
        }
        let has_rows = self.file.network.only().is_none();
        let columns = match &self.columns {
            Some(columns) => columns,
            None => match InputColumns::unnamed(self.cells.len(), inputs, row_wire, has_rows) {
                Ok(columns) => self.columns.insert(columns),
                Err(error) => return bad(error.to_string()),
            },
        };
        if self.cells.len() != columns.width {
            let (found, expected) = (self.cells.len(), columns.width);
            return bad(format!("{found} cells where {expected} are needed"));
        }
        let row_wires = columns.row_wire.iter().filter(|_| has_rows);
        let mut used = columns.inputs.iter().chain(row_wires);
        if let Some(column) = used.find(|&&column| !self.cells[column].is_finite()) {
            return bad(format!("cell {} is not a finite number", column + 1));
        }
        let row_index = match (&self.file.row_wires, columns.row_wire) {
            (Some(read), Some(column)) if has_rows => {
                let row = self.cells[column];
                match read.iter().position(|read| (*read + 1) as f64 == row) {
                    Some(index) => index,
                    None => return bad(format!("there is no network for row {row}")),
                }
            }
            _ if has_rows => {
                let name = row_wire.unwrap_or("row").to_owned();
                let near = "it has the number of the row-wire, and there is a network for each".to_owned();
                return Err(other(InputError::Missing { name, near }));
            }
            _ => 0,
        };
        self.readings.clear();
        self.readings
            .extend(columns.inputs.iter().map(|&column| self.cells[column]));
        Ok(ParsedLine::Row {
            row_index: Some(row_index),
            readings_ohm: &self.readings,
        })
    }
}
