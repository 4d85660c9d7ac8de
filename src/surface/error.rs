//! What can be wrong with the places of the nodes.

use std::fmt;

/// The axis whose coordinates were at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Along x, one coordinate per row-wire.
    X,
    /// Along y, one coordinate per node of a row.
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

/// Why no surface can be laid through the nodes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// An axis without coordinates.
    #[error("a surface needs at least one {axis} coordinate, and none was given")]
    NoNodes {
        /// The empty axis.
        axis: Axis,
    },
    /// NaN or infinity.
    #[error("{axis} coordinate {index} is {value_mm} mm; every node needs a finite place")]
    NotFinite {
        /// The axis at fault.
        axis: Axis,
        /// Position in the coordinates given.
        index: usize,
        /// The value found, in millimetres.
        value_mm: f64,
    },
    /// Two nodes in one place: the surface would have two heights there.
    #[error("{axis} coordinates {first} and {second} coincide at {value_mm} mm; nodes need places of their own")]
    Duplicate {
        /// The axis at fault.
        axis: Axis,
        /// Position of one of the two in the coordinates given.
        first: usize,
        /// Position of the other.
        second: usize,
        /// The place they share, in millimetres.
        value_mm: f64,
    },
}
