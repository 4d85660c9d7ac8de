use super::Intervals;
use crate::numerics::{Evidence, quantile};

/// Returns the conformal quantile of `scores` and the effective number of samples m; `None` if there are too few.
///
/// The level p + (p − ½)/m makes the expected coverage p. For m independent samples, it is the p(m + 1)th smallest score,
/// as in conformal prediction. For correlated samples, it removes the bias of the p-quantile of a sample, which is half the
/// derivative of the variance u(1 − u)/m of the empirical distribution at u = p.
///
/// The effective number refers to the events that a score is at least the p-quantile, since only these determine coverage.
pub(super) fn conformal_quantile(scores: &[f64], evidence: &Evidence) -> Option<(f64, f64)> {
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
