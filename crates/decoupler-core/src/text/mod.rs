//! Text in and out: formatted numbers and counts, clean names, plain words for errors of the operating system, and readings in
//! CSV.

mod clean_name;
mod counted;
mod csv_fields;
mod format;
mod resistance_columns;
mod resistance_reader;
mod system_error;

pub use clean_name::{begins_formula, clean_name, inert, is_unprintable};
pub(crate) use clean_name::{cleaned, cleaned_if_any};
pub use counted::counted;
pub use csv_fields::CsvFields;
pub use format::{capitalised, format_decimals, format_duration, format_number, format_percent, format_r2};
pub use resistance_columns::{ResistanceColumns, number};
pub use resistance_reader::{LONGEST_ROW, ReadError, Reading, ResistanceReader};
pub use system_error::system_cause;
