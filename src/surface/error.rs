//! Errors in the coordinates of the nodes.

use std::fmt;

/// Axis of the coordinates at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The x axis, with one coordinate per row-wire.
    X,
    /// The y axis, with one coordinate per node of a row.
    Y,
}

impl fmt::Display for Axis {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
        })
    }
}

/// Error in the coordinates of the nodes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// An axis has no coordinates.
    #[error("a surface needs at least one {axis} coordinate, and none was given")]
    NoNodes {
        /// The empty axis.
        axis: Axis,
    },
    /// A coordinate is NaN or infinite.
    #[error("{axis} coordinate {index} is {value_mm:?} mm; every node needs a finite place")]
    NotFinite {
        /// Axis at fault.
        axis: Axis,
        /// Index in the coordinates given.
        index: usize,
        /// Value found, in millimetres.
        value_mm: f64,
    },
    /// Two coordinates coincide, where the surface would have two heights.
    #[error("{axis} coordinates {first} and {second} coincide at {value_mm:?} mm; nodes need places of their own")]
    Duplicate {
        /// Axis at fault.
        axis: Axis,
        /// Index of the first in the coordinates given.
        first: usize,
        /// Index of the second.
        second: usize,
        /// Coordinate that they share, in millimetres.
        value_mm: f64,
    },
}
