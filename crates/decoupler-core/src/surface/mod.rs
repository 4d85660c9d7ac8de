//! Smooth surfaces through the nodes of an array.
//!
//! The positions of the nodes in (x, y) are fixed, so the interpolation is factored once per array and each frame is one
//! matrix-vector product. A [`SurfaceMap`] evaluates it on a [`Grid`]: as a thin-plate spline through a lattice or
//! scattered nodes, as a curve if the nodes are on one line, or bilinearly if neither is feasible. All of them reproduce
//! constants and planes, and none depends on the unit of length or the origin. A lattice
//! is detected among points in any order.

mod grid;
mod lattice;
mod map;
mod scattered;
mod spline;

pub use grid::Grid;
pub(crate) use lattice::lattice;
pub use map::SurfaceMap;

/// Error in the coordinates of the nodes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// An axis has no coordinates.
    #[error("a surface needs at least one {axis} coordinate, and none was given")]
    NoNodes {
        /// The empty axis: x or y.
        axis: &'static str,
    },
    /// A coordinate is NaN, infinite, or so large that distances would overflow.
    #[error("{axis} coordinate {index} is {value_mm:?} mm; nodes need finite coordinates within ±1e300 mm")]
    NotFinite {
        /// Axis of the invalid coordinates: x or y.
        axis: &'static str,
        /// Index in the given coordinates.
        index: usize,
        /// Value found, in millimetres.
        value_mm: f64,
    },
    /// Two coordinates coincide, so that the surface would have two heights, or are too close to place points between
    /// them.
    #[error("{axis} coordinates {first} and {second} coincide at {value_mm:?} mm; nodes need distinct positions")]
    Duplicate {
        /// Axis of the invalid coordinates: x or y.
        axis: &'static str,
        /// Index of the first in the given coordinates.
        first: usize,
        /// Index of the second.
        second: usize,
        /// Common coordinate in millimetres.
        value_mm: f64,
    },
    /// Two scattered nodes coincide, so that the surface would have two heights.
    #[error("nodes {first} and {second} coincide; nodes need distinct positions")]
    SamePlace {
        /// Index of the first in the given points.
        first: usize,
        /// Index of the second.
        second: usize,
    },
    /// Scattered nodes are on one line.
    #[error("all nodes are on one line, oblique to x and y; a surface needs nodes on both sides of it")]
    OnOneLine,
    /// There are too many scattered nodes for a spline.
    #[error("{count} scattered nodes are too many; a surface can have at most {most}, or a lattice of any size")]
    TooMany {
        /// Number of nodes.
        count: usize,
        /// Maximum number.
        most: usize,
    },
    /// Some scattered nodes are much closer to each other than to the rest.
    #[error(
        "a surface through the nodes would overshoot a thousandfold; leave out one of the nodes that nearly coincide"
    )]
    Uneven,
}
