//! Smooth surfaces through the nodes of an array.
//!
//! The positions of the nodes in (x, y) are fixed, so the interpolation is factored once per array and each frame is one
//! matrix-vector product. A [`SurfaceMap`] evaluates it on a [`Grid`]: as a thin-plate spline through a lattice or
//! scattered nodes, as a curve if the nodes are on one line, or bilinearly if neither is feasible. All of them reproduce
//! constants and planes, and none depends on the unit of length or the origin. A lattice
//! is detected among points in any order.

mod error;
mod grid;
mod lattice;
mod map;
mod scattered;
mod spline;

pub use error::SurfaceError;
pub use grid::Grid;
pub(crate) use lattice::lattice;
pub use map::SurfaceMap;
