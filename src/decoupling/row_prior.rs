use faer::{Mat, Side, linalg::solvers::DenseSolveCore};
use rand::Rng;

use super::row_problem::{Range, ranges};
use crate::{
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// Prior distribution of a row-wire's unknowns in a scene.
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

    /// From draws × unknowns, row by row. Reckons in widths of the ranges, so that ranges of any length, and of unlike
    /// lengths, give a matrix that can be inverted.
    fn gaussian(values: &[f64], ranges: &[Range]) -> Self {
        let n = ranges.len();
        let draws = values.chunks_exact(n);
        let count = draws.len() as f64;
        let mut mean = vec![0.0; n];
        for draw in draws.clone() {
            mean.iter_mut()
                .zip(draw)
                .zip(ranges)
                .for_each(|((mean, value), range)| *mean += value / range.width() / count);
        }
        let mut covariance: Mat<f64> = Mat::zeros(n, n);
        for draw in draws {
            for i in 0..n {
                for j in 0..n {
                    let apart = |i: usize| draw[i] / ranges[i].width() - mean[i];
                    covariance[(i, j)] += apart(i) * apart(j) / count;
                }
            }
        }
        for i in 0..n {
            covariance[(i, i)] += SMALLEST_SPREAD * SMALLEST_SPREAD;
        }
        let factor = covariance.llt(Side::Lower);
        let factor =
            factor.expect("entries are at most 1 and the diagonal was raised by 1e-6, far above their rounding");
        let inverse = factor.inverse();
        let linear = (0..n)
            .map(|i| (0..n).map(|j| inverse[(i, j)] * mean[j]).sum::<f64>() / ranges[i].width())
            .collect();
        let precision = Mat::from_fn(n, n, |i, j| inverse[(i, j)] / ranges[i].width() / ranges[j].width());
        Self::Gaussian { precision, linear }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Movement,
    };

    fn prior(largest_shift_mm: f64) -> RowPrior {
        let model = SensorModel::new("3x4_2x12".parse().unwrap());
        let scene = Scene {
            loading: "smooth:4".parse().unwrap(),
            movement: Movement::Xyz { largest_shift_mm },
            ..Scene::default()
        };
        RowPrior::of_rows(&model, &scene, &[1], &mut Seed(0).rng(Stream::Expectation)).remove(0)
    }

    /// The prior of shifts is proportional to them, down to lengths whose squares underflow.
    #[test]
    fn no_length_is_too_short_for_a_prior_of_its_own() {
        let RowPrior::Gaussian { precision, linear } = prior(0.25) else {
            panic!("a smooth field is not uniform")
        };
        let RowPrior::Gaussian {
            precision: short,
            linear: short_linear,
        } = prior(0.25 * 1e-170)
        else {
            panic!("the prior was given up")
        };
        // Unknowns 2 and 5 are z of two nodes, 0 is x: in proportion 1e-170.
        assert!((short[(2, 5)] / precision[(2, 5)] - 1.0).abs() < 1e-9);
        assert!((short[(0, 2)] / precision[(0, 2)] / 1e170 - 1.0).abs() < 1e-9);
        assert!((short_linear[2] / linear[2] - 1.0).abs() < 1e-9);
    }
}
