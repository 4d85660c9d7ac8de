//! Measured data out of files: tables of text, NumPy and MATLAB, joined by time, with a meaning for each column.
//!
//! [`read_table`] reads one file and [`Inspection`] looks at its columns. A [`Recipe`] says which files are joined and what
//! their columns mean, and gives a [`Recording`]: samples with names, units and times, and what was left out and why. A
//! [`Plan`] adds how the samples are divided for training and test; [`suggested_plan`] guesses one from the files. A [`Setup`]
//! is a plan or a simulated array with the settings of a run: everything that gives its samples again.
//!
//! [`Format`] lists the kinds of files. A further one is an entry there and a module that reads its arrays.

mod arrays;
mod column;
mod condition;
mod csv_table;
mod cure;
mod detection;
mod dialect;
mod element;
mod error;
mod format;
mod gather;
mod importing;
mod input_lines;
mod inputs;
mod inspected;
mod inspection;
mod join;
mod matlab;
mod meaning;
mod meanings;
mod missing;
mod names;
mod npz;
mod number;
mod numpy;
mod plan;
mod positions;
mod read;
mod recipe;
mod recorded;
mod recording;
mod rows;
mod selection;
mod setup;
mod stored_path;
mod suggestion;
mod table;
mod utf16;
mod watch;

pub use column::{Cells, Column, Fault, Faults};
pub use condition::Condition;
pub use cure::Cure;
pub use dialect::{Decimal, Dialect, DialectChoice, DialectError, Encoding, Separator};
pub use error::{ImportError, TableError};
pub use format::Format;
pub use input_lines::{InputLine, InputLineError, InputLines};
pub use inputs::{InputColumns, InputError, InputTable};
pub use inspected::InspectedFile;
pub use inspection::{ColumnKind, ColumnSummary, Inspection, TimeSummary};
pub use meaning::Meaning;
pub use missing::Missing;
pub use plan::{Plan, PlannedSets, TestFiles};
pub use positions::{PositionsError, holds_positions};
pub use read::read_table;
pub use recipe::{Joined, Recipe};
pub use recorded::{FileChecksum, Recorded, file_crc32};
pub use recording::{Dropped, FileReport, JoinReport, Recording};
pub use setup::{Recordings, Setup, SetupError, SetupSets};
pub use stored_path::stored;
pub use suggestion::{suggested_plan, suggested_plan_in_order};
pub use table::{Excess, Table};
pub use watch::{Progress, Watch};
