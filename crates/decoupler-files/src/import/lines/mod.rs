//! Lines of CSV with the readings of a network, as they arrive or from a file.
//!
//! There is one parser for all of them: [`LineParser::of_array`] reads the resistances of an array, and
//! [`LineParser::of_recording`] the columns that a network was trained on. [`ReadingsFile`] passes it the lines of a file.

mod line_error;
mod line_parser;
mod readings_file;

pub use line_error::LineError;
pub use line_parser::{KeptCell, LineParser, ParsedLine};
pub use readings_file::{Readings, ReadingsFile};

/// Maximum length of a line of readings: 1 MiB. A line of the largest array takes about 100 kB.
pub const LONGEST_LINE: usize = 1 << 20;
