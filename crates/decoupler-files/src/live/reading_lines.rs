use std::fmt::Display;

use decoupler_core::{dataset::Place, scene::Rows};

use super::SessionError;
use crate::{
    export::NetworkFile,
    import::{InputLine, InputLines, KeptCell, LineParser, ParsedLine},
};

/// Lines with the readings of a network: of an array, or of a recording by the names of its columns.
#[derive(Debug)]
pub(super) enum ReadingLines {
    Array(Box<LineParser>),
    Columns(Box<InputLines>),
}

/// Contents of a line.
pub(super) enum Reading<'a> {
    /// Header, or an empty line.
    None,
    /// Line at the start of the stream, from which the mean of a derived column is computed.
    Start { is_first: bool },
    /// Readings of one row-wire, or of a recording.
    Row {
        /// Index of its row-wire or network; `None` if unknown.
        row_index: Option<usize>,
        readings: &'a [f64],
        place: Option<Place>,
        kept: &'a [KeptCell],
    },
    /// Readings of all row-wires read.
    Snapshot(&'a [f64]),
}

/// Reason why a line has no readings.
pub(super) struct BadLine {
    pub(super) reason: String,
    /// True if no later line can be read either.
    pub(super) is_final: bool,
}

impl BadLine {
    fn new(reason: &dyn Display, is_final: bool) -> Self {
        Self {
            reason: reason.to_string(),
            is_final,
        }
    }
}

impl ReadingLines {
    /// Prepares to parse lines for `file`. `needs_rows` asks for the row-wire of each line even if the network does not;
    /// `is_complete` means that no line of the input is lost.
    pub(super) fn new(file: &NetworkFile, needs_rows: bool, is_complete: bool) -> Result<Self, SessionError> {
        let Some(simulation) = &file.problem.sensor else {
            return Ok(Self::Columns(Box::new(file.input_lines())));
        };
        let rows = match simulation.scene.rows {
            Rows::All if needs_rows => Rows::Known,
            rows => rows,
        };
        let parser = LineParser::new(simulation.sensor.scale, rows, is_complete)?;
        Ok(Self::Array(Box::new(parser)))
    }

    /// Parses the line of this number, from 1.
    pub(super) fn parse(&mut self, line: u64, text: &[u8]) -> Result<Reading<'_>, BadLine> {
        match self {
            Self::Array(parser) => match parser.parse(line, text) {
                Ok(ParsedLine::NoReadings) => Ok(Reading::None),
                Ok(ParsedLine::Snapshot(readings)) => Ok(Reading::Snapshot(readings)),
                Ok(ParsedLine::Row {
                    row_index,
                    readings_ohm,
                }) => Ok(Reading::Row {
                    row_index,
                    readings: readings_ohm,
                    place: None,
                    kept: &[],
                }),
                Err(error) => Err(BadLine::new(&error, error.is_final())),
            },
            Self::Columns(lines) => match lines.parse(line, text) {
                Ok(InputLine::NoReadings) => Ok(Reading::None),
                Ok(InputLine::Start { is_first }) => Ok(Reading::Start { is_first }),
                Ok(InputLine::Readings {
                    row_index,
                    readings,
                    place,
                    kept,
                }) => Ok(Reading::Row {
                    row_index: Some(row_index),
                    readings,
                    place,
                    kept,
                }),
                Err(error) => Err(BadLine::new(&format_args!("line {line}: {error}"), error.is_final())),
            },
        }
    }

    /// Counts a line that is too long to be parsed.
    pub(super) fn count_bad(&mut self) {
        if let Self::Array(parser) = self {
            parser.count_bad();
        }
    }
}
