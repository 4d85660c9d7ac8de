use faer::{
    Mat, Side,
    linalg::solvers::{DenseSolveCore, Solve},
};

use super::row_problem::Range;

/// A Gaussian cut to a box, `p(u) ∝ exp(−½ uᵀ Λ u + bᵀ u)` for u within its ranges: the posterior of uniform unknowns after
/// a linear reading with Gaussian noise.
///
/// Its moments have no closed form in several dimensions. They are found by expectation propagation (Minka 2001;
/// Cunningham, Hennig and Lacoste-Julien 2011 for boxes): each range is replaced by a Gaussian factor such that the
/// marginal of its unknown keeps mean and variance. Tests compare with sampling.
pub(crate) struct BoxPosterior {
    /// Λ.
    precision: Mat<f64>,
    /// b.
    linear: Vec<f64>,
    ranges: Vec<Range>,
}

/// The marginal of one unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Marginal {
    pub(crate) mean: f64,
    /// Half lies below: the answer of the least expected distance.
    pub(crate) median: f64,
    pub(crate) variance: f64,
}

/// The marginals of all unknowns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Marginals {
    pub(crate) of_unknowns: Vec<Marginal>,
    /// False if the factors still moved after the last round.
    pub(crate) converged: bool,
}

/// Largest number of rounds over all unknowns.
const ROUNDS: usize = 40;
/// Change of a mean, relative to the range, below which the factors have converged.
const TOLERANCE: f64 = 1e-7;

impl BoxPosterior {
    pub(crate) fn new(precision: Mat<f64>, linear: Vec<f64>, ranges: Vec<Range>) -> Self {
        Self {
            precision,
            linear,
            ranges,
        }
    }

    /// The marginals; `None` if Λ is so ill-conditioned that rounding hides the answer.
    pub(crate) fn marginals(&self) -> Option<Marginals> {
        let n = self.linear.len();
        // Begins with the moments of each range by itself.
        let mut site_precision: Vec<f64> = self.ranges.iter().map(|r| 12.0 / (r.width() * r.width())).collect();
        let mut site_linear: Vec<f64> = (0..n).map(|i| site_precision[i] * self.ranges[i].middle()).collect();
        let mut marginals = vec![Marginal::default(); n];
        let mut last = vec![f64::INFINITY; n];
        for _ in 0..ROUNDS {
            let (mut covariance, mut mean) = self.gaussian(&site_precision, &site_linear)?;
            for i in 0..n {
                let variance = covariance[(i, i)];
                let cavity = Cavity {
                    precision: 1.0 / variance - site_precision[i],
                    linear: mean[i] / variance - site_linear[i],
                };
                let tilted = cavity.cut_to(self.ranges[i]);
                if !(tilted.variance > 0.0 && tilted.variance.is_finite()) {
                    return None;
                }
                let precision = (1.0 / tilted.variance - cavity.precision).max(0.0);
                let linear = tilted.mean / tilted.variance - cavity.linear;
                let (by_precision, by_linear) = (precision - site_precision[i], linear - site_linear[i]);
                site_precision[i] = precision;
                site_linear[i] = linear;
                // Sherman and Morrison: one more precision on one unknown.
                let gain = by_precision / (1.0 + by_precision * variance);
                let shift = by_linear - gain * (mean[i] + by_linear * variance);
                let column: Vec<f64> = (0..n).map(|k| covariance[(k, i)]).collect();
                for k in 0..n {
                    mean[k] += shift * column[k];
                    for l in 0..n {
                        covariance[(k, l)] -= gain * column[k] * column[l];
                    }
                }
                marginals[i] = tilted;
            }
            let moved = |(i, marginal): (usize, &Marginal)| (marginal.mean - last[i]).abs() / self.ranges[i].width();
            let largest = marginals.iter().enumerate().map(moved).fold(0.0, f64::max);
            if largest.is_nan() {
                return None;
            }
            if largest < TOLERANCE {
                return Some(Marginals {
                    of_unknowns: marginals,
                    converged: true,
                });
            }
            for (last, marginal) in last.iter_mut().zip(&marginals) {
                *last = marginal.mean;
            }
        }
        Some(Marginals {
            of_unknowns: marginals,
            converged: false,
        })
    }

    /// Covariance and mean with these factors.
    fn gaussian(&self, site_precision: &[f64], site_linear: &[f64]) -> Option<(Mat<f64>, Vec<f64>)> {
        let n = self.linear.len();
        let mut precision = self.precision.clone();
        for i in 0..n {
            precision[(i, i)] += site_precision[i];
        }
        let factor = precision.llt(Side::Lower).ok()?;
        let right = Mat::from_fn(n, 1, |i, _| self.linear[i] + site_linear[i]);
        let mean = factor.solve(&right);
        Some((factor.inverse(), (0..n).map(|i| mean[(i, 0)]).collect()))
    }
}

/// A Gaussian factor `exp(−½ precision u² + linear u)`, possibly flat.
#[derive(Clone, Copy, Debug)]
struct Cavity {
    precision: f64,
    linear: f64,
}

