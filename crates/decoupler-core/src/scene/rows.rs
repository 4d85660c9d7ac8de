use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::SceneError;
use crate::text::Named;

/// Row-wires read, and the sharing of decoders among them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rows {
    /// One decoder for all row-wires, which does not know the row it reads, as in the paper's experiments.
    #[default]
    All,
    /// One decoder per row-wire: the electronics know which row they address.
    Known,
    /// One row-wire, counted from 0.
    One(usize),
}

/// Sharing of decoders among row-wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(rename_all = "snake_case")]
pub enum RowModel {
    /// One decoder for all row-wires, which does not know the row it reads.
    #[strum(serialize = "all")]
    Shared,
    /// One decoder per row-wire read: the electronics know which one they address.
    #[strum(serialize = "known")]
    Each,
}

impl Named for RowModel {
    const WHAT: &'static str = "possible for a recording, of which --where chooses a row, for example \"row=3\"";
    const ALL: &'static [Self] = &[Self::Shared, Self::Each];
}

impl RowModel {
    /// Number of decoders for this many row-wires.
    pub fn decoders(self, rows: usize) -> usize {
        match self {
            Self::Shared => 1,
            Self::Each => rows,
        }
    }
}

impl Rows {
    /// Returns the row-wires read in an array with `rows` row-wires.
    ///
    /// # Errors
    /// If the array does not have the row.
    pub fn read(self, rows: usize) -> Result<Vec<usize>, SceneError> {
        match self {
            Self::All | Self::Known => Ok((0..rows).collect()),
            Self::One(row) if row < rows => Ok(vec![row]),
            Self::One(row) => Err(SceneError::Row {
                row: row.saturating_add(1),
                rows,
            }),
        }
    }

    /// Returns the sharing of decoders among row-wires.
    pub fn model(self) -> RowModel {
        match self {
            Self::All => RowModel::Shared,
            Self::Known | Self::One(_) => RowModel::Each,
        }
    }
}

impl FromStr for Rows {
    type Err = SceneError;

    /// Parses `all`, `known`, or the number of a row-wire from 1.
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
            Self::One(row) => f.pad(&row.saturating_add(1).to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_counted_from_one_in_text_and_from_zero_in_the_model() {
        assert_eq!("3".parse(), Ok(Rows::One(2)));
        assert_eq!(Rows::One(2).to_string(), "3");
        assert_eq!(Rows::One(2).read(3), Ok(vec![2]));
        assert_eq!(Rows::Known.read(3), Ok(vec![0, 1, 2]));
        for rows in ["all", "known", "7"] {
            assert_eq!(rows.parse::<Rows>().unwrap().to_string(), rows);
        }
    }

    #[test]
    fn rows_that_do_not_exist_are_reported() {
        assert_eq!(Rows::One(10).read(10), Err(SceneError::Row { row: 11, rows: 10 }));
        // The last number that a file can have.
        let last = Rows::One(usize::MAX);
        assert!(last.read(10).is_err() && last.to_string() == usize::MAX.to_string());
        for text in ["0", "-1", "some", ""] {
            let message = text.parse::<Rows>().unwrap_err().to_string();
            assert!(message.contains("all, known"), "{message}");
        }
    }
}
