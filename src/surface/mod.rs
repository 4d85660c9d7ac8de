//! Smooth surfaces through the nodes: what is drawn between the electrodes.
//!
//! The nodes of a sensor never leave their place in (x, y), so the interpolation is factored once per array and a
//! frame is one matrix-vector product, whatever the heights.

mod biharmonic;
mod bilinear;
mod error;
mod grid;
mod map;

pub use error::{Axis, SurfaceError};
pub use grid::Grid;
pub use map::{Interpolation, SurfaceMap};
