use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use super::{Condition, DialectChoice, Missing};

/// A recipe by which samples are made of files: those to read, those to join, and the meaning of each column.
///
/// A column is named as in the header, or c1, c2, … where there is none; `c2..c16` is a range; the columns of a joined
/// file have its stem in front, as in `states.c2`. Columns that are not named are not used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The file, relative to the folder of the recipe.
    pub data: PathBuf,
    /// Files whose rows are joined to those of `data`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub join: Vec<Joined>,
    /// Layout of files of text, where it should not be found.
    #[serde(default)]
    pub dialect: DialectChoice,
    /// Readings of the sensor.
    pub inputs: Vec<String>,
    /// Columns to be predicted from them.
    pub targets: Vec<String>,
    /// Column of the time of `data`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Column whose equal values belong together, as one press or one session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Column of the number of the row-wire, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_wire: Option<String>,
    /// Conditions that the rows used meet, all of them.
    #[serde(default, rename = "where", skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<Condition>,
    /// Cells that mean missing, as well as empty ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<Missing>,
    /// Units of columns, where the header does not give them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
    /// File with the positions of targets on the skin, relative to the folder of the recipe: a table with the columns
    /// target, x and y (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positions: Option<PathBuf>,
}

/// A file joined to another, row by row or by time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joined {
    /// The file, relative to the folder of the recipe.
    pub file: PathBuf,
    /// Name in front of its columns; the stem of the file if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stem: Option<String>,
    /// Column of its time, without the stem; that of `data` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Largest time between partners; half the median interval of this file if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}
