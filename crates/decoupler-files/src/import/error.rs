use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use decoupler_core::{dataset::DatasetError, text::in_one_line};
use thiserror::Error;

use super::{Format, InputError, PositionsError};
use crate::machine::{OverBudget, system_cause};

/// Error of an import. Lines and columns are counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be read.
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A stored plan names a pipe or device.
    #[error("'{}' is a pipe or device, which is read only when it is given as an argument; write its data to a file", .0.display())]
    Irregular(PathBuf),
    /// The contents of a file are not a table.
    #[error("'{}': {source}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error in its contents.
        source: TableError,
    },
    /// A column is not in the files.
    #[error("there is no column '{name}'; {near}")]
    Unknown {
        /// Name given.
        name: String,
        /// Similar names, or all names, as a phrase.
        near: String,
    },
    /// Several columns have this name.
    #[error("the name '{0}' is ambiguous: several columns have it; rename them in their files")]
    Ambiguous(String),
    /// A range of columns is reversed, or spans two files.
    #[error(
        "'{0}' is not a range of columns: write FIRST..LAST, both in one file and in its order, for example c2..c16"
    )]
    Range(String),
    /// A column has two meanings.
    #[error("column '{name}' is both {one} and {other}; give it one meaning")]
    TwoMeanings {
        /// Full name of the column.
        name: String,
        /// First meaning.
        one: &'static str,
        /// Second meaning.
        other: &'static str,
    },
    /// There is no input, or no target.
    #[error("no column is {0}; name at least one")]
    NoColumns(&'static str),
    /// A cell of a used column is not a number.
    #[error("'{}': line {line}, column {column} ('{name}'): '{text}' {reason}; {}", .path.display(), Cure::CallMissing(.text.clone()))]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line of the first such cell.
        line: u64,
        /// Column number in the file.
        column: usize,
        /// Full name of the column.
        name: String,
        /// Text of the cell.
        text: String,
        /// What is wrong with it and with further cells of this column, as a phrase.
        reason: String,
    },
    /// A reading that a network needs is missing.
    #[error("'{}': line {line}: {name} is missing; a network needs all of its inputs, so leave the line out", .path.display())]
    MissingInput {
        /// The file.
        path: PathBuf,
        /// Line of the cell.
        line: u64,
        /// Name of the column.
        name: String,
    },
    /// A condition cannot be parsed.
    #[error("the condition '{text}' is not understood: {reason}; write for example \"c4<145.1 and c5!=0\"")]
    Condition {
        /// The condition.
        text: String,
        /// Cause.
        reason: String,
    },
    /// A derived column cannot be parsed or computed.
    #[error("the derived column '{text}': {reason}; write for example \"d=c1-c2\" or \"r=c1/start(2s)\"")]
    Derived {
        /// The column, as written.
        text: String,
        /// Cause.
        reason: String,
    },
    /// Two files cannot be joined.
    #[error("'{}' cannot be joined: {reason}; {cure}", .path.display())]
    Join {
        /// The joined file.
        path: PathBuf,
        /// Cause.
        reason: String,
        /// Cure.
        cure: Cure,
    },
    /// One of several files of an experiment cannot be imported.
    #[error("'{}': {source}", .path.display())]
    OfFile {
        /// The file.
        path: PathBuf,
        /// Error without a path of its own.
        source: Box<ImportError>,
    },
    /// Two files of one experiment have different columns.
    #[error("'{}': {found}, and '{}': {expected}; files of one experiment need the same columns", .path.display(), .first.display())]
    OtherColumns {
        /// The file.
        path: PathBuf,
        /// Its columns.
        found: String,
        /// First file of the experiment.
        first: PathBuf,
        /// Columns of the first file.
        expected: String,
    },
    /// A test file is also used for training.
    #[error("'{}' is trained on, so it cannot be a test file; give another one", .0.display())]
    TrainedOn(PathBuf),
    /// No row is left.
    #[error("no row of {rows} is left: {reasons}")]
    NoRows {
        /// Number of rows read.
        rows: usize,
        /// Reasons for dropping rows, each with the number of rows.
        reasons: String,
    },
    /// The column of row-wires contains other values than numbers of row-wires.
    #[error("'{name}': {value} is not the number of a row-wire; give whole numbers from 1 to 10000")]
    RowWire {
        /// Full name of the column.
        name: String,
        /// First invalid value.
        value: f64,
    },
    /// The unit of the times is not a unit of time.
    #[error(
        "the times in '{name}' are in {unit}, and a memory needs times in s, ms, us, ns, min or h: give the unit of the column"
    )]
    TimeUnit {
        /// Full name of the time column.
        name: String,
        /// Its unit.
        unit: String,
    },
    /// The samples are not a valid dataset, cannot be split, or the memory is invalid for them.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The caller cancelled the import.
    #[error("the import was cancelled")]
    Cancelled,
}

impl ImportError {
    /// Returns the error with the file whose import failed, unless the message names a file already.
    pub(super) fn of_file(self, path: &Path) -> Self {
        match self {
            Self::Unknown { .. }
            | Self::Ambiguous(_)
            | Self::Range(_)
            | Self::NoRows { .. }
            | Self::RowWire { .. }
            | Self::Derived { .. }
            | Self::Dataset(_)
            | Self::Condition { .. } => Self::OfFile {
                path: path.to_owned(),
                source: Box::new(self),
            },
            error => error,
        }
    }

