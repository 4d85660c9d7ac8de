use faer::{Mat, Side, linalg::solvers::DenseSolveCore};
use rand::Rng;

use super::row_problem::{Range, ranges};
use crate::{
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// What a scene says of a row-wire's unknowns before anything is read.
#[derive(Clone, Debug)]
pub(crate) enum RowPrior {
    /// Uniform within their ranges, independent of each other: random nodes.
    Uniform,
    /// A Gaussian of the scene's mean and covariance, cut to the ranges: its inverse covariance, and that times its mean.
    Gaussian { precision: Mat<f64>, linear: Vec<f64> },
}

/// Draws that estimate a scene's mean and covariance.
const PRIOR_DRAWS: usize = 4000;
/// A standard deviation, in proportion to the range, below which no pattern is taken as known beforehand.
const SMALLEST_SPREAD: f64 = 1e-3;

impl RowPrior {
    /// The priors of `rows`.
    pub(super) fn of_rows(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Vec<Self> {
        if scene.loading == Loading::RandomNodes {
            return rows.iter().map(|_| Self::Uniform).collect();
        }
        let sampler = scene.sampler(model);
        let axes = scene.movement.axes().indices();
        let mut draws: Vec<Vec<f64>> = rows.iter().map(|_| Vec::new()).collect();
        for _ in 0..PRIOR_DRAWS {
            let deformation = sampler.draw(rng);
            for (&row, values) in rows.iter().zip(&mut draws) {
                values.extend(
                    deformation
                        .row_mm(row)
                        .iter()
                        .flat_map(|u| axes.iter().map(|&axis| u[axis])),
                );
            }
        }
        let ranges = ranges(model, scene);
        draws.iter().map(|values| Self::gaussian(values, &ranges)).collect()
    }

    /// From draws × unknowns, row by row.
    fn gaussian(values: &[f64], ranges: &[Range]) -> Self {
        let n = ranges.len();
        let draws = values.chunks_exact(n);
        let count = draws.len() as f64;
        let mut mean = vec![0.0; n];
        for draw in draws.clone() {
            mean.iter_mut()
                .zip(draw)
                .for_each(|(mean, value)| *mean += value / count);
        }
        let mut covariance: Mat<f64> = Mat::zeros(n, n);
        for draw in draws {
            for i in 0..n {
                for j in 0..n {
                    covariance[(i, j)] += (draw[i] - mean[i]) * (draw[j] - mean[j]) / count;
                }
            }
        }
        for (i, range) in ranges.iter().enumerate() {
            covariance[(i, i)] += (SMALLEST_SPREAD * range.width()).powi(2);
        }
        match covariance.llt(Side::Lower) {
            Ok(factor) => {
                let precision = factor.inverse();
                let linear = (0..n)
                    .map(|i| (0..n).map(|j| precision[(i, j)] * mean[j]).sum())
                    .collect();
                Self::Gaussian { precision, linear }
            }
            // The diagonal added above makes it positive definite; a uniform prior is valid all the same.
            Err(_) => Self::Uniform,
        }
    }
}
