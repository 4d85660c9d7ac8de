use super::{
    factor::{Factor, Ranges},
    gaussian::RowPosteriors,
    pack::{LANES, Pack},
};
use crate::decoupling::row_problem::Range;

/// Mean and variance of factors truncated to ranges.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments {
    pub(super) mean: Pack,
    pub(super) variance: Pack,
}

/// Number of quadrature intervals on either side of the middle; even.
const HALF: usize = 48;

/// The densities exp(slope t − ½ precision t²) between `middle` − HALF `step` and `middle` + HALF `step`, with t
/// relative to the mode within the range: the relevant part may be narrower than the rounding of positions.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    mode: Pack,
    /// 0, or directed out of the range.
    slope: Pack,
    precision: Pack,
    middle: Pack,
    step: Pack,
}

/// Densities at equal distances on both sides of the middle of a [`Cut`]. Each follows from the one before by a
/// factor, and the factor from the one before by another, which is constant: the density is the exponential of a
/// parabola.
struct Pairs {
    above: Pack,
    below: Pack,
    growth_above: Pack,
    growth_below: Pack,
    bend: Pack,
}

impl Cut {
    /// The relevant part of factors truncated to ranges.
    #[inline(always)]
    pub(super) fn new(factor: Factor<Pack>, ranges: &Ranges) -> Self {
        /// Densities below exp(−36) are neglected.
        const DECAY: f64 = 36.0;
        let precision = factor.precision.max(Pack::ZERO);
        let mode = ranges.clamp(factor.linear / precision);
        let slope = factor.linear - precision * mode;
        let twice = Pack::splat(2.0 * DECAY);
        let (falling, rising) = (slope.max(Pack::ZERO), (-slope).max(Pack::ZERO));
        let below = -(twice / (falling + (falling * falling + twice * precision).sqrt()));
        let above = twice / (rising + (rising * rising + twice * precision).sqrt());
        let lowest = below.max(ranges.lowest - mode);
        let highest = above.min(ranges.highest - mode);
        Self {
            mode,
            slope,
            precision,
            middle: Pack::splat(0.5) * (lowest + highest),
            step: Pack::splat(0.5 / HALF as f64) * (highest - lowest),
        }
    }

    /// Densities from the middle outwards, relative to the density in the middle.
    #[inline(always)]
    fn densities(&self) -> Pairs {
        let bend = self.precision * self.step * self.step;
        let along = self.step * (self.slope - self.precision * self.middle);
        // The density falls by at most exp(−36) over 96 steps: |along| ≤ 36/96 and bend ≤ 2·36/48².
        let growth_above = (along - Pack::splat(0.5) * bend).exp();
        let bend = (-bend).exp();
        Pairs {
            above: Pack::ONE,
            below: Pack::ONE,
            growth_above,
            growth_below: bend / growth_above,
            bend,
        }
    }

    /// Mean and variance by Simpson's rule. Positions are counted from the middle in steps, and so are the same for
    /// all lanes.
    #[inline(always)]
    pub(super) fn moments(self) -> Moments {
        let mut pairs = self.densities();
        let (mut odd, mut even) = (Sums::ZERO, Sums::ZERO);
        let mut place = 0.0;
        for _ in 0..HALF / 2 {
            pairs.step();
            place += 1.0;
            odd.add(&pairs, place);
            pairs.step();
            place += 1.0;
            even.add(&pairs, place);
        }
        // Simpson's weights, halved: 2 at odd positions, 1 at even ones, ½ at both ends.
        let mut ends = Sums::ZERO;
        ends.add(&pairs, place);
        let (two, half) = (Pack::splat(2.0), Pack::splat(0.5));
        let sum = |odd: Pack, even: Pack, ends: Pack| (two * odd + even) - half * ends;
        let total = sum(odd.total, even.total, ends.total) + Pack::ONE;
        let first = sum(odd.first, even.first, ends.first);
        let second = sum(odd.second, even.second, ends.second);
        let per_total = Pack::ONE / total;
        let mean = first * per_total;
        Moments {
            mean: self.mode + (self.middle + self.step * mean),
            variance: self.step * self.step * (second * per_total - mean * mean),
        }
    }

