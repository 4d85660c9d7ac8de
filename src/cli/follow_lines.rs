//! Lines as they come, parsed for the network that decodes them.

use std::fmt;

use super::failure::Failure;
use crate::{
    dataset::SimulationError,
    export::NetworkFile,
    import::{InputError, InputLine, InputLineError, InputLines},
    live::{LineError, LineParser, ParsedLine, Source},
};

/// Parser of the lines of an array or of a recording.
pub(super) enum Parser {
    /// Resistances, row by row or in whole snapshots.
    Array(LineParser),
    /// Columns under the names of the inputs.
    Columns(Box<InputLines>),
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

impl Parser {
    /// Prepares to read lines for the network of `file`. `is_complete` is true if no line of the input is lost.
    pub(super) fn new(file: &NetworkFile, is_complete: bool) -> Result<Self, Failure> {
        Ok(match file.settings.source.simulation() {
            Some(simulation) => {
                let parser = LineParser::new(simulation.sensor.scale, simulation.scene.rows, is_complete);
                Self::Array(parser.map_err(SimulationError::from)?)
            }
            None => Self::Columns(Box::new(file.input_lines())),
        })
    }

    pub(super) fn parse(&mut self, line: u64, text: &[u8]) -> Result<ParsedLine<'_>, ParseError> {
        match self {
            Self::Array(parser) => parser.parse(line, text).map_err(ParseError::Array),
            Self::Columns(parser) => match parser.parse(line, text) {
                Ok(InputLine::NoReadings) => Ok(ParsedLine::NoReadings),
                Ok(InputLine::Readings { row_index, readings }) => Ok(ParsedLine::Row {
                    row_index: Some(row_index),
                    readings_ohm: readings,
                }),
                Err(InputLineError::Header(source)) => Err(ParseError::OtherColumns { line, source }),
                Err(error) => Err(ParseError::Bad {
                    line,
                    reason: error.to_string(),
                }),
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
