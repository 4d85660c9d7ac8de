use crate::decoupling::row_problem::Range;

/// A Gaussian factor `exp(−½ precision t² + linear t)`, possibly flat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor {
    pub(super) precision: f64,
    pub(super) linear: f64,
}

/// The distribution of one unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Marginal {
    pub(super) mean: f64,
    /// Half lies below: the answer of the least expected distance.
    pub(super) median: f64,
    pub(super) variance: f64,
}

impl Factor {
    /// The factor of t if this is the factor of t + ε, with normal ε of variance `noise`.
    pub(super) fn blurred(self, noise: f64) -> Self {
        let share = 1.0 / (1.0 + self.precision.max(0.0) * noise);
        Self {
            precision: self.precision * share,
            linear: self.linear * share,
        }
    }

    /// Moments of the factor cut to a range, by Simpson's rule over the part that carries weight.
    pub(super) fn cut_to(self, range: Range) -> Marginal {
        /// exp(−36) ends what carries weight.
        const DECAY: f64 = 36.0;
        const POINTS: usize = 97;
        let precision = self.precision.max(0.0);
        let mode = range.clamp(self.linear / precision);
        // ln p at mode + t is slope t − ½ precision t²; the slope is 0 or points out of the range.
        let slope = self.linear - precision * mode;
        let reach = |slope: f64| 2.0 * DECAY / (slope + (slope * slope + 2.0 * DECAY * precision).sqrt());
        // Measured from the mode, where what carries weight may be narrower than the rounding of positions.
        let lowest = (range.lowest - mode).max(-reach(slope.max(0.0)));
        let highest = (range.highest - mode).min(reach((-slope).max(0.0)));
        let step = (highest - lowest) / (POINTS - 1) as f64;
        let mut density = [0.0; POINTS];
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for (k, density) in density.iter_mut().enumerate() {
            let t = lowest + step * k as f64;
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
        let mut median = mean;
        for k in 0..POINTS - 1 {
            if left <= trapezoid(k) {
                median = lowest + step * (k as f64 + left / trapezoid(k));
                break;
            }
            left -= trapezoid(k);
        }
        Marginal {
            mean: mode + mean,
            median: range.clamp(mode + median),
            variance: second / total - mean * mean,
        }
    }
}
