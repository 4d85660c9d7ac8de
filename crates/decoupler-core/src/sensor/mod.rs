//! The sensor: numbers and positions of wires and nodes, and the resistances of a deformation. Displacements and positions
//! are [`DVec3`], the double-precision vector of the crate `glam`.

mod array_scale;
mod calibration;
mod conductance;
mod fixed_point;
mod geometry;
mod identifiability;
mod reciprocal_distances;
mod resistance;

pub use array_scale::{ArrayScale, ArrayScaleError, LARGEST_COUNT};
pub use calibration::{
    CalibratedParameter, Calibration, CalibrationError, CalibrationWarning, ParameterStatus, PressLimits, PressedRow,
    SensorParameter,
};
pub use conductance::RowConductance;
pub use geometry::{Axes, Geometry, GeometryError};
pub use glam::DVec3;
pub use identifiability::{Identifiability, IdentifiabilityError, IdentifiabilityWarning, RowPair};
pub use resistance::{DEFAULT_RESISTIVITY_OHM_PER_MM, RelativeNoise, SensorError, SensorModel, short};
