//! The sensor: how many wires and nodes, where they are, and what resistance a deformation gives.

mod array_scale;
mod axes;
mod conductance;
mod geometry;
mod identifiability;
mod reciprocal_distances;
mod resistance;

pub use array_scale::{ArrayScale, ArrayScaleError, LARGEST_COUNT};
pub use axes::Axes;
pub use conductance::RowConductance;
pub use geometry::{Geometry, GeometryError};
pub use identifiability::{Identifiability, IdentifiabilityError, IdentifiabilityWarning, RowPair};
pub use resistance::{DEFAULT_RESISTIVITY_OHM_PER_MM, SensorError, SensorModel};
