use std::fmt;

use super::super::SensorModel;

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

    /// Number of parameters.
    pub(super) const COUNT: usize = Self::ALL.len();

    /// Unit of the value.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Resistivity => "ohm/mm",
            _ => "mm",
        }
    }

    /// Value in `model`, in [`Self::unit`].
    pub fn of(self, model: &SensorModel) -> f64 {
        *self.field(&mut model.clone())
    }

    /// Returns what a relative change of the parameter is in proportion to: the nominal value, or, for the x of the column
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
