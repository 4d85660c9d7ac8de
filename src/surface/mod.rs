//! Smooth surfaces through the nodes of an array.
//!
//! The positions of the nodes in (x, y) are fixed, so the interpolation is factored once per array and each frame is
//! one matrix-vector product. A [`SurfaceMap`] evaluates it on a [`Grid`]: as a biharmonic spline where that exists,
//! bilinearly elsewhere.

mod biharmonic;
mod bilinear;
mod error;
mod grid;
mod map;

pub use error::{Axis, SurfaceError};
pub use grid::Grid;
pub use map::{Interpolation, SurfaceMap};
