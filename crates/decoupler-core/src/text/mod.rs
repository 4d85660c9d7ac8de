//! Text in and out: formatted numbers and counts, clean names, plain words for errors of the operating system, and readings in
//! CSV.

mod clean_name;
mod csv_fields;
mod format;
mod resistance_reader;

pub use clean_name::{begins_formula, clean_name, inert, is_unprintable, system_cause};
pub(crate) use clean_name::{cleaned, cleaned_if_any};
pub use csv_fields::CsvFields;
pub use format::{capitalised, counted, format_decimals, format_duration, format_number, format_percent, format_r2};
pub use resistance_reader::{LONGEST_ROW, ReadError, Reading, ResistanceColumns, ResistanceReader, number};
