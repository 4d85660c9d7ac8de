use super::LARGEST_ERROR;
use crate::{
    scene::{RowModel, Scene},
    sensor::{Axes, SensorModel},
};

/// Deformations with the same readings as another one, by symmetry: even exact readings do not determine which of them
/// is the true one.
///
/// The electrodes of a column-wire are evenly spaced, so readings stay the same if any nodes are mirrored about their
/// middle, or if two nodes of a row are exchanged. Mirrored nodes may be those of another row-wire, if rows are not
/// known. The same positions as nodes of another row-wire are the same answer.
#[derive(Clone, Debug)]
pub(super) struct Symmetry {
    model: SensorModel,
    axes: Axes,
    largest_shift_mm: f64,
    /// Row-wires among which that of a reading is searched; empty if it is known.
    searched: Vec<usize>,
}

/// Distance, relative to the height of the sensor, that changes no reading by more than rounding.
const SAME: f64 = 1e-12;

impl Symmetry {
    pub(super) fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Self {
        Self {
            model: *model,
            axes: scene.movement.axes(),
            largest_shift_mm: scene.movement.largest_shift_mm(),
            searched: match scene.rows.model() {
                RowModel::Each => Vec::new(),
                RowModel::Shared => rows.to_vec(),
            },
        }
    }

    /// Returns `true` if the deformation `unknowns_mm` of row-wire `row` has a twin within reach of the nodes.
    pub(super) fn has_twin(&self, row: usize, unknowns_mm: &[f64]) -> bool {
        // Readings of electrodes with the same x depend only on the distance from it, which combines height and x.
        let only_distances = self.searched.len() > 1 && self.model.scale.nodes_per_column() == 1;
        only_distances
            || self.is_mirrored(row, unknowns_mm)
            || self.axes == Axes::Xyz && self.is_exchanged(unknowns_mm.as_chunks::<3>().0)
    }

    /// Distance within which positions are the same.
    fn same_mm(&self) -> f64 {
        f64::max(
            LARGEST_ERROR * 2.0 * self.largest_shift_mm,
            SAME * self.model.geometry.height_mm,
        )
    }

    fn is_mirrored(&self, row: usize, unknowns_mm: &[f64]) -> bool {
        let geometry = &self.model.geometry;
        let electrodes = (self.model.scale.nodes_per_column() - 1) as f64;
        // Lengths are relative to the row-wire.
        let middle_mm = (geometry.column_node_x0_mm - geometry.row_x0_mm)
            + (0.5 * geometry.column_node_pitch_mm * electrodes - geometry.row_pitch_mm * row as f64);
        let same_mm = self.same_mm();
        let x_mm = |node: &[f64]| if self.axes == Axes::Xyz { node[0] } else { 0.0 };
        let is_twin = |&other: &usize| {
            let apart_mm = geometry.row_pitch_mm * (other as f64 - row as f64);
            let is_within = |x_mm: f64| (x_mm - apart_mm).abs() <= self.largest_shift_mm + same_mm;
            let mut is_another = false;
            unknowns_mm.chunks_exact(self.axes.count()).map(x_mm).all(|x_mm| {
                let mirrored_mm = 2.0 * middle_mm - x_mm;
                let may_be_mirrored = is_within(mirrored_mm);
                is_another |= may_be_mirrored && (mirrored_mm - x_mm).abs() > same_mm;
                may_be_mirrored || is_within(x_mm)
            }) && is_another
        };
        match &self.searched[..] {
            [] => is_twin(&row),
            searched => searched.iter().any(is_twin),
        }
    }

    /// Returns `true` if two nodes may take each other's positions.
    fn is_exchanged(&self, nodes: &[[f64; 3]]) -> bool {
        let is_within = |shift_mm: f64| shift_mm.abs() <= self.largest_shift_mm;
        (1..nodes.len()).any(|apart| {
            let distance_mm = self.model.geometry.node_pitch_mm * apart as f64;
            distance_mm <= 2.0 * self.largest_shift_mm
                && nodes.iter().zip(&nodes[apart..]).any(|(a, b)| {
                    let to = [b[0], b[1] + distance_mm, b[2]];
                    is_within(to[1])
                        && is_within(a[1] - distance_mm)
                        && a.iter().zip(to).any(|(a, to)| (a - to).abs() > self.same_mm())
                })
        })
    }
}
