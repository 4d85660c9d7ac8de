//! The sensor: number and positions of wires and nodes, and the resistances for a deformation. Displacements and
//! positions are [`DVec3`](glam::DVec3), the double-precision vector of the crate `glam`.

mod array_scale;
mod conductance;
mod geometry;
mod resistance;
#[cfg(test)]
mod rounding;

pub use array_scale::{ArrayScale, LARGEST_COUNT};
pub(crate) use conductance::RowConductance;
pub use geometry::{Axes, Geometry};
pub use resistance::{DEFAULT_RESISTIVITY_OHM_PER_MM, RelativeNoise, SensorError, SensorModel, short};
