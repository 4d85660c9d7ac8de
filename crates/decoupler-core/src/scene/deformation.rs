use glam::DVec3;
use ndarray::Array2;

use crate::sensor::{ArrayScale, SensorModel};

/// Displacement of each upper node at one moment, in millimetres; z counts downwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    /// Row-wires × nodes on a row-wire, in standard (row-major) layout.
    displacement_mm: Array2<DVec3>,
}

impl Deformation {
    /// The deformation with `displacement_mm(row, node)` at every node.
    pub fn from_fn(scale: ArrayScale, mut displacement_mm: impl FnMut(usize, usize) -> DVec3) -> Self {
        let shape = (scale.rows(), scale.nodes_per_row());
        Self {
            displacement_mm: Array2::from_shape_fn(shape, |(row, node)| displacement_mm(row, node)),
        }
    }

    /// Displacements of the nodes of row-wire `row`, in millimetres.
    pub fn row_mm(&self, row: usize) -> &[DVec3] {
        let nodes = self.displacement_mm.ncols();
        let all = self.displacement_mm.as_slice().expect("built in standard layout");
        &all[row * nodes..(row + 1) * nodes]
    }

    /// Positions of the displaced nodes of row-wire `row`, in millimetres.
    pub fn row_positions_mm<'a>(&'a self, model: &'a SensorModel, row: usize) -> impl Iterator<Item = DVec3> + 'a {
        let displacements = self.row_mm(row).iter().enumerate();
        displacements.map(move |(node, &displacement)| model.displaced_mm(row, node, displacement))
    }
}
