use glam::DVec3;
use rand::Rng;

use super::row_fit::Cholesky;
use crate::{
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// Gaussian prior of the unknowns of one row-wire: node by node, each node's axes together, in millimetres.
#[derive(Clone, Debug)]
pub(in crate::live) struct GaussianPrior {
    pub(super) mean_mm: Vec<f64>,
    /// Inverse of the covariance in 1/mm²: unknowns × unknowns.
    pub(super) precision: Vec<f64>,
    pub(super) log_determinant: f64,
}

/// Draws that estimate the mean and covariance of a scene.
const DRAWS: usize = 4000;
/// A standard deviation, in proportion to the range, below which no pattern is taken as known beforehand.
const SMALLEST_SPREAD: f64 = 1e-2;

impl GaussianPrior {
    /// About the middle of every range with the range's width as standard deviation, for one row-wire of any scene with
    /// the ranges of `scene`: it only keeps what the readings do not see from running away.
    pub(super) fn weak(model: &SensorModel, scene: &Scene) -> Self {
        let ranges = ranges_mm(model, scene);
        let deviations: Vec<f64> = ranges.iter().map(|(low, high)| high - low).collect();
        Self::independent(&ranges, &deviations)
    }

    /// Means and covariances of the unknowns of `rows` in `scene`: those of the uniform distribution for random nodes,
    /// and estimated by draws for other loadings.
    pub(in crate::live) fn of_rows(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        rng: &mut impl Rng,
    ) -> Vec<Self> {
        let ranges = ranges_mm(model, scene);
        if scene.loading == Loading::RandomNodes {
            // The standard deviation of a uniform distribution is its width/√12.
            let deviations: Vec<f64> = ranges
                .iter()
                .map(|(low, high)| (high - low) / 12.0_f64.sqrt())
                .collect();
            return vec![Self::independent(&ranges, &deviations); rows.len()];
        }
        let sampler = scene.sampler(model);
        let axes = scene.movement.axes().indices();
        let of_nodes = |nodes: &[DVec3]| Vec::from_iter(nodes.iter().flat_map(|u| axes.iter().map(|&axis| u[axis])));
        let mut draws = vec![Vec::with_capacity(DRAWS); rows.len()];
        for _ in 0..DRAWS {
            let deformation = sampler.draw(rng);
            for (&row, draws) in rows.iter().zip(&mut draws) {
                draws.push(of_nodes(deformation.row_mm(row)));
            }
        }
        draws.iter().map(|draws| Self::of_draws(draws, &ranges)).collect()
    }

    fn of_draws(draws: &[Vec<f64>], ranges: &[(f64, f64)]) -> Self {
        let n = ranges.len();
        let mean = |i: usize| draws.iter().map(|draw| draw[i]).sum::<f64>() / draws.len() as f64;
        let mean_mm: Vec<f64> = (0..n).map(mean).collect();
        let mut covariance = vec![0.0; n * n];
        for draw in draws {
            for i in 0..n {
                for j in 0..n {
                    covariance[i * n + j] += (draw[i] - mean_mm[i]) * (draw[j] - mean_mm[j]) / draws.len() as f64;
                }
            }
        }
        for (i, (low, high)) in ranges.iter().enumerate() {
            covariance[i * n + i] += (SMALLEST_SPREAD * (high - low)).powi(2);
        }
        let mut cholesky = Cholesky::new(n);
        let is_positive = cholesky.factor(&covariance);
        assert!(
            is_positive,
            "the smallest spread makes every covariance positive definite"
        );
        let mut precision = vec![0.0; n * n];
        // The inverse is symmetric: its columns are its rows.
        for (i, column) in precision.chunks_exact_mut(n).enumerate() {
            column[i] = 1.0;
            cholesky.solve(column);
        }
        Self {
            mean_mm,
            precision,
            log_determinant: -cholesky.log_determinant(),
        }
    }

    fn independent(ranges: &[(f64, f64)], deviations_mm: &[f64]) -> Self {
        let n = ranges.len();
        let mut precision = vec![0.0; n * n];
        for (i, deviation) in deviations_mm.iter().enumerate() {
            precision[i * n + i] = deviation.powi(-2);
        }
        Self {
            mean_mm: ranges.iter().map(|(low, high)| 0.5 * (low + high)).collect(),
            precision,
            log_determinant: -2.0 * deviations_mm.iter().map(|deviation| deviation.ln()).sum::<f64>(),
        }
    }
}

/// Lowest and highest value of every unknown of a row-wire in `scene`.
pub(super) fn ranges_mm(model: &SensorModel, scene: &Scene) -> Vec<(f64, f64)> {
    let (stroke_mm, shift_mm) = (scene.stroke_mm(&model.geometry), scene.movement.largest_shift_mm());
    let of_axis = |&axis: &usize| {
        if axis == 2 {
            (0.0, stroke_mm)
        } else {
            (-shift_mm, shift_mm)
        }
    };
    let axes = scene.movement.axes().indices();
    let nodes = 0..model.scale.nodes_per_row();
    nodes.flat_map(|_| axes.iter().map(of_axis)).collect()
}
