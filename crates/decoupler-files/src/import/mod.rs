//! Import of measured data: text, Excel, NumPy and MATLAB tables, joined by time, with a meaning for each column.
//!
//! [`read_table`] reads one file and [`Inspection`] summarises its columns. A [`Recipe`] defines which files are joined and
//! what their columns mean; importing it returns a [`Recording`]: samples with names, units and times, and the dropped rows
//! with reasons. A [`Plan`] adds the split into training and test samples; [`suggested_plan`] guesses one from the files. A
//! [`Setup`] is a plan or a simulated array with the settings of a run: everything needed to reproduce its samples; its settings
//! can be [chosen](Setup::choose) from the samples.
//!
//! [`Format`] lists the file formats. To add one, add a variant there and a module that reads its arrays.

mod arrays;
mod choosing;
mod csv_table;
mod derived;
mod derived_stream;
mod detection;
mod dialect;
mod error;
mod format;
mod importing;
mod inputs;
mod inspection;
mod join;
mod lines;
mod matlab;
mod missing;
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
mod xls_claims;

pub use choosing::{ChoosingProgress, ChosenSetup};
pub use derived::Derived;
pub use dialect::{Decimal, Dialect, DialectChoice, DialectError, Encoding, Separator};
pub use error::{Cure, ImportError, TableError};
pub use format::Format;
pub use importing::{Dropped, FileReport, JoinReport, Recording, read_table};
pub use inputs::{InputColumns, InputError, InputTable, InputTime, KeptColumn, OtherColumns};
pub use inspection::{ColumnKind, ColumnSummary, InspectedFile, Inspection, TimeSummary};
pub use lines::{
    CsvFields, InputLine, InputLineError, InputLines, KeptCell, LONGEST_ROW, LineError, LineParser, ParsedLine,
    ReadError, Reading, ResistanceColumns, ResistanceReader,
};
pub use missing::{Condition, Missing};
pub use plan::{Plan, PlannedSets, TestFiles};
pub use positions::{PositionsError, holds_positions};
pub use progress::{Progress, Watch};
pub use recipe::{FileChecksum, FileSet, Joined, Recipe, Recorded, file_crc32};
pub use sentinel::Sentinel;
pub use setup::{Recordings, Setup, SetupError, SetupSets};
pub use suggestion::{Meaning, suggested_plan, suggested_plan_in_order};
pub use table::{Cells, Column, Excess, Fault, Faults, Table, Variable};
