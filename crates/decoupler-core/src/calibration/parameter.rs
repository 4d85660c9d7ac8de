use std::fmt;

use crate::sensor::{SensorModel, short};

/// Parameter of the sensor model that readings depend on.
///
/// Only differences of coordinates matter, so the x of the first row-wire is the origin and stays, and the y of the first
/// column-wire cancels: rows are centred over the column-wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SensorParameter {
    /// Distance of the undeformed row-wires above the column-wires.
    Height,
    /// Distance between row-wires.
    RowPitch,
    /// Distance between the nodes on a row-wire.
    NodePitch,
    /// Distance between column-wires.
    ColumnPitch,
    /// x of the first node on each column-wire.
    ColumnNodeX,
    /// Distance between the nodes on a column-wire.
    ColumnNodePitch,
    /// Resistance per millimetre of rubber, g.
    Resistivity,
}

impl SensorParameter {
    /// Every parameter.
    pub const ALL: [Self; 7] = [
        Self::Height,
        Self::RowPitch,
        Self::NodePitch,
        Self::ColumnPitch,
        Self::ColumnNodeX,
        Self::ColumnNodePitch,
        Self::Resistivity,
    ];

    /// Index in [`Self::ALL`].
    pub(super) fn index(self) -> usize {
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

    pub(super) fn field(self, model: &mut SensorModel) -> &mut f64 {
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

impl fmt::Display for SensorParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Height => "height",
            Self::RowPitch => "row pitch",
            Self::NodePitch => "node pitch",
            Self::ColumnPitch => "column pitch",
            Self::ColumnNodeX => "x of the first column node",
            Self::ColumnNodePitch => "column node pitch",
            Self::Resistivity => "resistance per millimetre",
        })
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
