//! The sensor: how many wires and nodes, where they are, and what resistance a deformation gives.

mod array_scale;
mod geometry;
mod resistance;

pub use array_scale::{ArrayScale, ArrayScaleError, LARGEST_COUNT};
pub use geometry::{Geometry, GeometryError};
pub use resistance::{DEFAULT_RESISTIVITY_OHM_PER_MM, SensorError, SensorModel};
