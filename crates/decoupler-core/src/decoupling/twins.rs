use super::newton_report::LARGEST_ERROR;
use crate::{
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// Deformations of a row-wire that give the same readings as another one, by symmetry: the readings do not determine which of
/// them is the true one, however exact they are.
///
/// The electrodes of a column-wire are evenly spaced, so a node may be mirrored at their middle; and two nodes may change
/// places. Either needs nodes that move so far sideways.
#[derive(Clone, Debug)]
pub(super) struct Twins {
    model: SensorModel,
    axes: Axes,
    largest_shift_mm: f64,
}

impl Twins {
    pub(super) fn new(model: &SensorModel, scene: &Scene) -> Self {
        Self {
            model: *model,
            axes: scene.movement.axes(),
            largest_shift_mm: scene.movement.largest_shift_mm(),
        }
    }

    /// Returns `true` if the deformation `unknowns_mm` of row-wire `row` has a twin within reach of the nodes.
    pub(super) fn has(&self, row: usize, unknowns_mm: &[f64]) -> bool {
        if self.axes == Axes::Z {
            return false;
        }
        let nodes = unknowns_mm.as_chunks::<3>().0;
        nodes.iter().any(|&[x, ..]| self.is_mirrored(row, x))
            || (1..nodes.len()).any(|apart| {
                let pairs = nodes.iter().zip(&nodes[apart..]);
                self.model.geometry.node_pitch_mm * apart as f64 <= 2.0 * self.largest_shift_mm
                    && pairs.into_iter().any(|(a, b)| self.is_exchanged(apart, *a, *b))
            })
    }

    fn is_within(&self, shift_mm: f64) -> bool {
        shift_mm.abs() <= self.largest_shift_mm
    }

    fn is_apart(&self, a_mm: f64, b_mm: f64) -> bool {
        (a_mm - b_mm).abs() > LARGEST_ERROR * 2.0 * self.largest_shift_mm
    }

    fn is_mirrored(&self, row: usize, x_mm: f64) -> bool {
        let geometry = &self.model.geometry;
        let electrodes = (self.model.scale.nodes_per_column() - 1) as f64;
        let middle_mm = (geometry.column_node_x0_mm - geometry.row_x0_mm)
            + (0.5 * geometry.column_node_pitch_mm * electrodes - geometry.row_pitch_mm * row as f64);
        let mirrored_mm = 2.0 * middle_mm - x_mm;
        self.is_within(mirrored_mm) && self.is_apart(mirrored_mm, x_mm)
    }

    /// Returns `true` if node `a` may take the place of node `b`, `apart` places on, and the other way round.
    fn is_exchanged(&self, apart: usize, a: [f64; 3], b: [f64; 3]) -> bool {
        let distance_mm = self.model.geometry.node_pitch_mm * apart as f64;
        let differs = self.is_apart(a[0], b[0]) || self.is_apart(a[1], b[1] + distance_mm) || self.is_apart(a[2], b[2]);
        self.is_within(b[1] + distance_mm) && self.is_within(a[1] - distance_mm) && differs
    }
}
