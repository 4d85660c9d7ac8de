use std::sync::{Arc, OnceLock};

use faer::{Mat, Par, Side, linalg::triangular_solve};
use rand::Rng;

use super::row_problem::{Range, ranges};
use crate::{
    dataset::{Seed, Stream},
    scene::{DeformationSampler, Loading, Scene},
    sensor::SensorModel,
};

/// Gaussian priors of row-wires: means and covariances of a scene's deformations. They are computed when the first is
/// needed, and shared by clones.
#[derive(Clone, Debug)]
pub(super) struct Priors {
    model: SensorModel,
    scene: Scene,
    rows: Vec<usize>,
    of_rows: Arc<OnceLock<Vec<GaussianPrior>>>,
}

/// Minimum prior standard deviation of a pattern, relative to the range.
const SMALLEST_SPREAD: f64 = 1e-3;

impl Priors {
    pub(super) fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Self {
        Self {
            model: *model,
            scene: *scene,
            // Nodes that move independently have the same prior on all row-wires.
            rows: match scene.loading {
                Loading::RandomNodes => rows.iter().take(1).copied().collect(),
                _ => rows.to_vec(),
            },
            of_rows: Arc::default(),
        }
    }

    /// Returns the prior of row-wire `row`.
    ///
    /// # Panics
    /// If `row` is not one of the given rows, unless all have the same prior.
    pub(super) fn of(&self, row: usize) -> &GaussianPrior {
        let of_rows = self.of_rows.get_or_init(|| {
            let mut rng = Seed(0).rng(Stream::Expectation);
            GaussianPrior::of_rows(&self.model, &self.scene, &self.rows, &mut rng)
        });
        let place = match self.scene.loading {
            Loading::RandomNodes => Some(0),
            _ => self.rows.iter().position(|&known| known == row),
        };
        &of_rows[place.expect("the row is one of those given")]
    }
}

/// Gaussian prior of the unknowns of a row-wire, in units of the widths of their ranges: the covariance is invertible
/// for ranges of any length, and of different lengths.
#[derive(Clone, Debug)]
pub(crate) struct GaussianPrior {
    pub(crate) mean: Vec<f64>,
    /// L⁻¹ of the covariance L Lᵀ, lower triangular.
    pub(crate) inverse_root: Mat<f64>,
}

/// Mean and scatter of draws, updated draw by draw (Welford 1962), so that memory does not grow with their number.
#[derive(Clone, Debug)]
struct Moments {
    count: f64,
    mean: Vec<f64>,
    /// Sums of products of deviations from the mean; only the lower triangle is used.
    products: Vec<f64>,
}

impl Moments {
    fn new(unknowns: usize) -> Self {
        Self {
            count: 0.0,
            mean: vec![0.0; unknowns],
            products: vec![0.0; unknowns * unknowns],
        }
    }

    fn add(&mut self, values: impl Iterator<Item = f64>) {
        let n = self.mean.len();
        self.count += 1.0;
        let before: Vec<f64> = values.zip(&self.mean).map(|(value, mean)| value - mean).collect();
        let share = (self.count - 1.0) / self.count;
        for (i, (mean, apart)) in self.mean.iter_mut().zip(&before).enumerate() {
            *mean += apart / self.count;
            let products = &mut self.products[i * n..=i * n + i];
            products
                .iter_mut()
                .zip(&before)
                .for_each(|(sum, other)| *sum += share * apart * other);
        }
    }
}

/// Number of draws that estimate a scene's mean and covariance.
const DRAWS: usize = 4000;

impl GaussianPrior {
    /// Independent unknowns centred in their ranges, with this standard deviation.
    pub(crate) fn independent(ranges: &[Range], deviation: f64) -> Self {
        let (n, inverse) = (ranges.len(), 1.0 / deviation);
        Self {
            mean: ranges.iter().map(|range| range.middle() / range.width()).collect(),
            inverse_root: Mat::from_fn(n, n, |i, j| if i == j { inverse } else { 0.0 }),
        }
    }

