use glam::DVec3;

use super::{Axes, SensorModel, reciprocal_distances::sum_reciprocal_distances};

/// The sums `s_k = Σ_i Σ_j 1/d` of Eq. (2) for one row-wire, so that `R_k = g / s_k`, and their derivatives by what
/// moves. Kept between evaluations so that none allocates.
///
/// Conductance is what a solver wants: it is a plain sum over nodes, hence much closer to linear than resistance.
#[derive(Clone, Debug, PartialEq)]
pub struct RowConductance {
    axes: Axes,
    columns: usize,
    /// s_k in 1/mm: M4.
    sums: Vec<f64>,
    /// ∂s_k/∂u in 1/mm²: unknown by unknown (node by node, each node's axes together), each M4 long.
    derivatives: Vec<f64>,
}

impl RowConductance {
    /// Room for the row-wires of `model` whose nodes move along `axes`.
    pub fn new(model: &SensorModel, axes: Axes) -> Self {
        let columns = model.scale.columns();
        Self {
            axes,
            columns,
            sums: vec![0.0; columns],
            derivatives: vec![0.0; columns * model.scale.nodes_per_row() * axes.count()],
        }
    }

    /// Along which axes the nodes move.
    pub fn axes(&self) -> Axes {
        self.axes
    }

    /// s_k, M4 of them, in 1/mm.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Derivatives of every s_k by one unknown, M4 of them, in 1/mm².
    pub fn derivatives(&self, unknown: usize) -> &[f64] {
        &self.derivatives[unknown * self.columns..(unknown + 1) * self.columns]
    }

    /// Evaluates sums and derivatives of row-wire `row` whose nodes are displaced by `displacements_mm` (M2 of them).
    ///
    /// # Panics
    /// If there are not M2 displacements.
    pub fn evaluate(&mut self, model: &SensorModel, row: usize, displacements_mm: &[DVec3]) {
        assert_eq!(displacements_mm.len(), model.scale.nodes_per_row());
        let (sums, derivatives) = (&mut self.sums[..], &mut self.derivatives[..]);
        let sensor = (model.scale, &model.geometry);
        match self.axes {
            Axes::Z => sum_reciprocal_distances::<1>(sensor, row, displacements_mm, sums, derivatives),
            Axes::Xyz => sum_reciprocal_distances::<3>(sensor, row, displacements_mm, sums, derivatives),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Jacobian of [`SensorModel`] is checked against central differences; R = g/s relates the two.
    #[test]
    fn sums_and_derivatives_are_those_of_the_resistances() {
        for scale in ["10x6_3x18", "3x2_1x7"] {
            let model = SensorModel::new(scale.parse().unwrap());
            let nodes = model.scale.nodes_per_row();
            let at: Vec<DVec3> = (0..nodes)
                .map(|i| DVec3::new(0.1 * i as f64, -0.05, 0.13 * i as f64))
                .collect();
            let resistances = model.row_resistances(2, &at).unwrap();
            let jacobian = model.row_jacobian(2, &at).unwrap();
            for axes in [Axes::Z, Axes::Xyz] {
                let mut row = RowConductance::new(&model, axes);
                row.evaluate(&model, 2, &at);
                for (column, (&sum, &ohm)) in row.sums().iter().zip(&resistances).enumerate() {
                    assert!((model.resistivity_ohm_per_mm / sum / ohm - 1.0).abs() < 1e-14);
                    for node in 0..nodes {
                        for (place, &axis) in axes.indices().iter().enumerate() {
                            let slope = row.derivatives(node * axes.count() + place)[column];
                            let of_resistance = -model.resistivity_ohm_per_mm / (sum * sum) * slope;
                            let expected = jacobian[[column, node, axis]];
                            // ∂R/∂u = −g/s² ∂s/∂u.
                            assert!(
                                (of_resistance - expected).abs() < 1e-12 * ohm,
                                "{of_resistance} {expected}"
                            );
                        }
                    }
                }
            }
        }
    }
}