    /// Medians, by the trapezoidal rule; the means if they are not found.
    #[inline(always)]
    pub(super) fn medians(self, ranges: &Ranges, means: Pack) -> Pack {
        let mut densities = [Pack::ONE; 2 * HALF + 1];
        let mut pairs = self.densities();
        for place in 1..=HALF {
            pairs.step();
            densities[HALF + place] = pairs.above;
            densities[HALF - place] = pairs.below;
        }
        // Twice the areas below each point, in steps.
        let mut below = [Pack::ZERO; 2 * HALF + 1];
        for k in 0..2 * HALF {
            below[k + 1] = below[k] + (densities[k] + densities[k + 1]);
        }
        let half = Pack::splat(0.5) * below[2 * HALF];
        let mut medians = means - self.mode;
        for lane in 0..LANES {
            let half = half.get(lane);
            let above = below[1..].partition_point(|below| below.get(lane) < half);
            if half > 0.0 && above < 2 * HALF {
                let [least, most] = [above, above + 1].map(|k| below[k].get(lane));
                let steps = above as f64 - HALF as f64 + (half - least) / (most - least);
                medians.set(lane, self.middle.get(lane) + self.step.get(lane) * steps);
            }
        }
        ranges.clamp(self.mode + medians)
    }
}

impl Pairs {
    /// Advances to the densities one step further out.
    #[inline(always)]
    fn step(&mut self) {
        self.above *= self.growth_above;
        self.below *= self.growth_below;
        self.growth_above *= self.bend;
        self.growth_below *= self.bend;
    }
}

/// Sums of densities, and of their products with the positions and the squares of these.
struct Sums {
    total: Pack,
    first: Pack,
    second: Pack,
}

impl Sums {
    const ZERO: Self = Self {
        total: Pack::ZERO,
        first: Pack::ZERO,
        second: Pack::ZERO,
    };

    #[inline(always)]
    fn add(&mut self, pairs: &Pairs, place: f64) {
        let both = pairs.above + pairs.below;
        self.total += both;
        self.first += Pack::splat(place) * (pairs.above - pairs.below);
        self.second += Pack::splat(place * place) * both;
    }
}

/// A range and the Gaussian factor that approximates it, in every lane.
#[derive(Clone, Debug)]
pub(super) struct Site {
    ranges: Ranges,
    /// Reciprocals of the widths, for relative changes of means; 1 for open ranges.
    per_width: Pack,
    /// Variance of the noise added to the unknown before the range applies.
    noise: f64,
    pub(super) factor: Factor<Pack>,
    /// Cavity distribution of the unknown: the product of the equations and all other factors.
    cavity: Factor<Pack>,
    /// Moments of the cavity distribution truncated to the range.
    moments: Moments,
}

impl Site {
    pub(super) fn new(noise: f64) -> Self {
        Self {
            ranges: Ranges::NONE,
            per_width: Pack::ZERO,
            noise,
            factor: Factor::FLAT,
            cavity: Factor::FLAT,
            moments: Moments {
                mean: Pack::ZERO,
                variance: Pack::ZERO,
            },
        }
    }

    /// Starts in `lane` from `first`, or from the moments of the range alone; flat if it is open.
    pub(super) fn begin(&mut self, lane: usize, range: Range, first: Option<Factor>) {
        let width = range.width();
        let precision = 12.0 / (width * width);
        let by_itself = || {
            let linear = if precision > 0.0 {
                precision * range.middle()
            } else {
                0.0
            };
            let share = 1.0 / (1.0 + precision * self.noise);
            Factor {
                precision: precision * share,
                linear: linear * share,
            }
        };
        self.factor.set(lane, first.unwrap_or_else(by_itself));
        self.ranges.set(lane, range);
        self.per_width
            .set(lane, if width.is_finite() { 1.0 / width } else { 1.0 });
        self.moments.mean.set(lane, f64::INFINITY);
    }

    /// Updates the factor by `share` of the change that matches the moments of the truncated cavity distribution.
    /// `mean` and `variance` are those that `gaussians` returned for the last direction. Returns the change of the
    /// mean within the range, relative to the range, and 0, or NaN if numbers overflow.
    #[inline(always)]
    pub(super) fn update(
        &mut self,
        gaussians: &mut RowPosteriors,
        (mean, variance): (Pack, Pack),
        share: Pack,
    ) -> (Pack, Pack) {
        let before = self.factor;
        let per_variance = Pack::ONE / variance;
        let cavity = Factor {
            precision: per_variance - before.precision,
            linear: mean * per_variance - before.linear,
        };
        let cavity = cavity.blurred(self.noise);
        let moments = Cut::new(cavity, &self.ranges).moments();
        let per_variance = Pack::ONE / moments.variance;
        let found = Factor {
            precision: (per_variance - cavity.precision).max(Pack::ZERO),
            linear: moments.mean * per_variance - cavity.linear,
        };
        let found = found.blurred(self.noise);
        let change = Factor {
            precision: share * (found.precision - before.precision),
            linear: share * (found.linear - before.linear),
        };
        self.factor = Factor {
            precision: before.precision + change.precision,
            linear: before.linear + change.linear,
        };
        let moved = (moments.mean - self.moments.mean).abs() * self.per_width;
        (self.cavity, self.moments) = (cavity, moments);
        let left = gaussians.multiply(mean, variance, change);
        (moved, moments.variance.defects() + left.defects())
    }

