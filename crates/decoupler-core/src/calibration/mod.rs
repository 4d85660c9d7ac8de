//! Calibration: geometry and resistivity of Eq. (2), fitted to the readings of known deformations.
//!
//! [`Calibration::fit`] minimises the squared relative errors of the readings by the Levenberg-Marquardt method with
//! analytic derivatives. What the readings cannot determine stays at its nominal value, and is said to.
//! [`PressLimits::check`] refuses samples that no press can give, before a calibration or a training on them.

mod equations;
mod error;
mod fit;
mod report;
#[cfg(test)]
mod tests;

pub use equations::PressLimits;
pub use error::CalibrationError;
pub use report::{CalibratedParameter, Calibration, CalibrationWarning, ParameterStatus, SensorParameter};

use crate::sensor::DVec3;

/// Readings of one row-wire under a known deformation.
#[derive(Clone, Debug, PartialEq)]
pub struct PressedRow {
    /// Frame that it belongs to; equal numbers mean the same moment.
    pub frame: usize,
    /// Row-wire, from 0.
    pub row: usize,
    /// Displacement of each node (M2), z counting downwards.
    pub displacements_mm: Vec<DVec3>,
    /// Resistance to each column-wire (M4).
    pub resistances_ohm: Vec<f64>,
}
