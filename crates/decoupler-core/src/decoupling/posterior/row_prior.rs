use faer::{Mat, Par, Side, linalg::triangular_solve};
use rand::Rng;

use crate::{
    decoupling::row_problem::{Range, ranges},
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// Prior distribution of a row-wire's unknowns in a scene.
#[derive(Clone, Debug)]
pub(super) enum RowPrior {
    /// Uniform within their ranges, independent of each other: random nodes.
    Uniform,
    /// A Gaussian of the scene's mean and covariance, cut to the ranges.
    Gaussian(GaussianPrior),
}

/// Mean and covariance of unknowns measured in widths of their ranges, so that ranges of any length, and of unlike
/// lengths, give a matrix that can be inverted.
#[derive(Clone, Debug)]
pub(super) struct GaussianPrior {
    mean: Vec<f64>,
    /// L⁻¹ of the covariance L Lᵀ.
    inverse_root: Mat<f64>,
}

/// Draws that estimate a scene's mean and covariance.
const PRIOR_DRAWS: usize = 4000;
/// A standard deviation, in proportion to the range, below which no pattern is taken as known beforehand.
const SMALLEST_SPREAD: f64 = 1e-3;

impl RowPrior {
    /// About how many bytes the priors of this many rows take while they are estimated.
    pub(super) fn bytes(loading: Loading, rows: usize, unknowns: usize) -> u64 {
        // Nodes that move on their own have priors in closed form.
        if loading == Loading::RandomNodes {
            return 0;
        }
        let entries = (rows * unknowns) as u64 * (PRIOR_DRAWS + unknowns) as u64;
        entries.saturating_mul(size_of::<f64>() as u64)
    }

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
        let gaussian = |values: &Vec<f64>| Self::Gaussian(GaussianPrior::of(values, &ranges));
        draws.iter().map(gaussian).collect()
    }

    /// Appends the prior to equations `[A, b]` (row by row, `unknowns` + 1 columns) for
    /// x = (displacement − `at_mm`) / width.
    pub(super) fn append_to(&self, equations: &mut Vec<f64>, unknowns: usize, at_mm: &[f64], ranges: &[Range]) {
        let Self::Gaussian(GaussianPrior { mean, inverse_root }) = self else {
            return;
        };
        let n = at_mm.len();
        for row in 0..n {
            let value = |column| if column < n { inverse_root[(row, column)] } else { 0.0 };
            equations.extend((0..unknowns).map(value));
            let apart = |column: usize| mean[column] - at_mm[column] / ranges[column].width();
            equations.push(
                (0..=row)
                    .map(|column| inverse_root[(row, column)] * apart(column))
                    .sum(),
            );
        }
    }
}

impl GaussianPrior {
    /// From draws × unknowns, row by row.
    fn of(values: &[f64], ranges: &[Range]) -> Self {
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
        let mut inverse_root = Mat::identity(n, n);
        triangular_solve::solve_lower_triangular_in_place(factor.L(), inverse_root.as_mut(), Par::Seq);
        Self { mean, inverse_root }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Movement,
    };

    fn prior(largest_shift_mm: f64) -> GaussianPrior {
        let model = SensorModel::new("3x4_2x12".parse().unwrap());
        let scene = Scene {
            loading: "smooth:4".parse().unwrap(),
            movement: Movement::Xyz { largest_shift_mm },
            ..Scene::default()
        };
        let mut rng = Seed(0).rng(Stream::Expectation);
        match RowPrior::of_rows(&model, &scene, &[1], &mut rng).remove(0) {
            RowPrior::Gaussian(prior) => prior,
            RowPrior::Uniform => panic!("a smooth field is not uniform"),
        }
    }

    /// The prior of shifts is proportional to them, down to lengths whose squares underflow.
    #[test]
    fn no_length_is_too_short_for_a_prior_of_its_own() {
        let (long, short) = (prior(0.25), prior(0.25 * 1e-170));
        assert!((&long.inverse_root - &short.inverse_root).norm_max() < 1e-9 * long.inverse_root.norm_max());
        for (long, short) in long.mean.iter().zip(&short.mean) {
            assert!((long - short).abs() < 1e-12);
        }
    }
}
