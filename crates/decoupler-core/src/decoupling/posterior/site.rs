use super::{
    factor::{Factor, Ranges},
    gaussian::Gaussians,
    marginal::Marginal,
    pack::Pack,
    truncated::{Cut, Moments},
};
use crate::decoupling::row_problem::Range;

/// A range and the Gaussian factor that stands for it, in every lane.
#[derive(Clone, Debug)]
pub(super) struct Site {
    ranges: Ranges,
    /// Reciprocals of the widths, by which changes of means are measured; 1 for open ranges.
    per_width: Pack,
    /// Variance of what is added to the unknown before it meets the range.
    noise: f64,
    pub(super) factor: Factor<Pack>,
    /// The word of the other factors and of the equations on the unknown.
    seen: Factor<Pack>,
    /// Moments of that within the range.
    moments: Moments,
}

impl Site {
    pub(super) fn new(noise: f64) -> Self {
        Self {
            ranges: Ranges::NONE,
            per_width: Pack::ZERO,
            noise,
            factor: Factor::FLAT,
            seen: Factor::FLAT,
            moments: Moments {
                mean: Pack::ZERO,
                variance: Pack::ZERO,
            },
        }
    }

    /// Begins in `lane` with `first`, or with the moments of the range by itself; with none if it is open.
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

    /// Changes the factor by `share` of what makes the marginal keep its moments within the range. `mean` and `variance` are
    /// those that `gaussians` have along the direction of the last question. Returns by how much the mean within the range
    /// moved, in proportion to the range, and 0, or NaN where numbers overflow.
    #[inline(always)]
    pub(super) fn meet_range(
        &mut self,
        gaussians: &mut Gaussians,
        (mean, variance): (Pack, Pack),
        share: Pack,
    ) -> (Pack, Pack) {
        let before = self.factor;
        let per_variance = Pack::ONE / variance;
        let seen = Factor {
            precision: per_variance - before.precision,
            linear: mean * per_variance - before.linear,
        };
        let seen = seen.blurred(self.noise);
        let moments = Cut::new(seen, &self.ranges).moments();
        let per_variance = Pack::ONE / moments.variance;
        let found = Factor {
            precision: (per_variance - seen.precision).max(Pack::ZERO),
            linear: moments.mean * per_variance - seen.linear,
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
        (self.seen, self.moments) = (seen, moments);
        let left = gaussians.multiply(mean, variance, change);
        (moved, moments.variance.defects() + left.defects())
    }

    /// The square root of the factor's precision in `lane`, and what it equals times the unknown: the factor as an equation.
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
            seen: self.seen.get(lane),
            factor: self.factor.get(lane),
        }
    }
}
