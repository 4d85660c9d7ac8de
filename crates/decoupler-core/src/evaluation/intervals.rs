use ndarray::{ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{CrossValidated, RunError, RunSettings, recorded::Evidence};
use crate::dataset::{Dataset, Folds, Seed, SplitBy, Stream};

/// Prediction intervals of decoded values: the answer plus or minus a half-width, target by target.
///
/// The half-widths come from held-out errors (conformal prediction: Vovk, Gammerman and Shafer 2005; cross-conformal
/// form: Barber, Candès, Ramdas and Tibshirani 2021, doi:10.1214/20-AOS1965), so they need no model of the noise. An
/// interval contains the true value with probability [`Self::NOMINAL`] as long as new samples are like the calibration
/// samples.
///
/// Errors of neighbouring samples of a recording are correlated. The rank of the quantile therefore uses the effective
/// number of samples m in place of the number n: the half-width is the ⌈(m + 1)(1 − α)⌉ / m quantile of the absolute
/// errors. A target with fewer than [`Self::FEWEST_SAMPLES`] effective samples has no interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intervals {
    /// Interval of each target; `None` if there are too few effective samples, or errors that are not finite.
    pub targets: Vec<Option<HalfWidth>>,
}

/// Half-width of the interval of one target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HalfWidth {
    /// Half-width that is valid for all answers together, in the unit of the target.
    pub constant: f64,
    /// Half-width that varies with the answer, if that makes the intervals narrower on average at equal coverage:
    /// points (answer, half-width) with ascending answers, interpolated linearly and constant beyond the ends. Empty
    /// otherwise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_answer: Vec<[f64; 2]>,
    /// Number of held-out samples.
    pub samples: usize,
    /// Number of independent samples that contain as much information.
    pub effective_samples: f64,
}

/// Coverage of the intervals of one target on a test set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Share of the test samples whose target is within its interval.
    pub share: f64,
    /// Mean half-width, in the unit of the target.
    pub half_width: f64,
    /// Lowest and highest share expected for test samples that are like the training samples, with 99 % confidence.
    pub expected: [f64; 2],
    /// Mean error (answer − target), in the unit of the target.
    pub bias: f64,
}

/// Points (answer, spread of the error) of a piecewise linear function; one point is a constant.
type Points = Vec<[f64; 2]>;

impl Intervals {
    /// Nominal coverage, 1 − α.
    pub const NOMINAL: f64 = 0.9;
    /// Minimum number of effective samples: with fewer, the rank of the quantile exceeds their number.
    pub const FEWEST_SAMPLES: f64 = Self::NOMINAL / (1.0 - Self::NOMINAL);
    /// Number of folds of the cross-validation that yields held-out answers.
    pub const FOLDS: usize = 5;

