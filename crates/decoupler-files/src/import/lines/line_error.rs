use thiserror::Error;

use super::super::TableError;

/// Reason why a line, of this number from 1, has no readings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LineError {
    /// No line after this one can be read either: a header without the inputs of the network, say.
    #[error("line {0}: {1}")]
    Final(u64, String),
    /// The line is malformed.
    #[error("line {0}: {1}")]
    Malformed(u64, String),
    /// The cell in this column, from 1, cannot be used.
    #[error("line {0}, column {1}: {2}")]
    Cell(u64, usize, String),
    /// No network reads this row-wire.
    #[error("line {0}: {1}")]
    OtherRow(u64, String),
}

impl LineError {
    /// Returns `true` if no line after this one can be read either.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Final(..))
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
