//! Import of measured data: text, Excel, NumPy and MATLAB tables, joined by time, with a meaning for each column.
//!
//! [`read_table`] reads one file and [`InspectedFile`] summarises its columns. A [`Recipe`] defines which files are joined and
//! what their columns mean; importing it returns a [`Recording`]: samples with names, units and times, and the dropped rows
//! with reasons. A [`Plan`] adds the split into training and test samples; [`suggested_plan`] guesses one from the files. A
//! [`Setup`] is a plan or a simulated array with the settings of a run: everything needed to reproduce its samples; its settings
//! can be [chosen](Setup::choose) from the samples.
//!
//! [`Format`] lists the file formats. To add one, add a variant there and a module that reads its arrays.

mod archive;
mod arrays;
mod choosing;
mod columns;
mod csv_table;
mod derived;
mod detection;
mod dialect;
mod error;
mod expression;
mod fields;
mod format;
mod importing;
mod inputs;
mod inspection;
mod join;
mod lines;
mod matlab;
mod numpy;
mod part;
mod plan;
mod positions;
mod progress;
mod recipe;
mod rows;
mod selection;
mod sentinel;
mod setup;
mod sheet;
mod sheet_claims;
mod suggestion;
mod table;
mod time_stamp;

pub use choosing::ChoosingProgress;
pub use dialect::{Decimal, Dialect, DialectChoice, Encoding, Separator};
pub use error::{Cure, ImportError, TableError};
pub use expression::{Condition, Derived, Missing};
pub use format::Format;
pub use importing::{Dropped, FileReport, JoinReport, Recording, read_table};
pub use inputs::InputTable;
pub use inspection::{ColumnKind, ColumnSummary, InspectedFile, TimeSummary};
pub use lines::{KeptCell, LONGEST_LINE, LineError, LineParser, ParsedLine, Readings, ReadingsFile};
pub use plan::Plan;
pub use positions::holds_positions;
pub use progress::{Progress, Watch};
pub use recipe::{FileChecksum, FileSet, Joined, Recipe, Recorded, file_crc32};
pub(crate) use recipe::{restored, stored};
pub use sentinel::Sentinel;
pub(crate) use setup::watch;
pub use setup::{Recordings, Setup, SetupError, SetupSets};
pub use suggestion::{Meaning, is_group_name, suggested_plan, suggested_plan_in_order};
pub use table::{Column, Fault, Faults, Table, Variable};
