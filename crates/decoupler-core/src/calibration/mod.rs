//! Calibration: geometry and resistivity of Eq. (2), fitted to the readings of known deformations.
//!
//! [`Calibration::fit`] minimises the squared relative errors of the readings by the Levenberg-Marquardt method with
//! analytic derivatives. Parameters that the readings cannot determine keep their nominal values and are reported as
//! such. [`check_presses`] refuses samples that no press can produce, before a calibration or a training uses
//! them.

mod equations;
mod fit;
mod limits;
mod parameter;
mod warning;

pub use fit::Calibration;
pub use limits::check_presses;
pub use parameter::{CalibratedParameter, SensorParameter};

use glam::DVec3;
use thiserror::Error;

use crate::{
    dataset::Dataset,
    sensor::{SensorError, SensorModel},
    text::counted,
};

/// Readings of one row-wire under a known deformation.
#[derive(Clone)]
struct PressedRow {
    /// Frame that it belongs to; equal numbers mean the same moment.
    frame: usize,
    /// Row-wire, from 0.
    row: usize,
    /// Displacement of each node (M2), z counting downwards.
    displacements_mm: Vec<DVec3>,
    /// Resistance to each column-wire (M4).
    resistances_ohm: Vec<f64>,
}

impl PressedRow {
    /// Returns the samples of `set`, with the rest positions of `sensor`.
    fn of(set: &Dataset, sensor: &SensorModel) -> Result<Vec<Self>, CalibrationError> {
        assert_eq!(
            set.outputs(),
            sensor.scale.coordinates_per_row(),
            "targets are coordinates of the row's nodes"
        );
        let pressed = |sample: usize| {
            let row = set.row_wire(sample).ok_or(CalibrationError::NoRowWires)?;
            let position = |(node, mm): (usize, &[f64])| sensor.displacement_mm(row, node, DVec3::from_slice(mm));
            let positions = set.sample_targets(sample).chunks_exact(3).enumerate();
            Ok(Self {
                frame: set.groups()[sample],
                row,
                displacements_mm: positions.map(position).collect(),
                resistances_ohm: set.sample_readings(sample).to_vec(),
            })
        };
        (0..set.samples()).map(pressed).collect()
    }
}

/// Reason why a sensor cannot be calibrated.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The nominal sensor is impossible.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The samples have no row-wires.
    #[error("samples of a simulated sensor need a row-wire: build the set with row-wires, or declare it as measured")]
    NoRowWires,
    /// A sample does not belong to the array, or no press can produce it.
    #[error("sample {}{fault}", .sample + 1)]
    Sample {
        /// Index of the sample, from 0.
        sample: usize,
        /// Place in the sample, what is wrong there, and the remedy.
        fault: String,
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

impl CalibrationError {
    /// Index of the sample at fault, from 0; `None` if the error is not about a single sample.
    pub fn sample(&self) -> Option<usize> {
        match *self {
            Self::Sample { sample, .. } => Some(sample),
            Self::Sensor(_) | Self::NoRowWires | Self::OneRow { .. } | Self::TooFew { .. } | Self::NotConverged => None,
        }
    }
}

#[cfg(test)]
mod tests;
