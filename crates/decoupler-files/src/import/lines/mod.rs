//! Lines of CSV as they arrive: those of an array, with resistances, and those with the inputs of a network; and files of
//! resistances, read block by block.

mod input_lines;
mod line_parser;
mod resistance_reader;

pub use input_lines::{InputLine, InputLineError, InputLines, KeptCell};
pub use line_parser::{LineError, LineParser, ParsedLine};
pub use resistance_reader::{CsvFields, LONGEST_ROW, ReadError, Reading, ResistanceColumns, ResistanceReader};
