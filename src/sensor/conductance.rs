use glam::DVec3;

use super::{Axes, SensorModel};

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
    /// With d² = dx² + dy² + z²: ∂(1/d)/∂ux = −dx/d³, ∂(1/d)/∂uy = −dy/d³ and, uz counting downwards,
    /// ∂(1/d)/∂uz = z/d³.
    ///
    /// # Panics
    /// If there are not M2 displacements.
    pub fn evaluate(&mut self, model: &SensorModel, row: usize, displacements_mm: &[DVec3]) {
        assert_eq!(displacements_mm.len(), model.scale.nodes_per_row());
        let axes = self.axes;
        let columns = self.columns;
        let (sums, derivatives) = (&mut self.sums[..], &mut self.derivatives[..]);
        pulp::Arch::new().dispatch(|| {
            sums.fill(0.0);
            derivatives.fill(0.0);
            let blocks = derivatives.chunks_exact_mut(columns * axes.count());
            for ((node, &displacement), block) in displacements_mm.iter().enumerate().zip(blocks) {
                let position = model.displaced_mm(row, node, displacement);
                match axes {
                    Axes::Z => add_node_z(model, position, sums, block),
                    Axes::Xyz => add_node_xyz(model, position, sums, block),
                }
            }
        });
    }
}

#[inline(always)]
fn add_node_z(model: &SensorModel, position: DVec3, sums: &mut [f64], by_z: &mut [f64]) {
    let (y0, pitch) = (model.geometry.column_y0_mm, model.geometry.column_pitch_mm);
    for j in 0..model.scale.nodes_per_column() {
        let dx = position.x - model.geometry.column_node_mm(0, j).x;
        let across2 = dx * dx + position.z * position.z;
        for (column, (sum, by_z)) in sums.iter_mut().zip(by_z.iter_mut()).enumerate() {
            let dy = position.y - (y0 + pitch * column as f64);
            let inverse = 1.0 / (across2 + dy * dy).sqrt();
            *sum += inverse;
            *by_z += position.z * (inverse * inverse * inverse);
        }
    }
}

#[inline(always)]
fn add_node_xyz(model: &SensorModel, position: DVec3, sums: &mut [f64], derivatives: &mut [f64]) {
    let (y0, pitch) = (model.geometry.column_y0_mm, model.geometry.column_pitch_mm);
    let (by_x, rest) = derivatives.split_at_mut(sums.len());
    let (by_y, by_z) = rest.split_at_mut(sums.len());
    for j in 0..model.scale.nodes_per_column() {
        let dx = position.x - model.geometry.column_node_mm(0, j).x;
        let across2 = dx * dx + position.z * position.z;
        let of_axes = by_x.iter_mut().zip(by_y.iter_mut()).zip(by_z.iter_mut());
        for (column, (sum, ((by_x, by_y), by_z))) in sums.iter_mut().zip(of_axes).enumerate() {
            let dy = position.y - (y0 + pitch * column as f64);
            let inverse = 1.0 / (across2 + dy * dy).sqrt();
            let cubed = inverse * inverse * inverse;
            *sum += inverse;
            *by_x -= dx * cubed;
            *by_y -= dy * cubed;
            *by_z += position.z * cubed;
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
