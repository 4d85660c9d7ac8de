use std::f64::consts::PI;

use ndarray::{Array2, ArrayView1};

use crate::{
    dataset::{Dataset, Folds, Split, SplitBy},
    decoupling::decode_set,
    evaluation::{
        Begin, Run, RunError, RunSets, RunSettings,
        baselines::fit_baselines,
        cross_validation::{nth_seed, scatter},
    },
    job::Job,
    numerics::autocorrelation,
};

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
pub(super) struct SumVariance {
    /// Estimated variance.
    pub(super) variance: f64,
    /// Number of independent groups or stretches.
    pub(super) units: usize,
    /// Degrees of freedom of the estimate.
    pub(super) freedom: f64,
}

impl SumVariance {
    /// Returns `true` if a few units make up most of the variance, as with heavy tails: the estimated variance then
    /// depends on extreme values that are rare in short data.
    pub(super) fn is_heavy_tailed(&self) -> bool {
        self.freedom < 0.15 * self.units as f64
    }
}

impl Evidence {
    /// Returns the groups of `set` if it is split by group, otherwise the order of its samples.
    pub(crate) fn of(set: &Dataset, by: SplitBy) -> Self {
        match by {
            SplitBy::Group => Self::Groups(set.snapshots()),
            SplitBy::Time | SplitBy::Random => Self::Order,
        }
    }

    /// Returns the variance of the sum of `influences`, which have a sum of 0.
    ///
    /// Groups are independent. So are samples in order if no autocorrelation is found; otherwise the variance is that
    /// of their projections on the slowest cosines (Lazarus, Lewis, Stock and Watson 2018,
    /// doi:10.1080/07350015.2018.1506926), with one degree of freedom each. If a few units have most of the variance,
    /// there are fewer degrees of freedom: 2n / (κ − 1) with the kurtosis κ (Satterthwaite 1946, doi:10.2307/3002019).
    pub(super) fn variance(&self, influences: &[f64]) -> SumVariance {
        match self {
            Self::Groups(groups) => {
                let sum = |group: &Vec<usize>| group.iter().map(|&sample| influences[sample]).sum();
                of_independent(&groups.iter().map(sum).collect::<Vec<f64>>())
            }
            Self::Order => match slow_cosines(influences) {
                None => of_independent(influences),
                Some(cosines) => SumVariance {
                    variance: of_cosines(influences, cosines),
                    units: cosines + 1,
                    freedom: tail_freedom(influences).min(cosines as f64).max(MIN_FREEDOM),
                },
            },
        }
    }
}

impl Evidence {
    /// Returns the samples in units that are nearly independent: groups, or stretches as long as those of `series`, which
    /// has a value for each sample. Neighbouring units are merged if there are many.
    pub(super) fn units(&self, series: &[f64]) -> Vec<Vec<usize>> {
        /// More units would be slow to draw and not change an interval.
        const MAX: usize = 2000;
        match self {
            Self::Groups(groups) => {
                let merged = groups.chunks(groups.len().div_ceil(MAX).max(1));
                merged.map(<[Vec<usize>]>::concat).collect()
            }
            Self::Order => {
                let stretches = slow_cosines(series).map_or(MAX, |cosines| cosines + 1);
                let samples = Vec::from_iter(0..series.len());
                let stretches = samples.chunks(samples.len().div_ceil(stretches).max(1));
                stretches.map(<[usize]>::to_vec).collect()
            }
        }
    }

    /// Returns the mean of positive `values`, and the variance of its logarithm.
    pub(super) fn variance_of_log_mean(&self, values: &[f64]) -> (f64, SumVariance) {
        let total: f64 = values.iter().sum();
        let mean = total / values.len() as f64;
        let influences: Vec<f64> = values.iter().map(|value| (value - mean) / total).collect();
        (mean, self.variance(&influences))
    }

