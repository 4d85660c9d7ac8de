use crate::{decoupling::row_problem::Range, network::exp};

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

/// Mean and variance of a factor cut to a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments {
    pub(super) mean: f64,
    pub(super) variance: f64,
}

/// Densities side by side in vector registers.
const LANES: usize = 8;
/// Points of the quadrature, an even number of intervals.
const POINTS: usize = 97;
/// The points in whole registers.
const BLOCKS: usize = POINTS.div_ceil(LANES);
/// Simpson's weights, 0 beyond the last point.
const WEIGHTS: [[f64; LANES]; BLOCKS] = {
    let mut weights = [[0.0; LANES]; BLOCKS];
    let mut k = 0;
    while k < POINTS {
        weights[k / LANES][k % LANES] = if k == 0 || k == POINTS - 1 {
            1.0
        } else if k % 2 == 1 {
            4.0
        } else {
            2.0
        };
        k += 1;
    }
    weights
};

impl Factor {
    /// The factor of t + `shift`, in terms of t.
    pub(super) fn shifted(self, shift: f64) -> Self {
        Self {
            precision: self.precision,
            linear: self.linear - self.precision * shift,
        }
    }

    /// The factor of t if this is the factor of t + ε, with normal ε of variance `noise`.
    #[inline(always)]
    pub(super) fn blurred(self, noise: f64) -> Self {
        let share = 1.0 / (1.0 + self.precision.max(0.0) * noise);
        Self {
            precision: self.precision * share,
            linear: self.linear * share,
        }
    }

    /// Moments of the factor cut to a range, by Simpson's rule over the part that carries weight.
    #[inline(always)]
    pub(super) fn cut_to(self, range: Range) -> Moments {
        Cut::new(self, range).moments()
    }

    /// The marginal whose factor, cut to a range, has these `moments`.
    pub(super) fn marginal(self, range: Range, moments: Moments) -> Marginal {
        Marginal {
            mean: moments.mean,
            median: Cut::new(self, range).median(moments.mean),
            variance: moments.variance,
        }
    }
}

/// The density exp(slope t − ½ precision t²) at points `lowest` + `step` k, with t measured from the mode within the
/// range, where what carries weight may be narrower than the rounding of positions.
#[derive(Clone, Copy)]
struct Cut {
    range: Range,
    mode: f64,
    /// 0, or points out of the range.
    slope: f64,
    precision: f64,
    lowest: f64,
    step: f64,
}

impl Cut {
    #[inline(always)]
    fn new(factor: Factor, range: Range) -> Self {
        /// exp(−36) ends what carries weight.
        const DECAY: f64 = 36.0;
        let precision = factor.precision.max(0.0);
        let mode = range.clamp(factor.linear / precision);
        let slope = factor.linear - precision * mode;
        let reach = |slope: f64| 2.0 * DECAY / (slope + (slope * slope + 2.0 * DECAY * precision).sqrt());
        let lowest = (range.lowest - mode).max(-reach(slope.max(0.0)));
        let highest = (range.highest - mode).min(reach((-slope).max(0.0)));
        Self {
            range,
            mode,
            slope,
            precision,
            lowest,
            step: (highest - lowest) / (POINTS - 1) as f64,
        }
    }

    /// Each register follows from the one before by a factor, and the factor from the one before by another, which is the
    /// same for all: the density is the exponential of a parabola.
    #[inline(always)]
    fn moments(self) -> Moments {
        let Self { slope, precision, step, .. } = self;
        let stride = LANES as f64 * step;
        let mut t: [f64; LANES] = std::array::from_fn(|lane| self.lowest + step * lane as f64);
        let mut density = t.map(|t| exp(slope * t - 0.5 * precision * t * t));
        let mut growth = t.map(|t| exp(stride * (slope - precision * (t + 0.5 * stride))));
        let bend = exp(-precision * stride * stride);
        let (mut total, mut first, mut second) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (block, weights) in WEIGHTS.iter().enumerate() {
            let begin = self.lowest + stride * block as f64;
            for lane in 0..LANES {
                t[lane] = begin + step * lane as f64;
                let weight = weights[lane] * density[lane];
                let of_first = weight * t[lane];
                total[lane] += weight;
                first[lane] += of_first;
                second[lane] += of_first * t[lane];
                density[lane] *= growth[lane];
                growth[lane] *= bend;
            }
        }
        let (total, first, second) = (sum(total), sum(first), sum(second));
        let mean = first / total;
        Moments {
            mean: self.mode + mean,
            variance: second / total - mean * mean,
        }
    }

    /// The point below which half of the area under the density lies, by trapezoids; the mean where that is not found.
    fn median(self, mean: f64) -> f64 {
        let Self { slope, precision, lowest, step, .. } = self;
        let density: [f64; POINTS] = std::array::from_fn(|k| {
            let t = lowest + step * k as f64;
            (slope * t - 0.5 * precision * t * t).exp()
        });
        let trapezoid = |k: usize| 0.5 * (density[k] + density[k + 1]);
        let mut left = 0.5 * (0..POINTS - 1).map(trapezoid).sum::<f64>();
        let mut median = mean - self.mode;
        for k in 0..POINTS - 1 {
            if left <= trapezoid(k) {
                median = lowest + step * (k as f64 + left / trapezoid(k));
                break;
            }
            left -= trapezoid(k);
        }
        self.range.clamp(self.mode + median)
    }
}

#[inline(always)]
fn sum(lanes: [f64; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