    /// Returns the message with the cure in the caller's wording, for example with the names of fields or arguments.
    pub fn with_cure(&self, phrase: impl Fn(&Cure) -> String) -> String {
        if let Self::OfFile { path, source } = self {
            return format!("'{}': {}", path.display(), source.with_cure(phrase));
        }
        let text = self.to_string();
        let cure = match self {
            Self::NotANumber { text, .. } => Cure::CallMissing(text.clone()),
            Self::Join { cure, .. } => cure.clone(),
            _ => return text,
        };
        match text.strip_suffix(&cure.to_string()) {
            Some(cause) => format!("{cause}{}", phrase(&cure)),
            None => text,
        }
    }
}

/// Error in the contents of a file. Lines and columns are counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file could not be read to the end.
    #[error("{}", system_cause(.0))]
    Io(#[from] io::Error),
    /// The caller cancelled the import.
    #[error("the import was cancelled")]
    Cancelled,
    /// The file is empty.
    #[error("it has no rows; choose a file with a table of numbers")]
    Empty,
    /// The file is not text.
    #[error("it is not text: line {line} contains a zero byte; give {}", Format::NAMES)]
    Binary {
        /// Line of the first zero byte.
        line: u64,
    },
    /// The file is of another kind.
    #[error("it is {what}, which is not read; {cure}")]
    OtherKind {
        /// The kind of file.
        what: &'static str,
        /// What to do instead.
        cure: &'static str,
    },
    /// No row ends within the limit.
    #[error("line {line}: no row ends within {} MiB; check its quotes and line breaks", .limit >> 20)]
    Endless {
        /// Line on which the row starts.
        line: u64,
        /// Maximum length of a row in bytes.
        limit: usize,
    },
    /// A quote is not closed.
    #[error("line {line}: the quote that opens here is never closed; close it, or remove it")]
    Quote {
        /// Line on which the row starts.
        line: u64,
    },
    /// A row has too many cells.
    #[error("line {line}: more than {limit} cells in a row; check the separator")]
    Wide {
        /// Line of the row.
        line: u64,
        /// Maximum number of cells.
        limit: usize,
    },
    /// A row has more cells than there are columns.
    #[error("line {line}: the row has more cells than there are columns; correct it")]
    Uneven {
        /// Line of the row.
        line: u64,
    },
    /// The file has too many rows.
    #[error("it has more than {0} rows; use every second row, or a part of the file")]
    Long(usize),
    /// Reading it needs too much memory.
    #[error(transparent)]
    OverBudget(#[from] OverBudget),
    /// The columns are not the inputs of a network.
    #[error(transparent)]
    Inputs(#[from] InputError),
    /// It is no table of positions of the targets.
    #[error(transparent)]
    Positions(#[from] PositionsError),
    /// The contents do not match a checksum or a length stated in the file.
    #[error("{what} is damaged: {reason}")]
    Damaged {
        /// The array or part of the file.
        what: String,
        /// Cause and cure.
        reason: String,
    },
    /// A NumPy or MATLAB file is invalid, or contains data of an unsupported type.
    #[error("{what}: {reason}")]
    Array {
        /// The array or part of the file.
        what: String,
        /// Cause and cure.
        reason: String,
    },
}

impl TableError {
    /// Returns the error with the file in which it is.
    pub(super) fn in_file(self, path: &Path) -> ImportError {
        let path = path.to_owned();
        match self {
            Self::Io(source) => ImportError::Read { path, source },
            Self::Cancelled => ImportError::Cancelled,
            source => ImportError::File { path, source },
        }
    }

    pub(super) fn damaged(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Damaged {
            what: in_one_line(&what.into()),
            reason: in_one_line(&reason.into()),
        }
    }

    pub(super) fn array(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Array {
            what: in_one_line(&what.into()),
            reason: in_one_line(&reason.into()),
        }
    }
}

/// Remedy for a failed import. [`ImportError::with_cure`](super::ImportError::with_cure) phrases it for the window (fields)
/// or the terminal (arguments).
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cure {
    /// Correct a cell, or declare this text a missing value.
    CallMissing(String),
    /// Name the time columns of both files.
    NameTimes,
    /// Name the time column of the joined file.
    NameJoinedTime,
    /// Give a column one meaning.
    GiveOneMeaning,
    /// Give the maximum time difference between joined rows.
    GiveLimit,
    /// Give as many joined files with each further file or test file as with the first.
    GiveJoinedFiles,
}

impl fmt::Display for Cure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CallMissing(text) => write!(f, "correct it, or say that \"{text}\" means missing"),
            Self::NameTimes => f.write_str("name the time columns of both"),
            Self::NameJoinedTime => f.write_str("name it"),
            Self::GiveOneMeaning => f.write_str("give the column one meaning"),
            Self::GiveLimit => f.write_str("give the limit"),
            Self::GiveJoinedFiles => f.write_str("give as many"),
        }
    }
}
