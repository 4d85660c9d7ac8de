//! Measured data out of files: tables of text, NumPy and MATLAB, joined by time, with a meaning for each column.
//!
//! [`read_table`] reads one file and [`Inspection`] looks at its columns. A [`Recipe`] says which files are joined and what
//! their columns mean, and gives a [`Recording`]: samples with names, units and times, and what was left out and why. A
//! [`Plan`] adds how the samples are divided for training and test; [`suggested_plan`] guesses one from the files. A [`Setup`]
//! is a plan or a simulated array with the settings of a run: everything that gives its samples again.
//!
//! [`Format`] lists the kinds of files. A further one is an entry there and a module that reads its arrays.

mod csv_table;
mod detection;
mod dialect;
mod error;
mod format;
mod importing;
mod input_lines;
mod inputs;
mod inspection;
mod join;
mod matlab;
mod missing;
mod numpy;
mod plan;
mod positions;
mod recipe;
mod rows;
mod selection;
mod setup;
mod suggestion;
mod table;

pub use dialect::{Decimal, Dialect, DialectChoice, DialectError, Encoding, Separator};
pub use error::{Cure, ImportError, TableError};
pub use format::Format;
pub use importing::{Dropped, FileReport, JoinReport, Recording, read_table};
pub use input_lines::{InputLine, InputLineError, InputLines, Progress, Watch};
pub use inputs::{InputColumns, InputError, InputTable};
pub use inspection::{ColumnKind, ColumnSummary, InspectedFile, Inspection, TimeSummary};
pub use missing::{Condition, Missing};
pub use plan::{Plan, PlannedSets, TestFiles};
pub use positions::{PositionsError, holds_positions};
pub use recipe::{FileChecksum, Joined, Recipe, Recorded, file_crc32, stored};
pub use setup::{Recordings, Setup, SetupError, SetupSets};
pub use suggestion::{Meaning, suggested_plan, suggested_plan_in_order};
pub use table::{Cells, Column, Excess, Fault, Faults, Table};
