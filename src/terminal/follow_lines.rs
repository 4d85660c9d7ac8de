//! Lines as they come, parsed for the network that decodes them.

use std::fmt;

use super::failure::Failure;
use decoupler_core::{
    dataset::SimulationError,
    live::{LineError, LineParser, ParsedLine, Source},
};
use decoupler_files::{
    export::NetworkFile,
    import::{InputLine, InputLineError, InputLines},
};

/// Parser of the lines of an array or of a recording.
pub(super) enum Parser {
    /// Resistances, row by row or in whole snapshots.
    Array(Box<LineParser>),
    /// Columns under the names of the inputs.
    Columns(Box<InputLines>),
}

/// Error in a line.
pub(super) enum ParseError {
    Array(LineError),
    Columns { line: u64, source: InputLineError },
}

impl Parser {
    /// Prepares to read lines for the network of `file`. `is_complete` is true if no line of the input is lost.
    pub(super) fn new(file: &NetworkFile, is_complete: bool) -> Result<Self, Failure> {
        Ok(match file.settings.source.simulation() {
            Some(simulation) => {
                let parser = LineParser::new(simulation.sensor.scale, simulation.scene.rows, is_complete);
                Self::Array(Box::new(parser.map_err(SimulationError::from)?))
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
                Err(source) => Err(ParseError::Columns { line, source }),
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
            Self::Columns { source, .. } => source.is_final(),
        }
    }

    /// The failure of a program that stops at this error in the lines of `input`.
    pub(super) fn failure(self, input: Source) -> Failure {
        match self {
            Self::Array(error) => Failure::Line(input, error),
            Self::Columns { line, source } => Failure::OtherColumns { input, line, source },
        }
    }
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Array(error) => error.fmt(f),
            Self::Columns { line, source } => write!(f, "line {line}: {source}"),
        }
    }
}
