use thiserror::Error;

/// Reason why a line, of this number from 1, has no readings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LineError {
    /// No line after this one can be read either: a header without the inputs of the network, say.
    #[error("line {0}: {1}")]
    Final(u64, String),
    /// The line is malformed, or no network reads its row-wire.
    #[error("line {0}: {1}")]
    Malformed(u64, String),
    /// The cell in this column, from 1, cannot be used.
    #[error("line {0}, column {1}: {2}")]
    Cell(u64, usize, String),
}

impl LineError {
    /// Returns `true` if no line after this one can be read either.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Final(..))
    }
}
