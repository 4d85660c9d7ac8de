use std::fmt;

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

    /// Half of the width of the interval.
    pub fn half_width(&self) -> f64 {
        0.5 * (self.high - self.low)
    }
}

impl fmt::Display for Interval {
    /// Writes `0.04 ± 0.03`, with decimals as given, or two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        // No -0.00.
        let places = 10.0_f64.powi(digits as i32);
        let value = (self.value * places).round() / places + 0.0;
        write!(f, "{value:.digits$} ± {:.digits$}", self.half_width())
    }
}
