use std::f64::consts::PI;

use ndarray::{Array1, ArrayView1};
use serde::Serialize;

use super::{autocorrelation, student_quantile};

/// Figure with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Figure from all samples.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Interval {
    /// Minimum number of independent units for an interval.
    pub(crate) const FEWEST_UNITS: usize = 3;
    /// Maximum factor between an end and the figure; beyond it, the figure is not determined.
    const MAX_FACTOR: f64 = 100.0;

    /// Returns the interval of a positive ratio with sampling variance `spread`: a Student's t interval in the
    /// logarithm, in which the ratio of two sums of squares is nearly normal. `None` if the ratio is not determined.
    pub(crate) fn of_ratio(ratio: f64, spread: SumVariance) -> Option<Self> {
        let reach = spread.reach() / ratio;
        // False for NaN.
        let is_determined = ratio.is_finite() && ratio > 0.0 && reach <= Self::MAX_FACTOR.ln();
        (is_determined && spread.units >= Self::FEWEST_UNITS).then(|| Self {
            value: ratio,
            low: ratio * (-reach).exp(),
            high: ratio * reach.exp(),
        })
    }

    /// Returns the interval of a monotonic function of the figure.
    #[must_use]
    pub(crate) fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        let [value, low, high] = [self.value, self.low, self.high].map(function);
        Self {
            value,
            low: low.min(high),
            high: low.max(high),
        }
    }
}

/// Independent units in a set of samples: its groups, or stretches in the order of the samples.
///
/// Neighbouring samples of a recording are nearly the same, and samples of a group are correlated. The variance of a
/// sum is therefore estimated from whole groups, or from projections of the series on slow cosines.
#[derive(Clone, Debug)]
pub(crate) enum Evidence {
    /// Samples of each group.
    Groups(Vec<Vec<usize>>),
    /// Samples in the order of the recording.
    Order,
}

/// Variance of the sum of the influences of all samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SumVariance {
    /// Estimated variance.
    pub(crate) variance: f64,
    /// Number of independent groups or stretches, one more than the degrees of freedom of the estimate.
    pub(crate) units: usize,
}

impl SumVariance {
    fn of_independent(values: &Array1<f64>) -> Self {
        let units = values.len();
        let correction = units as f64 / (units as f64 - 1.0);
        let variance = correction * values.iter().map(|value| value * value).sum::<f64>();
        Self { variance, units }
    }

    /// Distance from the sum to the ends of its 95 % confidence interval.
    pub(crate) fn reach(self) -> f64 {
        student_quantile(0.05, self.units as f64 - 1.0) * self.variance.sqrt()
    }
}

impl Evidence {
    /// Returns the variance of the sum of `influences`, which have a sum of 0.
    ///
    /// Groups are independent. So are samples in order if no autocorrelation is found; otherwise the variance is that
    /// of their projections on the slowest cosines (Lazarus, Lewis, Stock and Watson 2018,
    /// doi:10.1080/07350015.2018.1506926), with one degree of freedom each.
    pub(crate) fn variance(&self, influences: &Array1<f64>) -> SumVariance {
        match self {
            Self::Groups(groups) => {
                let sum = |group: &Vec<usize>| group.iter().map(|&sample| influences[sample]).sum();
                SumVariance::of_independent(&groups.iter().map(sum).collect())
            }
            Self::Order => match slow_cosines(influences) {
                None => SumVariance::of_independent(influences),
                Some(cosines) => SumVariance {
                    variance: of_cosines(&influences.to_vec(), cosines),
                    units: cosines + 1,
                },
            },
        }
    }

    /// Returns the number of independent samples whose mean would be as uncertain as the mean of `values`, at most the
    /// number of values; 1 for a single group, which says nothing about others.
    pub(crate) fn effective_samples(&self, values: &[f64]) -> f64 {
        if matches!(self, Self::Groups(groups) if groups.len() < 2) {
            return 1.0;
        }
        let count = values.len() as f64;
        let off = &ArrayView1::from(values) - values.iter().sum::<f64>() / count;
        let ratio = SumVariance::of_independent(&off).variance / self.variance(&off).variance;
        // NaN for values that are all the same.
        (count * ratio).min(count)
    }
}