    /// Calibrates intervals on held-out `answers` (samples × targets) to all samples of `set`, each answer by a model
    /// that was fitted without its block of time or its group. `by` is the rule by which they were held out.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn calibrate(set: &Dataset, answers: ArrayView2<'_, f64>, by: SplitBy) -> Self {
        assert_eq!(set.targets().dim(), answers.dim());
        let evidence = Evidence::of(set, by);
        let folds = by.folds_of(set, Self::FOLDS);
        let folds = Folds::by(set, folds, by, &mut Seed(0).rng(Stream::Split)).ok();
        let targets = set.targets();
        let columns = targets.columns().into_iter().zip(answers.columns());
        let half_width = |(truth, answers): (ArrayView1<'_, f64>, ArrayView1<'_, f64>)| {
            let answers = answers.to_vec();
            let errors: Vec<f64> = answers
                .iter()
                .zip(truth)
                .map(|(answer, truth)| (answer - truth).abs())
                .collect();
            HalfWidth::calibrate(&answers, &errors, folds.as_ref(), &evidence)
        };
        Self {
            targets: columns.map(half_width).collect(),
        }
    }

    /// Trains a network with `settings` for each of [`Self::FOLDS`] folds of `set` and calibrates on their held-out
    /// answers, which takes about four times as long as the training itself. Returns `None` if cancelled.
    ///
    /// # Errors
    /// If the settings are invalid, or the set cannot be divided into folds.
    pub fn cross_validate(
        settings: &RunSettings,
        set: &Dataset,
        by: SplitBy,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let folds = Folds::by(
            set,
            by.folds_of(set, Self::FOLDS),
            by,
            &mut settings.seed.rng(Stream::Split),
        )?;
        let validated = CrossValidated::on_folds(settings, set, folds, is_cancelled)?;
        Ok(validated.map(|validated| Self::calibrate(set, validated.network.view(), by)))
    }

    /// Half-width of the interval of target `target` at this answer, in the unit of the target; `None` if the target
    /// has no interval.
    pub fn half_width(&self, target: usize, answer: f64) -> Option<f64> {
        Some(self.targets.get(target)?.as_ref()?.at(answer))
    }

    /// Returns `true` if no target has an interval.
    pub fn is_empty(&self) -> bool {
        self.targets.iter().all(Option::is_none)
    }

    /// Measures the coverage of `answers` (samples × targets) to the test samples `test`, which were held out by the
    /// rule `by`; `None` for targets without an interval.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn coverage(&self, test: &Dataset, answers: ArrayView2<'_, f64>, by: SplitBy) -> Vec<Option<Coverage>> {
        assert_eq!(test.targets().dim(), answers.dim());
        let evidence = Evidence::of(test, by);
        let targets = test.targets();
        let of = |(target, half_width): (usize, &Option<HalfWidth>)| {
            let (truth, answers) = (targets.column(target), answers.column(target));
            Some(
                half_width
                    .as_ref()?
                    .coverage(truth.iter().copied().zip(answers.iter().copied()).collect(), &evidence),
            )
        };
        self.targets.iter().enumerate().map(of).collect()
    }

    /// Describes the first invalid value, for files.
    pub fn check(&self, targets: usize) -> Result<(), IntervalsDefect> {
        if self.targets.len() != targets {
            let found = self.targets.len();
            return Err(IntervalsDefect::Targets {
                found,
                expected: targets,
            });
        }
        let is_valid = |half_width: &HalfWidth| {
            let widths = half_width.by_answer.iter().map(|point| point[1]);
            let mut widths = widths.chain([half_width.constant]);
            widths.all(|width| width >= 0.0 && width.is_finite())
                && half_width.by_answer.iter().all(|point| point[0].is_finite())
                && half_width.by_answer.windows(2).all(|pair| pair[0][0] < pair[1][0])
        };
        match self.targets.iter().position(|of| !of.as_ref().is_none_or(is_valid)) {
            Some(target) => Err(IntervalsDefect::HalfWidth(target)),
            None => Ok(()),
        }
    }
}

/// Invalid value of intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum IntervalsDefect {
    /// The number of intervals is not the number of targets.
    #[error("{found} intervals for {expected} targets")]
    Targets {
        /// Number of intervals.
        found: usize,
        /// Number of targets.
        expected: usize,
    },
    /// A half-width is negative or not finite, or its answers are not ascending.
    #[error("the interval of target {0} is not valid")]
    HalfWidth(usize),
}

impl HalfWidth {
    /// Minimum gain in the mean half-width for which the half-width varies with the answer.
    const MIN_GAIN: f64 = 0.03;
    /// Number of effective samples for each point of a half-width that varies with the answer.
    const SAMPLES_PER_POINT: f64 = 20.0;
    const MAX_POINTS: usize = 6;

    /// Calibrates on answers and their absolute errors.
    fn calibrate(answers: &[f64], errors: &[f64], folds: Option<&Folds>, evidence: &Evidence) -> Option<Self> {
        if errors.iter().any(|error| !error.is_finite()) {
            return None;
        }
        let (constant, effective_samples) = conformal_quantile(errors, evidence)?;
        let points = (effective_samples / Self::SAMPLES_PER_POINT) as usize;
        let scaled = folds.and_then(|folds| {
            let spreads = held_out_spreads(answers, errors, folds, points.min(Self::MAX_POINTS))?;
            let scores: Vec<f64> = errors
                .iter()
                .zip(&spreads)
                .map(|(error, spread)| error / spread)
                .collect();
            let mean_spread = spreads.iter().sum::<f64>() / spreads.len() as f64;
            // Mean half-widths at a coverage that is exactly the nominal one on the held-out samples.
            let rank = (Intervals::NOMINAL * errors.len() as f64).ceil() as usize;
            let is_narrower =
                nth_smallest(&scores, rank) * mean_spread < (1.0 - Self::MIN_GAIN) * nth_smallest(errors, rank);
            let all: Vec<usize> = (0..errors.len()).collect();
            let points = spread_points(answers, errors, &all, points.min(Self::MAX_POINTS))?;
            let (factor, effective_samples) = conformal_quantile(&scores, evidence).filter(|_| is_narrower)?;
            let points: Points = points
                .into_iter()
                .map(|[answer, spread]| [answer, factor * spread])
                .collect();
            Some((points, effective_samples))
        });
        let (by_answer, effective_samples) = scaled.unwrap_or((Points::new(), effective_samples));
        Some(Self {
            constant,
            by_answer,
            samples: errors.len(),
            effective_samples,
        })
    }

