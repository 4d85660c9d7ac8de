use std::fmt;

/// What to do about an import that fails. [`ImportError::with_cure`](super::ImportError::with_cure) puts it in the words of a
/// surface: fields, or arguments.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cure {
    /// Correct a cell, or say that this text means missing.
    CallMissing(String),
    /// Name the columns of the times in both files.
    NameTimes,
    /// Name the column of the times in the joined file.
    NameJoinedTime,
    /// Give a column one meaning.
    GiveOneMeaning,
    /// Give the largest time between partners.
    GiveLimit,
    /// Give as many joined files for the test as there are.
    GiveTestFiles,
}

impl fmt::Display for Cure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CallMissing(text) => write!(f, "correct it, or say that \"{text}\" means missing"),
            Self::NameTimes => f.write_str("name the columns of the times of both"),
            Self::NameJoinedTime => f.write_str("name it"),
            Self::GiveOneMeaning => f.write_str("give the column one meaning"),
            Self::GiveLimit => f.write_str("give the limit"),
            Self::GiveTestFiles => f.write_str("give as many"),
        }
    }
}
