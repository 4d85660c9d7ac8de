//! Tables: described once, and written as CSV for other programs or as text for papers and spreadsheets.

mod description;
mod text;

pub use description::{Cell, Table, TableColumn};
pub use text::TableForm;
