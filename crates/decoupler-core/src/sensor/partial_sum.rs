use std::ops::Range;

use glam::DVec3;

use super::SensorModel;

impl SensorModel {
    /// Sum of the reciprocal distances of Eq. (2) in 1/mm over some `nodes` of row-wire `row` and some `electrodes` of
    /// column-wire `column`: what is left of a reading where a wire is broken. `add_slope` is given every node with the
    /// derivatives of its part by x, y, z of its displacement, in 1/mm².
    pub(crate) fn partial_sum(
        &self,
        (row, nodes): (usize, Range<usize>),
        (column, electrodes): (usize, Range<usize>),
        displacements_mm: &[DVec3],
        mut add_slope: impl FnMut(usize, DVec3),
    ) -> f64 {
        let mut sum = 0.0;
        for node in nodes {
            let position_mm = self.displaced_mm(row, node, displacements_mm[node]);
            for electrode in electrodes.clone() {
                let apart_mm = position_mm - self.geometry.column_node_mm(column, electrode);
                let reciprocal = apart_mm.length().recip();
                sum += reciprocal;
                // z of a displacement counts downwards.
                let slope = DVec3::new(-apart_mm.x, -apart_mm.y, apart_mm.z);
                add_slope(node, reciprocal.powi(3) * slope);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{Axes, RowConductance};

    #[test]
    fn parts_add_up_to_the_whole() {
        let model = SensorModel::new("3x4_3x12".parse().unwrap());
        let displacements_mm: Vec<DVec3> = (0..4)
            .map(|node| DVec3::new(0.1, -0.2, 0.2 * f64::from(node)))
            .collect();
        let mut whole = RowConductance::new(&model, Axes::Xyz);
        whole.evaluate(&model, 1, &displacements_mm);
        for column in 0..12 {
            let mut slopes = [DVec3::ZERO; 4];
            let mut part = |nodes, electrodes| {
                model.partial_sum((1, nodes), (column, electrodes), &displacements_mm, |node, slope| {
                    slopes[node] += slope;
                })
            };
            let sum = part(0..1, 0..3) + part(1..4, 0..2) + part(1..4, 2..3);
            assert!((sum / whole.sums()[column] - 1.0).abs() < 1e-13);
            for (unknown, slope) in slopes.iter().flat_map(|slope| slope.to_array()).enumerate() {
                assert!((slope - whole.derivatives(unknown)[column]).abs() < 1e-13);
            }
        }
    }
}
