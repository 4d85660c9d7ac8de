use faer::{Mat, Side, linalg::solvers::Solve};
use glam::DVec3;
use ndarray::Array2;

use super::{AffineLayer, Layer, LayeredMap, row_problem::Range};
use crate::{
    network::Quantity,
    sensor::{Axes, RowConductance, SensorModel},
};

/// Affine estimate of the compressions of a row-wire's nodes from its readings, of the least expected squared error if
/// every node is pressed independently and uniformly over the stroke: where to start to solve Eq. (2).
///
/// s_k is a sum over nodes. In x from −1 to 1 over the stroke, the part of a node is its mean plus
/// `a P₁(x) + b P₂(x) + c P₃(x)` with Legendre's polynomials, whose variances are 1/3, 1/5 and 1/7 and which are
/// uncorrelated. With A, B and C the coefficients of all nodes (readings × nodes), the estimate is
/// `Aᵀ/3 (A Aᵀ/3 + B Bᵀ/5 + C Cᵀ/7)⁻¹ (s − s̄)`.
#[derive(Clone, Debug)]
pub(super) struct AffineStart {
    middle_mm: f64,
    /// g/s̄ in ohm.
    means_ohm: Vec<f64>,
    /// Nodes × readings, in mm for a relative change of the conductance.
    gains_mm: Vec<f64>,
}

/// Variance that is added, in proportion to the sum of all, so that what no node moves has an inverse.
const SMALLEST_VARIANCE: f64 = 1e-13;

impl AffineStart {
    /// Memory of the estimate for one row-wire.
    pub(super) fn bytes(model: &SensorModel) -> usize {
        (model.scale.nodes_per_row() + 1) * model.scale.columns() * size_of::<f64>()
    }

    /// Computes the estimate for row-wire `row`; the middle of `stroke` if there is no inverse.
    pub(super) fn new(model: &SensorModel, row: usize, stroke: Range) -> Self {
        let (readings, nodes) = (model.scale.columns(), model.scale.nodes_per_row());
        let half_mm = 0.5 * stroke.width();
        // Gauss's rule of three points, exact to the fifth degree.
        let points = [
            (-(0.6_f64.sqrt()), 5.0 / 9.0),
            (0.0, 8.0 / 9.0),
            (0.6_f64.sqrt(), 5.0 / 9.0),
        ];
        let mut mean = vec![0.0; readings];
        // Legendre coefficients of the derivatives: those of the parts follow by integrating.
        let mut slopes = [0; 3].map(|_| Mat::<f64>::zeros(readings, nodes));
        let mut conductance = RowConductance::new(model, Axes::Z);
        for (x, weight) in points {
            let pressed = vec![DVec3::Z * (stroke.middle() + half_mm * x); nodes];
            conductance.evaluate(model, row, &pressed);
            for (mean, sum) in mean.iter_mut().zip(conductance.sums()) {
                *mean += 0.5 * weight * sum;
            }
            let polynomials = [0.5, 1.5 * x, 2.5 * (1.5 * x * x - 0.5)];
            for (slopes, polynomial) in slopes.iter_mut().zip(polynomials) {
                for node in 0..nodes {
                    for (reading, derivative) in conductance.derivatives(node).iter().enumerate() {
                        slopes[(reading, node)] += half_mm * weight * polynomial * derivative;
                    }
                }
            }
        }
        let relative = |of: &dyn Fn(usize, usize) -> f64| Mat::from_fn(readings, nodes, |k, i| of(k, i) / mean[k]);
        let a = relative(&|k, i| slopes[0][(k, i)] - slopes[2][(k, i)] / 5.0);
        let b = relative(&|k, i| slopes[1][(k, i)] / 3.0);
        let c = relative(&|k, i| slopes[2][(k, i)] / 5.0);
        let third = &a * faer::Scale(1.0 / 3.0);
        let mut variance = &third * a.transpose()
            + &b * faer::Scale(1.0 / 5.0) * b.transpose()
            + &c * faer::Scale(1.0 / 7.0) * c.transpose();
        let total: f64 = (0..readings).map(|k| variance[(k, k)]).sum();
        for k in 0..readings {
            variance[(k, k)] += SMALLEST_VARIANCE * total;
        }
        let gains = variance.llt(Side::Lower).ok().map(|factor| factor.solve(&third));
        let gain = |place: usize| {
            let (node, reading) = (place / readings, place % readings);
            gains.as_ref().map_or(0.0, |gains| half_mm * gains[(reading, node)])
        };
        Self {
            middle_mm: stroke.middle(),
            means_ohm: mean.iter().map(|mean| model.resistivity_ohm_per_mm / mean).collect(),
            gains_mm: (0..nodes * readings).map(gain).collect(),
        }
    }

