//! Lines of CSV with the readings of a network, as they arrive or from a file.
//!
//! There is one parser for all of them: [`LineParser::of_array`] reads the resistances of an array, and
//! [`LineParser::of_recording`] the columns that a network was trained on. [`ReadingsFile`] passes it the lines of a file.

mod line_parser;
mod readings_file;

pub use line_parser::{KeptCell, LineParser, ParsedLine};
pub use readings_file::{Readings, ReadingsFile};
use thiserror::Error;

/// Maximum length of a line of readings: 1 MiB. A line of the largest array takes about 100 kB.
pub const LONGEST_LINE: usize = 1 << 20;

/// Reason why a line, of this number from 1, has no readings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LineError {
    /// No line after this one can be read either: a header without the inputs of the network, say.
    #[error("line {0}: {1}")]
    Final(u64, String),
    /// The line is malformed, or no network reads its row-wire.
    #[error("line {0}: {1}")]
    Malformed(u64, String),
    /// The cell in this column, from 1, cannot be used.
    #[error("line {0}, column {1}: {2}")]
    Cell(u64, usize, String),
}

impl LineError {
    /// Returns `true` if no line after this one can be read either.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Final(..))
    }
}
