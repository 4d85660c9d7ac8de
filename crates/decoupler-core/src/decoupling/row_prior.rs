use faer::{Mat, Par, Side, linalg::triangular_solve};
use rand::Rng;

use crate::{
    decoupling::row_problem::{Range, ranges},
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// Gaussian prior of the unknowns of a row-wire, measured in widths of their ranges, so that ranges of any length, and of
/// unlike lengths, give a covariance that can be inverted.
#[derive(Clone, Debug)]
pub(crate) struct GaussianPrior {
    pub(crate) mean: Vec<f64>,
    /// L⁻¹ of the covariance L Lᵀ, lower triangular.
    pub(crate) inverse_root: Mat<f64>,
}

/// Draws that estimate a scene's mean and covariance.
const DRAWS: usize = 4000;

impl GaussianPrior {
    /// Independent unknowns about the middle of their ranges, with this standard deviation.
    pub(crate) fn independent(ranges: &[Range], deviation: f64) -> Self {
        let (n, inverse) = (ranges.len(), 1.0 / deviation);
        Self {
            mean: ranges.iter().map(|range| range.middle() / range.width()).collect(),
            inverse_root: Mat::from_fn(n, n, |i, j| if i == j { inverse } else { 0.0 }),
        }
    }

    /// The mean and covariance of each of `rows` in `scene`: those of the uniform distribution for nodes that move on their
    /// own, estimated by draws for other loadings. No pattern is taken as known to better than `smallest_spread`.
    pub(crate) fn of_rows(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        smallest_spread: f64,
        rng: &mut impl Rng,
    ) -> Vec<Self> {
        let ranges = ranges(model, scene);
        if scene.loading == Loading::RandomNodes {
            // The standard deviation of a uniform distribution is its width/√12.
            return vec![Self::independent(&ranges, 1.0 / 12.0_f64.sqrt()); rows.len()];
        }
        let sampler = scene.sampler(model);
        let axes = scene.movement.axes().indices();
        let mut draws: Vec<Vec<f64>> = rows.iter().map(|_| Vec::new()).collect();
        for _ in 0..DRAWS {
            let deformation = sampler.draw(rng);
            for (&row, values) in rows.iter().zip(&mut draws) {
                let nodes = deformation.row_mm(row).iter();
                values.extend(nodes.flat_map(|u| axes.iter().map(|&axis| u[axis])));
            }
        }
        let of_row = |values: &Vec<f64>| Self::of_draws(values, &ranges, smallest_spread);
        draws.iter().map(of_row).collect()
    }

    /// About how many bytes [`Self::of_rows`] takes.
    pub(crate) fn bytes(loading: Loading, rows: usize, unknowns: usize) -> u64 {
        // Nodes that move on their own have priors in closed form.
        if loading == Loading::RandomNodes {
            return 0;
        }
        let entries = (rows * unknowns) as u64 * (DRAWS + unknowns) as u64;
        entries.saturating_mul(size_of::<f64>() as u64)
    }

    /// From draws × unknowns in millimetres, row by row.
    fn of_draws(values_mm: &[f64], ranges: &[Range], smallest_spread: f64) -> Self {
        let n = ranges.len();
        let draws = values_mm.chunks_exact(n);
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
            covariance[(i, i)] += smallest_spread * smallest_spread;
        }
        let factor = covariance.llt(Side::Lower);
        let factor = factor
            .expect("entries are at most 1 and the diagonal was raised by at least 1e-6, far above their rounding");
        let mut inverse_root = Mat::identity(n, n);
        triangular_solve::solve_lower_triangular_in_place(factor.L(), inverse_root.as_mut(), Par::Seq);
        Self { mean, inverse_root }
    }

    /// Appends the prior to equations `[A, b]` (row by row, `unknowns` + 1 columns) for
    /// x = (displacement − `at_mm`) / width.
    pub(crate) fn append_to(&self, equations: &mut Vec<f64>, unknowns: usize, at_mm: &[f64], ranges: &[Range]) {
        let n = at_mm.len();
        for row in 0..n {
            let value = |column| {
                if column < n {
                    self.inverse_root[(row, column)]
                } else {
                    0.0
                }
            };
            equations.extend((0..unknowns).map(value));
            let apart = |column: usize| self.mean[column] - at_mm[column] / ranges[column].width();
            equations.push(
                (0..=row)
                    .map(|column| self.inverse_root[(row, column)] * apart(column))
                    .sum(),
            );
        }
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
        GaussianPrior::of_rows(&model, &scene, &[1], 1e-3, &mut rng).remove(0)
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
