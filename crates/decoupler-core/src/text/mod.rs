//! Text in and out: formatted numbers and counts, clean names, plain words for errors of the operating system, and readings in
//! CSV.

mod format;
mod resistance_reader;

pub use format::{
    begins_formula, capitalised, clean_name, counted, format_below_one, format_duration, format_number, format_percent,
    format_r2, in_one_line, inert, is_unprintable, original_name, printable, system_cause,
};
pub(crate) use format::{cleaned, cleaned_if_any, escaped_if_any, system_words};
pub use resistance_reader::{CsvFields, LONGEST_ROW, ReadError, Reading, ResistanceColumns, ResistanceReader, number};