    /// Describes the coordinates (3·M2) of the nodes of row-wire `row` at the estimate, before they are cut to the stroke.
    pub(super) fn description(&self, model: &SensorModel, row: usize) -> LayeredMap {
        let (readings, nodes) = (self.means_ohm.len(), model.scale.nodes_per_row());
        let middles = (0..nodes).flat_map(|node| model.displaced_mm(row, node, DVec3::Z * self.middle_mm).to_array());
        let weight = |(reading, coordinate): (usize, usize)| match coordinate % 3 {
            // z counts upwards, and (mean − R)/R is the mean times the change of the conductance.
            2 => -self.gains_mm[coordinate / 3 * readings + reading] * self.means_ohm[reading],
            _ => 0.0,
        };
        LayeredMap {
            quantity: Quantity::Conductance,
            centre: self.means_ohm.iter().map(|ohm| 1.0 / ohm).collect(),
            layers: vec![Layer::Affine(AffineLayer {
                weights: Array2::from_shape_fn((readings, 3 * nodes), weight),
                biases: middles.collect(),
            })],
        }
    }

    /// Writes the estimate for readings in ohm, before it is cut to the stroke.
    pub(super) fn estimate(&self, readings_ohm: &[f64], compressions_mm: &mut [f64]) {
        compressions_mm.fill(self.middle_mm);
        let readings = self.means_ohm.len();
        for (compression, gains) in compressions_mm.iter_mut().zip(self.gains_mm.chunks_exact(readings)) {
            let parts = gains.iter().zip(readings_ohm).zip(&self.means_ohm);
            *compression += parts.map(|((gain, ohm), mean)| gain * (mean - ohm) / ohm).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        scene::Scene,
    };

    /// The mean distance of the middle from a uniform compression is a quarter of the stroke.
    #[test]
    fn the_estimate_is_within_a_few_thousandths_of_the_stroke() {
        for array in ["10x6_3x18", "10x10_5x30", "2x1_1x3"] {
            let model = SensorModel::new(array.parse().unwrap());
            let rows = model.scale.rows();
            let set = Dataset::simulate(&model, &Scene::default(), 30 * rows, &mut Seed(0).rng(Stream::Test)).unwrap();
            let stroke = Range {
                lowest: 0.0,
                highest: 1.0,
            };
            let starts: Vec<AffineStart> = (0..rows).map(|row| AffineStart::new(&model, row, stroke)).collect();
            let mut errors_mm = 0.0;
            let mut estimate_mm = vec![0.0; model.scale.nodes_per_row()];
            for sample in 0..set.samples() {
                starts[set.row_index(sample)].estimate(set.sample_readings(sample), &mut estimate_mm);
                let truth = set.sample_targets(sample).chunks_exact(3);
                errors_mm += estimate_mm
                    .iter()
                    .zip(truth)
                    .map(|(ours, truth)| (ours - (5.0 - truth[2])).abs())
                    .sum::<f64>();
            }
            let mean_mm = errors_mm / (set.samples() * estimate_mm.len()) as f64;
            assert!(mean_mm < 0.01, "{array}: {mean_mm}");
        }
    }
}