    /// Returns the number of independent samples whose mean would be as uncertain as the mean of `values`, at most the
    /// number of values; 1 for a single group, which says nothing about others.
    pub(crate) fn effective_samples(&self, values: &[f64]) -> f64 {
        if matches!(self, Self::Groups(groups) if groups.len() < 2) {
            return 1.0;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let off: Vec<f64> = values.iter().map(|value| value - mean).collect();
        let independent = of_independent(&off).variance;
        let variance = self.variance(&off).variance;
        if variance > independent {
            count * independent / variance
        } else {
            count
        }
    }
}

/// Minimum degrees of freedom; with fewer, intervals are meaningless.
const MIN_FREEDOM: f64 = 2.0;

fn of_independent(values: &[f64]) -> SumVariance {
    let units = values.len();
    let correction = units as f64 / (units as f64 - 1.0);
    SumVariance {
        variance: correction * values.iter().map(|value| value * value).sum::<f64>(),
        units,
        freedom: tail_freedom(values).min(units as f64 - 1.0).max(MIN_FREEDOM),
    }
}

/// Returns 2n / (κ − 1), which is infinite for values of equal magnitude.
fn tail_freedom(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let power = |exponent| values.iter().map(|value| value.powi(exponent)).sum::<f64>();
    let kurtosis = count * power(4) / power(2).powi(2);
    if kurtosis > 1.0 {
        2.0 * count / (kurtosis - 1.0)
    } else {
        f64::INFINITY
    }
}

/// Returns the number of cosines that are slow compared with the correlation length of `series`; `None` if no
/// autocorrelation is found.
///
/// The model is a first-order autoregressive series with the correlation of neighbours, estimated in the series itself
/// and in means of 2, 4, 8, … of its values, so that a slow drift is found beneath independent noise. The number ν
/// balances the relative bias c·ν² with c = (π/n)²/6 · 2ρ/(1 − ρ)² against the variance 2/ν.
pub(super) fn slow_cosines(series: &[f64]) -> Option<usize> {
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

/// Model that is fitted repeatedly to measure how well the readings determine the targets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FittedModel {
    /// Ridge regression: a fit takes milliseconds, but it finds only linear relations.
    #[default]
    Ridge,
    /// The network of the settings: each fit is a training.
    Network,
}

impl FittedModel {
    /// Returns the name within a sentence.
    pub(super) fn noun(self) -> &'static str {
        match self {
            Self::Ridge => "ridge regression",
            Self::Network => "the network",
        }
    }

    /// Returns held-out answers for every sample of `set`, each by a model fitted without its fold; for the network,
    /// those of [`CrossValidated`](crate::evaluation::CrossValidated).
    pub(super) fn held_out(
        self,
        settings: &RunSettings,
        set: &Dataset,
        folds: &Folds,
        job: &Job<'_>,
    ) -> Result<Array2<f64>, RunError> {
        let is_simulated = settings.simulation().is_some();
        let holds_out = self == Self::Network && (is_simulated || settings.training.method.needs_validation());
        let mut answers = Array2::zeros(set.targets().dim());
        for fold in 0..folds.count() {
            job.check()?;
            let seed = nth_seed(settings.seed, fold);
            let (split, test) = (folds.divided(fold, holds_out).split(set), set.select(folds.test(fold)));
            let of_fold = self.answers(&RunSettings { seed, ..*settings }, split, &test, job)?;
            scatter(&mut answers, folds.test(fold), &of_fold);
        }
        Ok(answers)
    }

    /// Returns the answers to `test` of the model fitted to `split`.
    pub(super) fn answers(
        self,
        settings: &RunSettings,
        split: Split,
        test: &Dataset,
        job: &Job<'_>,
    ) -> Result<Array2<f64>, RunError> {
        // A stretch may have no variation to learn from: ridge regression then answers with its mean.
        if self == Self::Ridge || !split.training.has_varying_target() {
            let (_, mut ridge) = fit_baselines(&split.training, settings)?;
            return Ok(decode_set(&mut ridge, test)?);
        }
        let mut run = Run::new(*settings, RunSets::new(split, test.clone()), Begin::Initialize, job)?;
        run.finish(job)?;
        Ok(run.decouple_test())
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    fn autoregressive(memory: f64, n: usize, seed: u64) -> Vec<f64> {
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
        let mixed: Vec<f64> = slow
            .iter()
            .zip(&noise)
            .map(|(slow, noise)| 0.5 * slow + noise)
            .collect();
        assert!(slow_cosines(&mixed).is_some_and(|cosines| cosines < 40));
    }

    #[test]
    fn short_constant_or_nan_series_have_no_autocorrelation() {
        for series in [vec![], vec![1.0], vec![2.0; 100], vec![f64::NAN; 50]] {
            assert_eq!(slow_cosines(&series), None);
        }
    }
}
