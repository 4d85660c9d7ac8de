use crate::{decoupling::row_problem::Range, network::exp};

/// A Gaussian factor `exp(−½ precision t² + linear t)`, possibly flat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor {
    pub(super) precision: f64,
    pub(super) linear: f64,
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

    /// Median of the factor cut to a range, within which its mean is `mean`.
    pub(super) fn median(self, range: Range, mean: f64) -> f64 {
        Cut::new(self, range).median(mean)
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
        let Self {
            slope, precision, step, ..
        } = self;
        let stride = LANES as f64 * step;
        // Loops, for what is mapped is not compiled for vector registers.
        let (mut density, mut growth) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let t = self.lowest + step * lane as f64;
            density[lane] = slope * t - 0.5 * precision * t * t;
            growth[lane] = stride * (slope - precision * (t + 0.5 * stride));
        }
        for lane in 0..LANES {
            density[lane] = exp(density[lane]);
            growth[lane] = exp(growth[lane]);
        }
        let bend = exp(-precision * stride * stride);
        let (mut total, mut first, mut second) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (block, weights) in WEIGHTS.iter().enumerate() {
            let begin = self.lowest + stride * block as f64;
            for lane in 0..LANES {
                let t = begin + step * lane as f64;
                let weight = weights[lane] * density[lane];
                let of_first = weight * t;
                total[lane] += weight;
                first[lane] += of_first;
                second[lane] += of_first * t;
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
        let Self {
            slope,
            precision,
            lowest,
            step,
            ..
        } = self;
        let mut density = [0.0; POINTS];
        pulp::Arch::new().dispatch(|| {
            for (k, density) in density.iter_mut().enumerate() {
                let t = lowest + step * k as f64;
                *density = exp(slope * t - 0.5 * precision * t * t);
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Range = Range {
        lowest: 0.0,
        highest: 1.0,
    };

    /// Moments of the uniform, of a whole normal and of an exponential distribution, all in closed form.
    #[test]
    fn factors_without_a_cut_on_both_sides_have_the_moments_of_their_distributions() {
        let factor = |precision, linear| Factor { precision, linear };
        let wide = Range {
            lowest: -1e3,
            highest: 1e3,
        };
        let above = Range {
            lowest: 2.0,
            highest: 1e9,
        };
        for (factor, range, mean, variance, tolerance) in [
            (factor(0.0, 0.0), UNIT, 0.5, 1.0 / 12.0, 1e-13),
            (factor(1e-9, 0.0), UNIT, 0.5, 1.0 / 12.0, 1e-9),
            (factor(1e4, 3e3), UNIT, 0.3, 1e-4, 1e-9),
            (factor(4.0, -8.0), wide, -2.0, 0.25, 1e-9),
            (factor(0.0, -5.0), above, 2.2, 0.04, 2e-3),
        ] {
            let moments = factor.cut_to(range);
            assert!(
                (moments.mean - mean).abs() <= tolerance * mean.abs(),
                "{factor:?}: {moments:?}"
            );
            assert!(
                (moments.variance / variance - 1.0).abs() <= tolerance,
                "{factor:?}: {moments:?}"
            );
        }
    }

    #[test]
    fn half_lies_below_the_median() {
        // exp(−5 t) from 0 to 1: half of 1 − e⁻⁵ lies below.
        let factor = Factor {
            precision: 0.0,
            linear: -5.0,
        };
        let median = factor.median(UNIT, factor.cut_to(UNIT).mean);
        let expected = -(1.0 - 0.5 * (1.0 - (-5.0_f64).exp())).ln() / 5.0;
        assert!((median - expected).abs() < 1e-4, "{median} {expected}");
    }

    #[test]
    fn a_shifted_factor_is_the_same_function_of_its_place() {
        let factor = Factor {
            precision: 3.0,
            linear: 1.5,
        };
        let log = |factor: Factor, t: f64| factor.linear * t - 0.5 * factor.precision * t * t;
        let shifted = factor.shifted(0.7);
        // Up to a constant.
        let difference = |t: f64| log(factor, t + 0.7) - log(shifted, t);
        assert!((difference(-2.0) - difference(5.0)).abs() < 1e-12);
    }
}