    /// Half-width at this answer, in the unit of the target.
    pub fn at(&self, answer: f64) -> f64 {
        if self.by_answer.is_empty() {
            self.constant
        } else {
            interpolate(&self.by_answer, answer)
        }
    }

    fn coverage(&self, pairs: Vec<(f64, f64)>, evidence: &Evidence) -> Coverage {
        let count = pairs.len() as f64;
        let is_outside = |&(truth, answer): &(f64, f64)| {
            let is_inside = (answer - truth).abs() <= self.at(answer);
            f64::from(u8::from(!is_inside))
        };
        let outside: Vec<f64> = pairs.iter().map(is_outside).collect();
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        // The samples are at least as dependent as the calibration samples were found to be.
        let like_calibration = count * self.effective_samples / self.samples as f64;
        let effective = evidence.effective_samples(&outside).min(like_calibration).max(1.0);
        Coverage {
            share: 1.0 - outside.iter().sum::<f64>() / count,
            half_width: mean(&|&(_, answer)| self.at(answer)),
            expected: expected_shares(effective, self.effective_samples),
            bias: mean(&|&(truth, answer)| answer - truth),
        }
    }
}

impl Coverage {
    /// Returns `true` if the coverage is significantly too low.
    pub fn is_too_low(&self) -> bool {
        self.share < self.expected[0]
    }
}

/// Returns the lowest and the highest share of `test` effective samples within intervals that were calibrated on
/// `calibration` effective samples, with 99 % confidence.
///
/// The coverage of conformal intervals has a beta distribution, so the number of samples within them is beta-binomial
/// (Vovk 2012, arXiv:1209.2673). Its skewness matters for few samples.
fn expected_shares(test: f64, calibration: f64) -> [f64; 2] {
    const TAIL: f64 = 0.005;
    /// More samples do not change the shares noticeably.
    const MAX_SAMPLES: f64 = 10_000.0;
    let samples = test.floor().clamp(1.0, MAX_SAMPLES);
    let inside = Intervals::NOMINAL * (calibration + 1.0);
    let outside = calibration + 1.0 - inside;
    let ln_beta = |a: f64, b: f64| libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    let mut ln_probability = ln_beta(inside, outside + samples) - ln_beta(inside, outside);
    let (mut cumulative, mut lowest, mut count) = (ln_probability.exp(), None, 0.0);
    loop {
        if cumulative >= TAIL {
            lowest.get_or_insert(count);
        }
        if cumulative >= 1.0 - TAIL || count >= samples {
            return [lowest.unwrap_or(count) / samples, count / samples];
        }
        let left = samples - count;
        ln_probability += (left / (count + 1.0) * (inside + count) / (outside + left - 1.0)).ln();
        cumulative += ln_probability.exp();
        count += 1.0;
    }
}

/// Returns the conformal quantile of `scores` with the effective number of samples; `None` if there are too few.
///
/// The effective number refers to the events that a score is at least the quantile, since only these determine coverage.
fn conformal_quantile(scores: &[f64], evidence: &Evidence) -> Option<(f64, f64)> {
    let count = scores.len();
    let first = nth_smallest(scores, (Intervals::NOMINAL * count as f64).ceil() as usize);
    let is_large: Vec<f64> = scores
        .iter()
        .map(|score| f64::from(u8::from(*score >= first)))
        .collect();
    let effective = evidence.effective_samples(&is_large);
    if effective < Intervals::FEWEST_SAMPLES {
        return None;
    }
    let level = ((effective + 1.0) * Intervals::NOMINAL).ceil() / effective;
    let rank = ((level * count as f64).ceil() as usize).min(count);
    Some((nth_smallest(scores, rank), effective))
}