impl Cavity {
    /// Moments of the factor cut to a range, by Simpson's rule over the part that carries weight.
    fn cut_to(self, range: Range) -> Marginal {
        /// exp(−36) ends what carries weight.
        const DECAY: f64 = 36.0;
        const POINTS: usize = 97;
        let precision = self.precision.max(0.0);
        let mode = range.clamp(self.linear / precision);
        // ln p at mode + t is slope t − ½ precision t²; the slope is 0 or points out of the range.
        let slope = self.linear - precision * mode;
        let reach = |slope: f64| 2.0 * DECAY / (slope + (slope * slope + 2.0 * DECAY * precision).sqrt());
        let lowest = range.lowest.max(mode - reach(slope.max(0.0)));
        let highest = range.highest.min(mode + reach((-slope).max(0.0)));
        let step = (highest - lowest) / (POINTS - 1) as f64;
        let mut density = [0.0; POINTS];
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for (k, density) in density.iter_mut().enumerate() {
            let t = lowest + step * k as f64 - mode;
            let simpson = match k {
                0 => 1.0,
                _ if k == POINTS - 1 => 1.0,
                _ if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            *density = (slope * t - 0.5 * precision * t * t).exp();
            total += simpson * *density;
            first += simpson * *density * t;
            second += simpson * *density * t * t;
        }
        let mean = first / total;
        // Half of the area under the density, by trapezoids.
        let trapezoid = |k: usize| 0.5 * (density[k] + density[k + 1]);
        let mut left = 0.5 * (0..POINTS - 1).map(trapezoid).sum::<f64>();
        let mut median = mode + mean;
        for k in 0..POINTS - 1 {
            if left <= trapezoid(k) {
                median = lowest + step * (k as f64 + left / trapezoid(k));
                break;
            }
            left -= trapezoid(k);
        }
        Marginal {
            mean: mode + mean,
            median: range.clamp(median),
            variance: second / total - mean * mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::normal::{normal_cdf, standard_normal};

    const UNIT: Range = Range {
        lowest: 0.0,
        highest: 1.0,
    };

    #[test]
    fn one_unknown_is_the_truncated_normal_in_closed_form() {
        let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
        for (mean, deviation) in [(0.5, 0.01), (0.2, 0.3), (-0.5, 0.4), (1.3, 0.2), (0.4, 50.0)] {
            let precision = 1.0 / (deviation * deviation);
            let posterior = BoxPosterior::new(Mat::from_fn(1, 1, |_, _| precision), vec![precision * mean], vec![UNIT]);
            let ours = posterior.marginals().unwrap().of_unknowns[0];
            let (alpha, beta) = (-mean / deviation, (1.0 - mean) / deviation);
            let mass = normal_cdf(beta) - normal_cdf(alpha);
            let ratio = (density(alpha) - density(beta)) / mass;
            let expected = mean + deviation * ratio;
            let spread = 1.0 + (alpha * density(alpha) - beta * density(beta)) / mass - ratio * ratio;
            assert!(
                (ours.mean - expected).abs() < 2e-4 * deviation.min(1.0),
                "{mean} {deviation}: {ours:?}"
            );
            assert!(
                (ours.variance / (deviation * deviation * spread) - 1.0).abs() < 2e-3,
                "{mean} {deviation}"
            );
            let below = (normal_cdf((ours.median - mean) / deviation) - normal_cdf(alpha)) / mass;
            assert!((below - 0.5).abs() < 2e-3, "{mean} {deviation}: {below}");
        }
    }

    #[test]
    fn a_wide_box_leaves_the_gaussian() {
        let precision = Mat::from_fn(2, 2, |i, j| if i == j { 400.0 } else { 250.0 });
        let truth = [0.4, 0.7];
        let linear = vec![400.0 * truth[0] + 250.0 * truth[1], 250.0 * truth[0] + 400.0 * truth[1]];
        let wide = Range {
            lowest: -100.0,
            highest: 100.0,
        };
        let marginals = BoxPosterior::new(precision, linear, vec![wide; 2])
            .marginals()
            .unwrap()
            .of_unknowns;
        for (ours, truth) in marginals.iter().zip(truth) {
            assert!((ours.mean - truth).abs() < 1e-4);
            assert!((ours.variance * (400.0 * 400.0 - 250.0 * 250.0) / 400.0 - 1.0).abs() < 1e-3);
        }
    }

    /// Draws uniformly from the box and weighs: exact, whatever the shape.
    #[test]
    fn several_correlated_unknowns_agree_with_sampling() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for trial in 0..5 {
            let n = 3;
            let a = Mat::from_fn(4, n, |_, _| standard_normal(&mut rng));
            let noise = 0.5;
            let truth: Vec<f64> = (0..n).map(|_| rng.random()).collect();
            let y: Vec<f64> = (0..4)
                .map(|k| (0..n).map(|i| a[(k, i)] * truth[i]).sum::<f64>() + noise * standard_normal(&mut rng))
                .collect();
            let precision = a.transpose() * &a * (1.0 / (noise * noise));
            let linear = (0..n)
                .map(|i| (0..4).map(|k| a[(k, i)] * y[k]).sum::<f64>() / (noise * noise))
                .collect();
            let marginals = BoxPosterior::new(precision, linear, vec![UNIT; n])
                .marginals()
                .unwrap()
                .of_unknowns;
            let (mut total, mut first, mut second) = (0.0, [0.0; 3], [0.0; 3]);
            for _ in 0..400_000 {
                let u: [f64; 3] = std::array::from_fn(|_| rng.random());
                let misfit: f64 = (0..4)
                    .map(|k| ((0..n).map(|i| a[(k, i)] * u[i]).sum::<f64>() - y[k]).powi(2))
                    .sum();
                let weight = (-0.5 * misfit / (noise * noise)).exp();
                total += weight;
                for i in 0..n {
                    first[i] += weight * u[i];
                    second[i] += weight * u[i] * u[i];
                }
            }
            for i in 0..n {
                let mean = first[i] / total;
                let deviation = (second[i] / total - mean * mean).sqrt();
                let ours = marginals[i];
                assert!(
                    (ours.mean - mean).abs() < 0.03 * deviation,
                    "{trial}: {ours:?} {mean} {deviation}"
                );
                assert!(
                    (ours.variance.sqrt() / deviation - 1.0).abs() < 0.05,
                    "{trial}: {ours:?} {deviation}"
                );
            }
        }
    }
}
