use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::SceneError;

/// Row-wires read, and whether a decoder knows which one it reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rows {
    /// One decoder for all row-wires, which does not know the row it reads: the paper's experiments.
    #[default]
    All,
    /// One decoder for each row-wire: the electronics know which row they address.
    Known,
    /// One row-wire, counted from 0.
    One(usize),
}

/// Sharing of decoders among row-wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RowModel {
    /// One for all row-wires, which does not know the row it reads.
    Shared,
    /// One for each row-wire read: the electronics know which one they address.
    Each,
}

impl Rows {
    /// The row-wires read, of an array with `rows` of them.
    ///
    /// # Errors
    /// A row that the array does not have.
    pub fn read(self, rows: usize) -> Result<Vec<usize>, SceneError> {
        match self {
            Self::All | Self::Known => Ok((0..rows).collect()),
            Self::One(row) if row < rows => Ok(vec![row]),
            Self::One(row) => Err(SceneError::Row { row: row + 1, rows }),
        }
    }

    /// One decoder for every row-wire, or one for each.
    pub fn model(self) -> RowModel {
        match self {
            Self::All => RowModel::Shared,
            Self::Known | Self::One(_) => RowModel::Each,
        }
    }
}

impl FromStr for Rows {
    type Err = SceneError;

    /// Reads `all`, `known`, or the number of a row-wire from 1.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        match text.trim() {
            "all" => Ok(Self::All),
            "known" => Ok(Self::Known),
            number => match number.parse() {
                Ok(row @ 1..) => Ok(Self::One(row - 1)),
                _ => Err(SceneError::RowsText(text.to_owned())),
            },
        }
    }
}

impl fmt::Display for Rows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.pad("all"),
            Self::Known => f.pad("known"),
            Self::One(row) => f.pad(&(row + 1).to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_counted_from_one_in_words_and_from_zero_in_the_model() {
        assert_eq!("3".parse(), Ok(Rows::One(2)));
        assert_eq!(Rows::One(2).to_string(), "3");
        assert_eq!(Rows::One(2).read(3), Ok(vec![2]));
        assert_eq!(Rows::Known.read(3), Ok(vec![0, 1, 2]));
        for rows in ["all", "known", "7"] {
            assert_eq!(rows.parse::<Rows>().unwrap().to_string(), rows);
        }
    }

    #[test]
    fn rows_that_do_not_exist_are_named() {
        assert_eq!(Rows::One(10).read(10), Err(SceneError::Row { row: 11, rows: 10 }));
        for text in ["0", "-1", "some", ""] {
            let message = text.parse::<Rows>().unwrap_err().to_string();
            assert!(message.contains("all, known"), "{message}");
        }
    }
}
