use std::fmt;

use super::evidence::SumVariance;
use crate::numerics::{quantile, student_quantile};

/// Figure with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    pub(super) const FEWEST_UNITS: usize = 3;
    /// Maximum factor between an end and the figure; beyond it, the figure is not determined.
    const MAX_FACTOR: f64 = 100.0;

    /// Returns the interval of a positive ratio with sampling variance `spread`: a Student's t interval in the
    /// logarithm, in which the ratio of two sums of squares is nearly normal. `None` if the ratio is not determined.
    pub(super) fn of_ratio(ratio: f64, spread: SumVariance) -> Option<Self> {
        let reach = student_quantile(spread.freedom) * spread.variance.sqrt() / ratio;
        // False for NaN.
        let is_determined = ratio.is_finite() && ratio > 0.0 && reach <= Self::MAX_FACTOR.ln();
        (is_determined && spread.units >= Self::FEWEST_UNITS).then(|| Self {
            value: ratio,
            low: ratio * (-reach).exp(),
            high: ratio * reach.exp(),
        })
    }

    /// Returns the median and the percentile interval (Efron 1979) of `replicates`, ignoring NaN; `None` if fewer than half
    /// of the replicates remain.
    pub(super) fn of_replicates(replicates: &[f64]) -> Option<Self> {
        let finite = Vec::from_iter(replicates.iter().copied().filter(|value| value.is_finite()));
        (!finite.is_empty() && 2 * finite.len() >= replicates.len()).then(|| Self {
            value: quantile(&finite, 0.5),
            low: quantile(&finite, 0.025),
            high: quantile(&finite, 0.975),
        })
    }

    /// Minimum relative reduction of an error that justifies a more expensive model.
    const MIN_GAIN: f64 = 0.05;

    /// Returns `true` if this ratio of an error to another one is a reduction by at least 5 %, and significant.
    pub fn is_improvement(&self) -> bool {
        self.high < 1.0 && self.value <= 1.0 - Self::MIN_GAIN
    }

    /// Returns the interval of a monotonic function of the figure.
    #[must_use]
    pub(super) fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        let [low, high] = [self.low, self.high].map(&function);
        Self {
            value: function(self.value),
            low: low.min(high),
            high: low.max(high),
        }
    }
}

impl fmt::Display for Interval {
    /// Writes `0.04 (0.01 to 0.09)`, with the given number of decimals, or two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        // Avoids -0.00.
        let places = 10.0_f64.powi(digits as i32);
        let [value, low, high] =
            [self.value, self.low, self.high].map(|figure| (figure * places).round() / places + 0.0);
        write!(f, "{value:.digits$} ({low:.digits$} to {high:.digits$})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_ratio(ratio: f64, variance: f64, units: usize) -> Option<Interval> {
        let freedom = units as f64 - 1.0;
        let spread = SumVariance {
            variance,
            units,
            freedom,
        };
        Interval::of_ratio(ratio, spread)
    }

    #[test]
    fn an_interval_is_written_with_both_ends() {
        // t with 20 degrees of freedom is 2.086: e^(±0.2086).
        let interval = of_ratio(1.0, 0.01, 21).unwrap();
        assert_eq!(format!("{interval:.4}"), "1.0000 (0.8117 to 1.2319)");
        assert_eq!(interval.map(|ratio| 1.0 - ratio).to_string(), "0.00 (-0.23 to 0.19)");
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
}