    /// The factor as an equation: the square root of its precision in `lane`, and the right-hand side.
    pub(super) fn equation(&self, lane: usize) -> (f64, f64) {
        let Factor { precision, linear } = self.factor.get(lane);
        let root = precision.sqrt();
        (root, if root == 0.0 { 0.0 } else { linear / root })
    }

    /// Distribution within the range in `lane`.
    pub(super) fn marginal(&self, lane: usize, range: Range) -> Marginal {
        Marginal {
            mean: self.moments.mean.get(lane),
            variance: self.moments.variance.get(lane),
            range,
            cavity: self.cavity.get(lane),
            factor: self.factor.get(lane),
        }
    }
}

/// Marginal distribution of one unknown.
#[derive(Clone, Copy, Debug)]
pub(super) struct Marginal {
    pub(super) mean: f64,
    pub(super) variance: f64,
    pub(super) range: Range,
    /// Cavity distribution of the unknown, which is truncated to the range.
    pub(super) cavity: Factor,
    /// Factor that approximates the range.
    pub(super) factor: Factor,
}

/// Medians of the distributions: the answers with the minimum expected absolute error.
pub(super) fn medians(marginals: &[Marginal]) -> Vec<f64> {
    let mut medians = Vec::with_capacity(marginals.len());
    for some in marginals.chunks(LANES) {
        let (mut cavity, mut ranges, mut means) = (Factor::FLAT, Ranges::NONE, Pack::ZERO);
        for (lane, marginal) in some.iter().enumerate() {
            cavity.set(lane, marginal.cavity);
            ranges.set(lane, marginal.range);
            means.set(lane, marginal.mean);
        }
        let found = pulp::Arch::new().dispatch(|| Cut::new(cavity, &ranges).medians(&ranges, means));
        medians.extend((0..some.len()).map(|lane| found.get(lane)));
    }
    medians
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decoupling::row_problem::Range;

    const UNIT: Range = Range {
        lowest: 0.0,
        highest: 1.0,
    };

    /// Mean, variance and median of a factor truncated to a range, in the last lane next to other factors.
    fn cut(factor: Factor, range: Range) -> (f64, f64, f64) {
        let (mut factors, mut ranges) = (Factor::FLAT, Ranges::NONE);
        (0..LANES).for_each(|lane| ranges.set(lane, range));
        factors.set(LANES - 1, factor);
        for lane in 0..LANES - 1 {
            let precision = [f64::NAN, 1e300, 0.0][lane % 3];
            factors.set(lane, Factor { precision, ..factor });
        }
        let moments = Cut::new(factors, &ranges).moments();
        let median = Cut::new(factors, &ranges).medians(&ranges, moments.mean).get(LANES - 1);
        (moments.mean.get(LANES - 1), moments.variance.get(LANES - 1), median)
    }

    /// Moments of the uniform, of a whole normal and of an exponential distribution, all in closed form.
    #[test]
    fn moments_match_closed_forms() {
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
            let (found_mean, found_variance, _) = cut(factor, range);
            assert!(
                (found_mean - mean).abs() <= tolerance * mean.abs(),
                "{factor:?}: {found_mean}"
            );
            assert!(
                (found_variance / variance - 1.0).abs() <= tolerance,
                "{factor:?}: {found_variance}"
            );
        }
    }

    #[test]
    fn half_of_the_mass_is_below_the_median() {
        // exp(−5 t) from 0 to 1: half of 1 − e⁻⁵ is below.
        let factor = Factor {
            precision: 0.0,
            linear: -5.0,
        };
        let (_, _, median) = cut(factor, UNIT);
        let expected = -(1.0 - 0.5 * (1.0 - (-5.0_f64).exp())).ln() / 5.0;
        assert!((median - expected).abs() < 1e-4, "{median} {expected}");
    }
}