/// Returns the number of cosines that are slow compared with the correlation length of `series`; `None` if no
/// autocorrelation is found.
///
/// The model is a first-order autoregressive series with the correlation of neighbours, estimated in the series itself
/// and in means of 2, 4, 8, … of its values, so that a slow drift is found beneath independent noise. The number ν
/// balances the relative bias c·ν² with c = (π/n)²/6 · 2ρ/(1 − ρ)² against the variance 2/ν.
fn slow_cosines(series: &Array1<f64>) -> Option<usize> {
    /// Minimum length of a series for detecting autocorrelation.
    const MIN_LENGTH: usize = 16;
    /// Weight of the squared bias, which affects coverage more than variance does.
    const WEIGHT: f64 = 25.0;
    const FEWEST: f64 = 3.0;
    /// Maximum number of cosines; more do not change the interval.
    const MAX: f64 = 60.0;
    let mut series = series.to_vec();
    let mut slow: Option<f64> = None;
    while series.len() >= MIN_LENGTH {
        let count = series.len() as f64;
        let found = autocorrelation(ArrayView1::from(&series), 1);
        if let Some(found) = found.filter(|found| *found > 2.0 / count.sqrt()) {
            // Estimates from short series are too small (Marriott and Pope 1954, doi:10.1093/biomet/41.3-4.390).
            let memory = (found + (1.0 + 3.0 * found) / count).min(0.97);
            let bias = (PI / count).powi(2) / 6.0 * 2.0 * memory / (1.0 - memory).powi(2);
            let best = (2.0 * bias * bias * WEIGHT).powf(-0.2).round();
            slow = Some(slow.unwrap_or(MAX).min(best).clamp(FEWEST, MAX));
        }
        series = series.chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    }
    slow.map(|slow| slow as usize)
}

/// Returns the variance of the sum of `series` from its projections on the `cosines` slowest cosines.
fn of_cosines(series: &[f64], cosines: usize) -> f64 {
    /// Maximum number of sums of neighbouring values, enough for the slow cosines.
    const MAX_CELLS: usize = 2000;
    let count = series.len();
    let length = count.div_ceil(MAX_CELLS);
    let cells = series.chunks(length).enumerate().map(|(cell, values)| {
        let middle = (cell * length) as f64 + 0.5 * values.len() as f64;
        (middle / count as f64, values.iter().sum::<f64>())
    });
    let cells: Vec<(f64, f64)> = cells.collect();
    let squares = (1..=cosines).map(|wave| {
        let terms = cells.iter().map(|(at, sum)| (PI * wave as f64 * at).cos() * sum);
        terms.sum::<f64>().powi(2)
    });
    2.0 * squares.sum::<f64>() / cosines as f64
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    fn of_ratio(ratio: f64, variance: f64, units: usize) -> Option<Interval> {
        Interval::of_ratio(ratio, SumVariance { variance, units })
    }

    #[test]
    fn the_interval_of_a_ratio_is_that_of_its_logarithm() {
        // t with 20 degrees of freedom is 2.086: e^(±0.2086).
        let interval = of_ratio(1.0, 0.01, 21).unwrap();
        assert!(
            (interval.low - 0.8117).abs() < 1e-4 && (interval.high - 1.2319).abs() < 1e-4,
            "{interval:?}"
        );
        let interval = interval.map(|ratio| 1.0 - ratio);
        assert!(
            (interval.low + 0.2319).abs() < 1e-4 && (interval.high - 0.1883).abs() < 1e-4,
            "{interval:?}"
        );
    }

    #[test]
    fn an_undetermined_ratio_has_no_interval() {
        for (ratio, variance, units) in [
            (1.0, 0.01, 2),
            (1.0, 10.0, 20),
            (1.0, f64::INFINITY, 20),
            (1.0, f64::NAN, 20),
            (0.0, 0.01, 20),
            (f64::INFINITY, 0.01, 20),
            (f64::NAN, 0.01, 20),
        ] {
            assert_eq!(of_ratio(ratio, variance, units), None, "{ratio} {variance} {units}");
        }
    }

    fn autoregressive(memory: f64, n: usize, seed: u64) -> Array1<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut value = standard_normal(&mut rng);
        let mut next = || {
            value = memory * value + (1.0 - memory * memory).sqrt() * standard_normal(&mut rng);
            value
        };
        (0..n).map(|_| next()).collect()
    }

    /// The sum of n values of an autoregressive series of variance 1 has variance n (1 + ρ) / (1 − ρ) for large n.
    #[test]
    fn the_variance_of_a_sum_agrees_with_theory() {
        for memory in [0.0, 0.5, 0.9_f64] {
            let n = 5000;
            let theory = n as f64 * (1.0 + memory) / (1.0 - memory);
            let found = (0..40).map(|seed| Evidence::Order.variance(&autoregressive(memory, n, seed)).variance);
            let ratio = found.sum::<f64>() / 40.0 / theory;
            assert!((0.85..1.1).contains(&ratio), "{memory}: {ratio}");
        }
    }

    #[test]
    fn a_slow_drift_is_found_beneath_independent_noise() {
        let slow = autoregressive(0.98, 2000, 1);
        let noise = autoregressive(0.0, 2000, 2);
        let mixed = 0.5 * slow + noise;
        assert!(slow_cosines(&mixed).is_some_and(|cosines| cosines < 40));
    }

    #[test]
    fn short_constant_or_nan_series_have_no_autocorrelation() {
        for series in [vec![], vec![1.0], vec![2.0; 100], vec![f64::NAN; 50]] {
            assert_eq!(slow_cosines(&Array1::from(series)), None);
        }
    }
}
