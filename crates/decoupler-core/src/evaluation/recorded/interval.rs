use std::fmt;

use super::evidence::SumVariance;

/// A figure with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The figure itself, on all samples.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Fewest independent units for an interval.
    pub(super) const FEWEST_UNITS: usize = 3;
    /// Largest factor by which an end may differ from the figure: beyond it, the figure is not determined.
    const LARGEST_FACTOR: f64 = 100.0;

    /// Returns the interval of a positive ratio whose sampling variance is `spread`: Student's, symmetric in the logarithm,
    /// in which the ratio of two sums of squares is nearly normal. `None` if that determines nothing.
    pub(super) fn of_ratio(ratio: f64, spread: SumVariance) -> Option<Self> {
        let reach = student_quantile(spread.freedom) * spread.variance.sqrt() / ratio;
        // Not for NaN either.
        let is_determined = ratio.is_finite() && ratio > 0.0 && reach <= Self::LARGEST_FACTOR.ln();
        (is_determined && spread.units >= Self::FEWEST_UNITS).then(|| Self {
            value: ratio,
            low: ratio * (-reach).exp(),
            high: ratio * reach.exp(),
        })
    }

    /// Returns the percentile interval (Efron 1979) of `replicates`, of which those that are no number are left out;
    /// `None` if the figure itself is none, or fewer than half of the replicates are left.
    pub(super) fn of_replicates(value: f64, replicates: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = replicates.iter().copied().filter(|value| value.is_finite()).collect();
        if !value.is_finite() || 2 * sorted.len() < replicates.len() || sorted.is_empty() {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64).round() as usize];
        Some(Self {
            value,
            // Few replicates may all lie on one side.
            low: at(0.025).min(value),
            high: at(0.975).max(value),
        })
    }

    /// The interval of a monotonic function of the figure.
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
    /// Writes `0.04 (0.01 to 0.09)`, with decimals as given, or two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        // No -0.00.
        let places = 10.0_f64.powi(digits as i32);
        let [value, low, high] =
            [self.value, self.low, self.high].map(|figure| (figure * places).round() / places + 0.0);
        write!(f, "{value:.digits$} ({low:.digits$} to {high:.digits$})")
    }
}

/// 97.5 % quantile of Student's t with this many degrees of freedom, 2 or more, not necessarily whole: Hill 1970, algorithm
/// 396 (doi:10.1145/355598.355600), within 3e-4 of the exact value.
pub(super) fn student_quantile(freedom: f64) -> f64 {
    /// Probability beyond the quantile, on both sides.
    const TAILS: f64 = 0.05;
    const NORMAL_QUANTILE: f64 = -1.959_963_984_540_054;
    let a = 1.0 / (freedom - 0.5);
    let b = 48.0 / (a * a);
    let mut c = ((20_700.0 * a / b - 98.0) * a - 16.0) * a + 96.36;
    let d = ((94.5 / (b + c) - 3.0) / b + 1.0) * (0.5 * a * std::f64::consts::PI).sqrt() * freedom;
    let mut y = (d * TAILS).powf(2.0 / freedom);
    if y > 0.05 + a {
        let x = NORMAL_QUANTILE;
        y = x * x;
        if freedom < 5.0 {
            c += 0.3 * (freedom - 4.5) * (x + 0.6);
        }
        c += (((0.05 * d * x - 5.0) * x - 7.0) * x - 2.0) * x + b;
        y = (((((0.4 * y + 6.3) * y + 36.0) * y + 94.5) / c - y - 3.0) / b + 1.0) * x;
        y = (a * y * y).exp_m1();
    } else {
        let n = freedom;
        y = ((1.0 / (((n + 6.0) / (n * y) - 0.089 * d - 0.822) * (n + 2.0) * 3.0) + 0.5 / (n + 4.0)) * y - 1.0)
            * (n + 1.0)
            / (n + 2.0)
            + 1.0 / y;
    }
    (freedom * y).sqrt()
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
    fn an_interval_is_written_with_both_of_its_ends() {
        // t of 20 degrees of freedom is 2.086: e^(±0.2086).
        let interval = of_ratio(1.0, 0.01, 21).unwrap();
        assert_eq!(format!("{interval:.4}"), "1.0000 (0.8117 to 1.2319)");
        assert_eq!(interval.map(|ratio| 1.0 - ratio).to_string(), "0.00 (-0.23 to 0.19)");
    }

    #[test]
    fn what_determines_nothing_has_no_interval() {
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

    #[test]
    fn quantiles_are_those_of_scipy() {
        for (freedom, expected) in [
            (2.0, 4.302_652_729_749_462),
            (2.3, 3.807_163_208_232_131),
            (3.0, 3.182_446_305_283_707_8),
            (5.0, 2.570_581_835_636_314_6),
            (9.0, 2.262_157_162_798_204_4),
            (20.0, 2.085_963_447_265_864),
            (100.0, 1.983_971_518_523_551_8),
            (1e9, 1.959_963_986_912_6),
        ] {
            let found = student_quantile(freedom);
            assert!((found / expected - 1.0).abs() < 5e-4, "{freedom}: {found}");
        }
    }
}
