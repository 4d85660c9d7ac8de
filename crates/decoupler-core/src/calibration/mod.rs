//! Calibration: geometry and resistivity of Eq. (2), fitted to the readings of known deformations.
//!
//! [`Calibration::fit`] minimises the squared relative errors of the readings by the Levenberg-Marquardt method with
//! analytic derivatives. Parameters that the readings cannot determine keep their nominal values and are reported as
//! such. [`check_presses`] refuses samples that no press can produce, before a calibration or a training uses
//! them.

mod equations;
mod fit;
mod limits;

pub use fit::Calibration;
pub use limits::check_presses;

use std::fmt;

use glam::DVec3;
use strum::VariantArray;
use thiserror::Error;

use crate::{
    dataset::Dataset,
    sensor::{SensorError, SensorModel, short},
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

/// Parameter of the sensor model that readings depend on.
///
/// Only differences of coordinates matter, so the x of the first row-wire is the origin and stays, and the y of the first
/// column-wire cancels: rows are centred over the column-wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, strum::Display, strum::VariantArray)]
pub enum SensorParameter {
    /// Distance of the undeformed row-wires above the column-wires.
    #[strum(to_string = "height")]
    Height,
    /// Distance between row-wires.
    #[strum(to_string = "row pitch")]
    RowPitch,
    /// Distance between the nodes on a row-wire.
    #[strum(to_string = "node pitch")]
    NodePitch,
    /// Distance between column-wires.
    #[strum(to_string = "column pitch")]
    ColumnPitch,
    /// x of the first node on each column-wire.
    #[strum(to_string = "x of the first column node")]
    ColumnNodeX,
    /// Distance between the nodes on a column-wire.
    #[strum(to_string = "column node pitch")]
    ColumnNodePitch,
    /// Resistance per millimetre of rubber, g.
    #[strum(to_string = "resistance per millimetre")]
    Resistivity,
}

impl SensorParameter {
    /// Every parameter.
    pub const ALL: [Self; 7] = *Self::VARIANTS.as_array().expect("there are seven");

    /// Index in [`Self::ALL`].
    fn index(self) -> usize {
        self as usize
    }

    /// Unit of the value.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Resistivity => "ohm/mm",
            _ => "mm",
        }
    }

    /// Value in `model`, in [`Self::unit`].
    pub fn of(self, model: &SensorModel) -> f64 {
        *self.field(&mut { *model })
    }

    /// Returns the reference for relative changes of the parameter: the nominal value, or, for the x of the column
    /// nodes, which may be 0 or far from any origin, the nominal distance between them.
    pub fn reference(self, nominal: &SensorModel) -> f64 {
        match self {
            Self::ColumnNodeX => nominal.geometry.column_node_pitch_mm,
            _ => self.of(nominal),
        }
    }

    fn field(self, model: &mut SensorModel) -> &mut f64 {
        let geometry = &mut model.geometry;
        match self {
            Self::Height => &mut geometry.height_mm,
            Self::RowPitch => &mut geometry.row_pitch_mm,
            Self::NodePitch => &mut geometry.node_pitch_mm,
            Self::ColumnPitch => &mut geometry.column_pitch_mm,
            Self::ColumnNodeX => &mut geometry.column_node_x0_mm,
            Self::ColumnNodePitch => &mut geometry.column_node_pitch_mm,
            Self::Resistivity => &mut model.resistivity_ohm_per_mm,
        }
    }
}

/// A parameter of a calibrated sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedParameter {
    /// The parameter.
    pub parameter: SensorParameter,
    /// Value before calibration, in the parameter's unit.
    pub nominal: f64,
    /// Value of the fitted model.
    pub value: f64,
    /// If the readings determine it: the true value is within ± this, in the parameter's unit. The intervals of all
    /// parameters together hold with 95 % confidence (Bonferroni), given readings that follow Eq. (2). `None` if they do not
    /// determine it to ±10 %: it keeps its nominal value.
    pub half_width: Option<f64>,
}

impl fmt::Display for CalibratedParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (parameter, value, nominal) = (self.parameter, self.value, short(self.nominal));
        let unit = parameter.unit();
        let Some(half_width) = self.half_width else {
            return write!(
                f,
                "{parameter}: {nominal} {unit}, its nominal value: these readings do not determine it"
            );
        };
        // Two digits of the interval, and the value to the same decimal place.
        let digits = (1.0 - half_width.log10().floor()).clamp(0.0, 12.0) as usize;
        write!(
            f,
            "{parameter}: {value:.digits$} ± {half_width:.digits$} {unit} (nominal {nominal})"
        )
    }
}

#[cfg(test)]
mod tests;
