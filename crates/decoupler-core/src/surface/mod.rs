//! Smooth surfaces through the nodes of an array.
//!
//! The positions of the nodes in (x, y) are fixed, so the interpolation is factored once per array and each frame is
//! one matrix-vector product. A [`SurfaceMap`] evaluates it on a [`Grid`]: as a thin-plate spline through a lattice or
//! through scattered nodes, as a curve where the nodes are on one line, bilinearly where neither is feasible. All of them
//! reproduce constants and planes, and none depends on the unit of length or the origin. [`Lattice`] finds the lines of a lattice among places in any order.

mod grid;
mod map;
mod scattered;

pub use grid::{Grid, Lattice};
pub use map::{Axis, Interpolation, SurfaceError, SurfaceMap};