    /// Mean and covariance of each of `rows` in `scene`: those of the uniform distribution for nodes that move
    /// independently, estimated from draws for other loadings. No pattern gets a prior spread below
    /// [`SMALLEST_SPREAD`].
    pub(crate) fn of_rows(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Vec<Self> {
        let ranges = ranges(model, scene);
        if scene.loading == Loading::RandomNodes {
            // The standard deviation of a uniform distribution is its width/√12.
            return vec![Self::independent(&ranges, 1.0 / 12.0_f64.sqrt()); rows.len()];
        }
        let sampler = DeformationSampler::new(scene, model);
        let axes = scene.movement.axes().indices();
        let mut moments = vec![Moments::new(ranges.len()); rows.len()];
        for _ in 0..DRAWS {
            let deformation = sampler.draw(rng);
            for (&row, moments) in rows.iter().zip(&mut moments) {
                let nodes = deformation.row_mm(row).iter();
                let values = nodes.flat_map(|u| axes.iter().map(|&axis| u[axis]));
                moments.add(values.zip(&ranges).map(|(value, range)| value / range.width()));
            }
        }
        moments.into_iter().map(Self::of_moments).collect()
    }

    /// Approximate number of bytes that [`Self::of_rows`] needs.
    pub(crate) fn bytes(loading: Loading, rows: usize, unknowns: usize) -> u64 {
        // Nodes that move independently have priors in closed form.
        if loading == Loading::RandomNodes {
            return 0;
        }
        let entries = 2 * rows as u64 * (unknowns * unknowns) as u64;
        entries.saturating_mul(size_of::<f64>() as u64)
    }

    fn of_moments(moments: Moments) -> Self {
        let Moments { count, mean, products } = moments;
        let n = mean.len();
        let mut covariance = Mat::from_fn(n, n, |i, j| products[i * n + j] / count);
        for i in 0..n {
            covariance[(i, i)] += SMALLEST_SPREAD * SMALLEST_SPREAD;
        }
        let factor = covariance.llt(Side::Lower);
        let factor = factor
            .expect("entries are at most 1 and the diagonal was raised by at least 1e-6, far above their rounding");
        let mut inverse_root = Mat::identity(n, n);
        triangular_solve::solve_lower_triangular_in_place(factor.L(), inverse_root.as_mut(), Par::Seq);
        Self { mean, inverse_root }
    }

    /// ln det of the inverse covariance.
    pub(crate) fn log_precision(&self) -> f64 {
        let diagonal = (0..self.mean.len()).map(|place| self.inverse_root[(place, place)]);
        2.0 * diagonal.map(f64::ln).sum::<f64>()
    }

    /// Appends the prior to equations `[A, b]` (row by row, `unknowns` + 1 columns) for
    /// x = (displacement − `at_mm`) / width.
    pub(crate) fn append_to(&self, equations: &mut Vec<f64>, unknowns: usize, at_mm: &[f64], ranges: &[Range]) {
        for row in 0..at_mm.len() {
            let entry = |column: usize| self.inverse_root[(row, column)];
            equations.extend((0..=row).map(entry));
            equations.resize(equations.len() + unknowns - row - 1, 0.0);
            let apart = |column: usize| self.mean[column] - at_mm[column] / ranges[column].width();
            equations.push((0..=row).map(|column| entry(column) * apart(column)).sum());
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
        GaussianPrior::of_rows(&model, &scene, &[1], &mut rng).remove(0)
    }

    /// The prior of shifts is proportional to them, down to lengths whose squares underflow.
    #[test]
    fn priors_scale_down_to_tiny_lengths() {
        let (long, short) = (prior(0.25), prior(0.25 * 1e-170));
        assert!((&long.inverse_root - &short.inverse_root).norm_max() < 1e-9 * long.inverse_root.norm_max());
        for (long, short) in long.mean.iter().zip(&short.mean) {
            assert!((long - short).abs() < 1e-12);
        }
    }
}
