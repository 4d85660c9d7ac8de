use serde::{Deserialize, Serialize};

use super::{Coverage, Intervals};
use crate::{
    dataset::Folds,
    numerics::{Evidence, quantile},
};

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

/// Points (answer, spread of the error) of a piecewise linear function; one point is a constant.
type Points = Vec<[f64; 2]>;

impl HalfWidth {
    /// Minimum gain in the mean half-width for which the half-width varies with the answer.
    const MIN_GAIN: f64 = 0.03;
    /// Number of effective samples for each point of a half-width that varies with the answer.
    const SAMPLES_PER_POINT: f64 = 20.0;
    const MAX_POINTS: usize = 6;

    /// Calibrates on answers and their absolute errors; `folds` are those of a cross-validation of the varying half-width.
    pub(super) fn calibrate(
        answers: &[f64],
        errors: &[f64],
        folds: Option<&Folds>,
        evidence: &Evidence,
    ) -> Option<Self> {
        if errors.iter().any(|error| !error.is_finite()) {
            return None;
        }
        let (constant, effective_samples) = conformal_quantile(errors, evidence)?;
        let points = ((effective_samples / Self::SAMPLES_PER_POINT) as usize).min(Self::MAX_POINTS);
        let all = Vec::from_iter(0..errors.len());
        let scaled = folds.and_then(|folds| {
            let spreads = held_out_spreads(answers, errors, folds, points)?;
            let scores = Vec::from_iter(errors.iter().zip(&spreads).map(|(error, spread)| error / spread));
            // Mean half-widths at a coverage that is exactly the nominal one on the held-out samples.
            let mean_spread = spreads.iter().sum::<f64>() / spreads.len() as f64;
            let is_narrower = quantile(&scores, Intervals::NOMINAL) * mean_spread
                < (1.0 - Self::MIN_GAIN) * quantile(errors, Intervals::NOMINAL);
            let mut points = spread_points(answers, errors, &all, points)?;
            let (factor, effective_samples) = conformal_quantile(&scores, evidence).filter(|_| is_narrower)?;
            points.iter_mut().for_each(|[_, spread]| *spread *= factor);
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

    /// Measures the coverage of pairs (truth, answer) of test samples.
    pub(super) fn coverage(&self, pairs: &[(f64, f64)]) -> Coverage {
        /// Share of the errors within a quarter of the half-width that only distributions with few and very large errors
        /// exceed; 32 % for normal ones.
        const WITHIN_QUARTER: f64 = 0.6;
        /// Share of the effective samples that counts, since their number is an estimate.
        const SURE: f64 = 0.7;
        let count = pairs.len() as f64;
        let within = |factor: f64| {
            let is_within = |(truth, answer): &&(f64, f64)| (answer - truth).abs() <= factor * self.at(*answer);
            pairs.iter().filter(is_within).count() as f64 / count
        };
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        // Samples like those of the calibration are as dependent. Their own dependence would excuse what is to be found: the
        // misses of a test part that differs come together.
        let effective = (SURE * count * self.effective_samples / self.samples as f64).max(1.0);
        let [_, most] = expected_shares(WITHIN_QUARTER, effective, self.effective_samples);
        Coverage {
            share: within(1.0),
            half_width: mean(&|&(_, answer)| self.at(answer)),
            expected: expected_shares(Intervals::NOMINAL, effective, self.effective_samples),
            is_too_wide: within(0.25) > most,
            bias: mean(&|&(truth, answer)| answer - truth),
        }
    }
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

/// Returns the conformal quantile of `scores` and the effective number of samples m; `None` if there are too few.
///
/// The level p + (p − ½)/m makes the expected coverage p. For m independent samples, it is the p(m + 1)th smallest score,
/// as in conformal prediction. For correlated samples, it removes the bias of the p-quantile of a sample, which is half the
/// derivative of the variance u(1 − u)/m of the empirical distribution at u = p.
///
/// The effective number refers to the events that a score is at least the p-quantile, since only these determine coverage.
fn conformal_quantile(scores: &[f64], evidence: &Evidence) -> Option<(f64, f64)> {
    const P: f64 = Intervals::NOMINAL;
    let first = quantile(scores, P);
    let is_large: Vec<f64> = scores
        .iter()
        .map(|score| f64::from(u8::from(*score >= first)))
        .collect();
    let effective = evidence.effective_samples(&is_large);
    (effective >= Intervals::FEWEST_SAMPLES).then(|| (quantile(scores, P + (P - 0.5) / effective), effective))
}

/// Returns the lowest and the highest share of `test` effective samples within intervals of this `nominal` coverage that were
/// calibrated on `calibration` effective samples, with 99 % confidence.
///
/// The coverage of conformal intervals has a beta distribution, so the number of samples within them is beta-binomial
/// (Vovk 2012, arXiv:1209.2673). Its skewness matters for few samples.
pub(super) fn expected_shares(nominal: f64, test: f64, calibration: f64) -> [f64; 2] {
    const TAIL: f64 = 0.005;
    /// More samples do not change the shares noticeably.
    const MAX_SAMPLES: f64 = 10_000.0;
    let samples = test.floor().clamp(1.0, MAX_SAMPLES);
    let inside = nominal * (calibration + 1.0);
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
