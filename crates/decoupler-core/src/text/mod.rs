//! Numbers, counts and names as text.

mod format;
mod named;

pub use format::{
    begins_formula, capitalised, clean_name, counted, format_below_one, format_duration, format_number, format_percent,
    format_r2, in_one_line, inert, is_unprintable, original_name, printable,
};
pub(crate) use format::{cleaned, cleaned_if_any, escaped_if_any};
pub use named::{Named, UnknownName};
