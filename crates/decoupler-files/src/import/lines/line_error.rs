use std::fmt;

use decoupler_core::text::counted;
use thiserror::Error;

use super::super::{InputError, TableError};

/// Reason why a line has no readings. Lines and columns are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LineError {
    /// A header without the inputs of the network: no line after it can be read.
    #[error("line {line}: {source}")]
    Header {
        /// Line number.
        line: u64,
        /// Error in the header.
        source: InputError,
    },
    /// Without a header, the first line has a different number of cells than there are inputs.
    #[error("line {line}: {source}")]
    Unnamed {
        /// Line number.
        line: u64,
        /// Error in the number of cells.
        source: InputError,
    },
    /// The number of cells is wrong.
    #[error("line {line}: {} where {expected} are needed, separated by commas", counted(*.found, "cell"))]
    Width {
        /// Line number.
        line: u64,
        /// Number of cells.
        found: usize,
        /// Number needed.
        expected: usize,
    },
    /// A cell that cannot be used.
    #[error("line {line}, column {column}: '{text}' is not {needed}")]
    Cell {
        /// Line number.
        line: u64,
        /// Column number.
        column: usize,
        /// Text of the cell, shortened.
        text: String,
        /// What it should be.
        needed: Needed,
    },
    /// A derived column without a value, such as a quotient by zero.
    #[error("line {line}: the derived column '{name}' has no value")]
    NoValue {
        /// Line number.
        line: u64,
        /// Name of the column.
        name: String,
    },
    /// A line break does not end a line: it is a single carriage return.
    #[error("line {0}: there is a line break within the line; end lines, and only lines, with LF or CR LF")]
    LineBreak(u64),
    /// No network reads this row-wire.
    #[error("line {line}: there is no network for row {row}, only for {}", row_list(.read))]
    OtherRow {
        /// Line number.
        line: u64,
        /// Row-wire, from 1.
        row: usize,
        /// Row-wires that are read, from 0.
        read: Vec<usize>,
    },
    /// The line has no row number, which the network needs.
    #[error(
        "line {0}: it has no row number, and it is not known with which row a device begins; send the row number before \
         the resistances, or whole snapshots in one line"
    )]
    NoRow(u64),
}

/// What a cell should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needed {
    /// A reading of an array.
    Resistance,
    /// An input of a network.
    Number,
    /// A time for a memory.
    Time,
    /// The number of a row-wire, from 1 to this.
    RowWire(usize),
}

impl Needed {
    /// Returns `true` for the number of a cell that can be used; NaN if the cell is not a number.
    pub(super) fn is_met(self, number: f64) -> bool {
        match self {
            Self::Resistance => number > 0.0 && number.is_finite(),
            Self::Number | Self::Time => number.is_finite(),
            Self::RowWire(last) => number.fract() == 0.0 && (1.0..=last as f64).contains(&number),
        }
    }
}

impl fmt::Display for Needed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Resistance => f.write_str("a resistance; give a finite number of ohm above 0"),
            Self::Number => f.write_str("a finite number"),
            Self::Time => f.write_str("a time, which the history of readings needs"),
            Self::RowWire(last) => write!(f, "a row-wire; give a number from 1 to {last}"),
        }
    }
}

/// Returns "row 3", or "rows 1, 3".
fn row_list(rows: &[usize]) -> String {
    let numbers = Vec::from_iter(rows.iter().map(|row| (row + 1).to_string()));
    format!(
        "{} {}",
        if rows.len() == 1 { "row" } else { "rows" },
        numbers.join(", ")
    )
}

impl LineError {
    /// Returns `true` if no line after this one can be read either.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Header { .. } | Self::NoRow(_))
    }
}

/// Error in a file of readings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be read, or is not text.
    #[error(transparent)]
    File(#[from] TableError),
    /// A line has no readings.
    #[error(transparent)]
    Line(#[from] LineError),
}