/// Returns the `rank`th smallest value, counted from 1.
fn nth_smallest(values: &[f64], rank: usize) -> f64 {
    let mut values = values.to_vec();
    let index = rank.clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

/// Returns the spread at each sample from a model that was fitted without its fold; `None` if a model cannot be fitted.
fn held_out_spreads(answers: &[f64], errors: &[f64], folds: &Folds, points: usize) -> Option<Vec<f64>> {
    let mut spreads = vec![0.0; errors.len()];
    for fold in 0..folds.count() {
        let points = spread_points(answers, errors, &folds.without(&[fold]), points)?;
        for &sample in folds.test(fold) {
            spreads[sample] = interpolate(&points, answers[sample]);
        }
    }
    Some(spreads)
}

/// Fits the mean absolute error as a function of the answer on `samples` (locally weighted conformal prediction: Lei,
/// G'Sell, Rinaldo, Tibshirani and Wasserman 2018, doi:10.1080/01621459.2017.1307116): the mean of each of `points`
/// parts of the samples with ascending answers, at least a tenth of the mean of all. Returns `None` for fewer than two
/// points, or if all errors are 0.
fn spread_points(answers: &[f64], errors: &[f64], samples: &[usize], points: usize) -> Option<Points> {
    let mut samples = samples.to_vec();
    samples.sort_by(|&one, &other| answers[one].total_cmp(&answers[other]));
    let mean = |part: &[usize], of: &[f64]| part.iter().map(|&sample| of[sample]).sum::<f64>() / part.len() as f64;
    let least = 0.1 * mean(&samples, errors);
    if points < 2 || samples.len() < points || least == 0.0 {
        return None;
    }
    let parts = samples.chunks(samples.len().div_ceil(points));
    let mut found: Points = parts
        .map(|part| [mean(part, answers), mean(part, errors).max(least)])
        .collect();
    found.dedup_by(|next, point| next[0] <= point[0]);
    (found.len() >= 2).then_some(found)
}

/// Interpolates linearly between `points`, constant beyond the ends.
fn interpolate(points: &[[f64; 2]], at: f64) -> f64 {
    let next = points.partition_point(|point| point[0] < at);
    if next == 0 {
        return points[0][1];
    }
    if next == points.len() {
        return points[next - 1][1];
    }
    let ([x0, y0], [x1, y1]) = (points[next - 1], points[next]);
    y0 + (y1 - y0) * (at - x0) / (x1 - x0)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{evaluation::cross_validation::scatter, scene::standard_normal};

    /// Synthetic relation y = 2x with noise, whose intervals are known.
    #[derive(Clone, Copy)]
    struct Truth {
        /// Correlation of the noise of neighbouring samples.
        memory: f64,
        /// Growth of the noise with x.
        growth: f64,
        samples: usize,
    }

    impl Truth {
        /// Draws samples in the order of time; the second target has five times the noise of the first.
        fn draw(self, samples: usize, rng: &mut ChaCha8Rng) -> Dataset {
            let mut noise = [standard_normal(rng), standard_normal(rng)];
            let mut readings = Array2::zeros((samples, 1));
            let mut targets = Array2::zeros((samples, 2));
            for sample in 0..samples {
                let x: f64 = rng.random();
                let spread = 0.1 * (1.0 + self.growth * x);
                readings[[sample, 0]] = x;
                for (target, noise) in noise.iter_mut().enumerate() {
                    let fresh = standard_normal(rng) * (1.0 - self.memory * self.memory).sqrt();
                    *noise = self.memory * *noise + fresh;
                    targets[[sample, target]] = 2.0 * x + spread * [1.0, 5.0][target] * *noise;
                }
            }
            Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
        }
    }

    /// Least-squares line of each target.
    fn fit(set: &Dataset) -> Vec<[f64; 2]> {
        let x = set.readings().column(0).to_vec();
        let count = x.len() as f64;
        let mean_x = x.iter().sum::<f64>() / count;
        let squares: f64 = x.iter().map(|x| (x - mean_x).powi(2)).sum();
        let line = |y: ArrayView1<'_, f64>| {
            let mean_y = y.sum() / count;
            let slope = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / squares;
            [mean_y - slope * mean_x, slope]
        };
        set.targets().columns().into_iter().map(line).collect()
    }

    fn answers(lines: &[[f64; 2]], set: &Dataset) -> Array2<f64> {
        Array2::from_shape_fn(set.targets().dim(), |(sample, target)| {
            lines[target][0] + lines[target][1] * set.readings()[[sample, 0]]
        })
    }

    /// Mean coverage of both targets on new samples over `repeats` sets, and share of shorter tests whose coverage is
    /// said to be too low.
    fn coverage(truth: Truth, repeats: u64) -> (f64, f64) {
        let (mut total, mut alarms, mut intervals_found) = (0.0, 0.0, 0.0);
        for seed in 0..repeats {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let set = truth.draw(truth.samples, &mut rng);
            let folds = Folds::by(&set, Intervals::FOLDS, SplitBy::Time, &mut rng).unwrap();
            let mut held_out = Array2::zeros(set.targets().dim());
            for fold in 0..folds.count() {
                let lines = fit(&set.select(&folds.without(&[fold])));
                let of_fold = answers(&lines, &set.select(folds.test(fold)));
                scatter(&mut held_out, folds.test(fold), &of_fold);
            }
            let intervals = Intervals::calibrate(&set, held_out.view(), SplitBy::Time);
            let lines = fit(&set);
            let new = truth.draw(2000, &mut rng);
            let short = truth.draw(truth.samples / 4, &mut rng);
            let many = intervals.coverage(&new, answers(&lines, &new).view(), SplitBy::Time);
            let few = intervals.coverage(&short, answers(&lines, &short).view(), SplitBy::Time);
            for (many, few) in many.iter().flatten().zip(few.iter().flatten()) {
                total += many.share;
                alarms += f64::from(u8::from(few.is_too_low()));
                intervals_found += 1.0;
            }
        }
        (total / intervals_found, alarms / intervals_found)
    }

    #[test]
    fn half_widths_follow_the_noise_only_if_it_varies() {
        let calibrate = |growth: f64| {
            let truth = Truth {
                memory: 0.0,
                growth,
                samples: 1000,
            };
            let set = truth.draw(truth.samples, &mut ChaCha8Rng::seed_from_u64(0));
            let answers = Array2::from_shape_fn((1000, 2), |(sample, _)| 2.0 * set.readings()[[sample, 0]]);
            Intervals::calibrate(&set, answers.view(), SplitBy::Time)
        };
        // The 90 % quantile of |noise| is 1.645 standard deviations: 0.1 and 0.5 without growth.
        let constant = calibrate(0.0);
        for (target, spread) in [0.1, 0.5].into_iter().enumerate() {
            let half_width = constant.targets[target].as_ref().unwrap();
            assert!(half_width.by_answer.is_empty(), "{half_width:?}");
            assert!(
                (half_width.constant / (1.645 * spread) - 1.0).abs() < 0.1,
                "{half_width:?}"
            );
        }
        // With growth, the standard deviation is 0.1 (1 + 5x) at the answer 2x.
        let growing = calibrate(5.0);
        for answer in [0.4, 1.0, 1.6] {
            let ratio = growing.half_width(0, answer).unwrap() / (0.1645 * (1.0 + 2.5 * answer));
            assert!((ratio - 1.0).abs() < 0.2, "{answer}: {ratio}");
        }
    }

    #[test]
    fn expected_shares_are_quantiles_of_the_beta_binomial_distribution() {
        // From scipy.stats.betabinom(test, 0.9 (n + 1), 0.1 (n + 1)).ppf([0.005, 0.995]) / test.
        for (test, calibration, expected) in [
            (10.0, 40.0, [0.5, 1.0]),
            (50.0, 200.0, [0.76, 1.0]),
            (400.0, 60.0, [0.77, 0.9775]),
            (2000.0, 3000.0, [0.877, 0.9215]),
        ] {
            let found = expected_shares(test, calibration);
            assert!(
                found
                    .iter()
                    .zip(expected)
                    .all(|(found, expected)| (found - expected).abs() < 1e-12),
                "{test} {calibration}: {found:?}"
            );
        }
    }

    #[test]
    fn too_few_samples_or_groups_have_no_interval() {
        let truth = Truth {
            memory: 0.0,
            growth: 0.0,
            samples: 8,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let few = truth.draw(8, &mut rng);
        assert!(Intervals::calibrate(&few, few.targets().mapv(|y| y + 1.0).view(), SplitBy::Time).is_empty());
        // Errors that differ only between three subjects.
        let set = truth.draw(300, &mut rng);
        let groups: Vec<usize> = (0..300).map(|sample| sample / 100).collect();
        let answers = Array2::from_shape_fn((300, 2), |(sample, _)| groups[sample] as f64);
        let set = Dataset::new(set.readings().to_owned(), Array2::zeros((300, 2)), None, groups).unwrap();
        let intervals = Intervals::calibrate(&set, answers.view(), SplitBy::Group);
        assert!(intervals.is_empty(), "{intervals:?}");
    }

    /// The mean over 200 sets and two targets has a standard error of about 0.3 %, 0.6 % with autocorrelation.
    #[test]
    fn new_samples_are_within_their_intervals_at_the_nominal_rate() {
        for (what, memory, growth, samples) in [
            ("independent noise", 0.0, 0.0, 200),
            ("few samples", 0.0, 0.0, 40),
            ("noise that grows with the reading", 0.0, 5.0, 400),
            ("autocorrelated noise", 0.9, 0.0, 600),
            ("autocorrelated noise, many samples", 0.9, 0.0, 3000),
            ("autocorrelated noise that grows", 0.9, 5.0, 1500),
        ] {
            let (share, alarms) = coverage(
                Truth {
                    memory,
                    growth,
                    samples,
                },
                200,
            );
            assert!((0.88..0.92).contains(&share), "{what}: {share}");
            assert!(alarms < 0.02, "{what}: {alarms}");
        }
    }
}
