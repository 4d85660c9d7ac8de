//! Calibration: geometry and resistivity of Eq. (2), fitted to the readings of known deformations.
//!
//! [`Calibration::fit`] minimises the squared relative errors of the readings by the Levenberg-Marquardt method with
//! analytic derivatives. Parameters that the readings cannot determine keep their nominal values and are reported as
//! such. [`PressLimits::check`] refuses samples that no press can produce, before a calibration or a training uses
//! them.

mod equations;
mod fit;
mod limits;
mod parameter;
mod warning;

pub use fit::Calibration;
pub use limits::PressLimits;
pub use parameter::{CalibratedParameter, ParameterStatus, SensorParameter};
pub use warning::CalibrationWarning;

use thiserror::Error;

use crate::{
    sensor::{DVec3, SensorError, short},
    text::counted,
};

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

/// Reason why a sensor cannot be calibrated.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The nominal sensor is impossible.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The array has no such row-wire, or a row has the wrong number of nodes or readings.
    #[error("sample {}: {found} {what}, but the array {scale} has {expected}; give samples of this array", .sample + 1)]
    Shape {
        /// Index of the sample, from 0.
        sample: usize,
        /// Part at fault.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number expected.
        expected: usize,
        /// Name of the array scale.
        scale: String,
    },
    /// A reading is not a resistance.
    #[error(
        "sample {}, column {}: the reading {} is not a resistance; leave this sample out",
        .sample + 1, .column + 1, short(*.ohm)
    )]
    Reading {
        /// Index of the sample, from 0.
        sample: usize,
        /// Column-wire, from 0.
        column: usize,
        /// The reading.
        ohm: f64,
    },
    /// A displacement is not finite, or puts a node on or below the column-wires of the nominal sensor.
    #[error(
        "sample {}, node {}: this displacement puts the node on or below the column-wires; check the unit (mm, downwards \
         positive) and the height of the nominal sensor",
        .sample + 1, .node + 1
    )]
    Displacement {
        /// Index of the sample, from 0.
        sample: usize,
        /// Node on the row-wire, from 0.
        node: usize,
    },
    /// A displacement is upwards, or exceeds a limit.
    #[error(
        "sample {}, node {}: it is {direction} by {} mm, but {} {} mm is possible; correct it, or leave this sample out",
        .sample + 1, .node + 1, rounded(*.mm), .at_most, short(*.largest_mm)
    )]
    Press {
        /// Index of the sample, from 0.
        sample: usize,
        /// Node on the row-wire, from 0.
        node: usize,
        /// Direction of the displacement.
        direction: &'static str,
        /// Displacement.
        mm: f64,
        /// Words for the range up to the largest displacement.
        at_most: &'static str,
        /// Largest possible displacement.
        largest_mm: f64,
    },
    /// A reading is implausible compared with the others.
    #[error(
        "sample {}, column {}: the reading {} ohm is implausible: the sensor model and the other readings suggest \
         {} ohm; correct it, or leave this sample out",
        .sample + 1, .column + 1, short(*.ohm), rounded(*.expected_ohm)
    )]
    Absurd {
        /// Index of the sample, from 0.
        sample: usize,
        /// Column-wire, from 0.
        column: usize,
        /// The reading.
        ohm: f64,
        /// Reading that the sensor model and the other readings suggest.
        expected_ohm: f64,
    },
    /// All samples are of one row-wire, which does not separate the pitch of the row-wires from the position of the
    /// columns.
    #[error(
        "all samples are of row-wire {}: its position cannot be separated from that of the column-wires; give presses on at \
         least two row-wires, or on the first",
        .row + 1
    )]
    OneRow {
        /// The row-wire, from 0.
        row: usize,
    },
    /// There are fewer readings than parameters, or none.
    #[error("too few readings ({readings}) to fit {}; give more frames", counted(*.parameters, "parameter"))]
    TooFew {
        /// Number of readings.
        readings: usize,
        /// Number of parameters.
        parameters: usize,
    },
    /// The fit did not converge.
    #[error(
        "the fit did not converge: the readings do not follow Eq. (2) from this nominal geometry; check the array scale, the \
         order of the wires, and that displacements are in millimetres"
    )]
    NotConverged,
}

/// Formats as [`short`] does, with four significant digits.
fn rounded(value: f64) -> String {
    let digits = format!("{value:.3e}");
    digits.parse().map_or(digits, short)
}

impl CalibrationError {
    /// Index of the sample at fault, from 0; `None` if the error is not about a single sample.
    pub fn sample(&self) -> Option<usize> {
        match *self {
            Self::Shape { sample, .. }
            | Self::Reading { sample, .. }
            | Self::Displacement { sample, .. }
            | Self::Press { sample, .. }
            | Self::Absurd { sample, .. } => Some(sample),
            Self::Sensor(_) | Self::OneRow { .. } | Self::TooFew { .. } | Self::NotConverged => None,
        }
    }
}

#[cfg(test)]
mod tests;
