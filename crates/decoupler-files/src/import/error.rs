use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use decoupler_core::{dataset::DatasetError, text::in_one_line};
use thiserror::Error;

use super::progress::Cancelled;
use crate::machine::{OverBudget, system_cause};

/// Error of an import. Lines and columns are counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A stored plan names a pipe or device.
    #[error("'{}' is a pipe or device, which is read only when it is given as an argument; write its data to a file", .0.display())]
    Irregular(PathBuf),
    /// A file cannot be read, or its contents are not a table.
    #[error("{}'{}': {source}", if let TableError::Io(_) = source { "cannot read " } else { "" }, .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error in its contents, or of the operating system.
        source: TableError,
    },
    /// A name, range, meaning or condition of a recipe is wrong, or does not fit the files.
    #[error("{0}")]
    Columns(String),
    /// The rows cannot become samples: a derived column has no value, a row-wire is not a number, or no row is left; or files
    /// do not fit together.
    #[error("{0}")]
    Samples(String),
    /// A cell is not a number, or a file cannot be joined, with a remedy that each interface words in its own terms.
    #[error("{cause}; {cure}")]
    Curable {
        /// The file and what is wrong with it.
        cause: String,
        /// Remedy.
        cure: Cure,
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
            Self::Columns(_) | Self::Samples(_) | Self::Dataset(_) => {
                Self::Samples(format!("'{}': {self}", path.display()))
            }
            error => error,
        }
    }

    /// Returns the message with the cure in the caller's wording, for example with the names of fields or arguments.
    pub fn with_cure(&self, phrase: impl Fn(&Cure) -> String) -> String {
        match self {
            Self::Curable { cause, cure } => format!("{cause}; {}", phrase(cure)),
            error => error.to_string(),
        }
    }
}

/// Error in the contents of a file. Lines and columns are counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file could not be read to the end.
    #[error("{}", system_cause(.0))]
    Io(io::Error),
    /// The caller cancelled the import.
    #[error("the import was cancelled")]
    Cancelled,
    /// The file is empty.
    #[error("it has no rows; choose a file with a table of numbers")]
    Empty,
    /// A quote, in the row that starts on this line, is not closed.
    #[error("line {0}: the quote that opens here is never closed; close it, or remove it")]
    Quote(u64),
    /// Reading it needs too much memory.
    #[error(transparent)]
    OverBudget(#[from] OverBudget),
    /// An array is invalid, or contains data of an unsupported type; others in the same file may be read.
    #[error("{0}")]
    Array(String),
    /// The contents are damaged, of another kind, or not the table that is needed: where, why, and what to do.
    #[error("{0}")]
    Contents(String),
}

impl From<io::Error> for TableError {
    fn from(error: io::Error) -> Self {
        match error.get_ref() {
            Some(inner) if inner.is::<Cancelled>() => Self::Cancelled,
            _ => Self::Io(error),
        }
    }
}

impl TableError {
    /// Returns the error with the file in which it is.
    pub(super) fn in_file(self, path: &Path) -> ImportError {
        match self {
            Self::Cancelled => ImportError::Cancelled,
            source => ImportError::File {
                path: path.to_owned(),
                source,
            },
        }
    }

    /// Returns an error in a row that starts on this line.
    pub(super) fn in_row(line: u64, reason: impl fmt::Display) -> Self {
        Self::Contents(format!("line {line}: {reason}"))
    }

    /// Contents that do not match a checksum or a length stated in the file; `reason` is the cause and the cure.
    pub(super) fn damaged(what: &str, reason: impl fmt::Display) -> Self {
        Self::Contents(in_one_line(&format!("{what} is damaged: {reason}")))
    }

    /// An invalid array or part of a file; `reason` is the cause and the cure.
    pub(super) fn array(what: &str, reason: impl fmt::Display) -> Self {
        Self::Array(in_one_line(&format!("{what}: {reason}")))
    }
}

/// Remedy for a failed import. [`ImportError::with_cure`](super::ImportError::with_cure) phrases it for the window (fields)
/// or the terminal (arguments).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Cure {
    /// Correct a cell, or declare this text a missing value.
    #[error("correct it, or say that \"{0}\" means missing")]
    CallMissing(String),
    /// Name the time columns of both files.
    #[error("name the time columns of both")]
    NameTimes,
    /// Name the time column of the joined file.
    #[error("name it")]
    NameJoinedTime,
    /// Give the maximum time difference between joined rows.
    #[error("give the limit")]
    GiveLimit,
    /// Give as many joined files with each further file or test file as with the first.
    #[error("give as many")]
    GiveJoinedFiles,
}
