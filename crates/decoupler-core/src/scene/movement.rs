use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::SceneError;
use crate::sensor::Axes;

/// Movement of the nodes, which sets the unknowns of each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Movement {
    /// Down only, as in the paper.
    #[default]
    Z,
    /// Down, and sideways by up to `largest_shift_mm` along x and along y.
    Xyz {
        /// The largest shift along x, and along y, either way.
        largest_shift_mm: f64,
    },
}

impl fmt::Display for Movement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Z => "z",
            Self::Xyz { .. } => "xyz",
        })
    }
}

impl FromStr for Movement {
    type Err = SceneError;

    /// Reads `z` or `xyz`.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        match text.trim() {
            "z" => Ok(Self::Z),
            "xyz" => Ok(Self::SIDEWAYS),
            _ => Err(SceneError::AxesText(text.to_owned())),
        }
    }
}

impl Movement {
    /// Sideways too, by up to a fifth of a millimetre: a tenth of the assumed node pitch.
    pub const SIDEWAYS: Self = Self::Xyz { largest_shift_mm: 0.2 };

    /// The unknown coordinates.
    pub fn axes(self) -> Axes {
        match self {
            Self::Z => Axes::Z,
            Self::Xyz { .. } => Axes::Xyz,
        }
    }

    /// The largest shift sideways.
    pub fn largest_shift_mm(self) -> f64 {
        match self {
            Self::Z => 0.0,
            Self::Xyz { largest_shift_mm } => largest_shift_mm,
        }
    }

    pub(super) fn check(self) -> Result<(), SceneError> {
        match self {
            Self::Xyz {
                largest_shift_mm: shift,
            } if !(shift > 0.0 && shift.is_finite()) => Err(SceneError::Shift(shift)),
            _ => Ok(()),
        }
    }
}
