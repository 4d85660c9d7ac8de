use super::{
    gaussian::{Direction, Gaussian},
    marginal::Marginal,
    truncated::{Factor, Moments},
};
use crate::decoupling::row_problem::Range;

/// A range and the Gaussian factor that stands for it.
pub(super) struct Site<'a> {
    direction: Direction<'a>,
    pub(super) range: Range,
    /// Variance of what is added to the unknown before it meets the range.
    noise: f64,
    pub(super) factor: Factor,
    /// The word of the other factors and of the equations on the unknown.
    seen: Factor,
    /// Moments of that within the range.
    moments: Moments,
}

impl<'a> Site<'a> {
    /// Begins with the moments of the range by itself; with none if it is open.
    pub(super) fn new(direction: Direction<'a>, range: Range, noise: f64) -> Self {
        let precision = 12.0 / (range.width() * range.width());
        let factor = if precision > 0.0 {
            Factor {
                precision,
                linear: precision * range.middle(),
            }
        } else {
            Factor {
                precision: 0.0,
                linear: 0.0,
            }
        };
        Self {
            direction,
            range,
            noise,
            factor: factor.blurred(noise),
            seen: Factor {
                precision: 0.0,
                linear: 0.0,
            },
            moments: Moments {
                mean: f64::INFINITY,
                variance: f64::INFINITY,
            },
        }
    }

    /// Changes the factor by `share` of what makes the marginal keep its moments within the range. False if numbers
    /// overflow.
    #[inline(always)]
    pub(super) fn meet_range(&mut self, gaussian: &mut Gaussian, share: f64) -> bool {
        let (mean, variance) = gaussian.marginal(self.direction);
        let before = self.factor;
        let cavity = Factor {
            precision: 1.0 / variance - before.precision,
            linear: mean / variance - before.linear,
        };
        let seen = cavity.blurred(self.noise);
        let moments = seen.cut_to(self.range);
        if !(moments.variance > 0.0 && moments.variance.is_finite()) {
            return false;
        }
        let found = Factor {
            precision: (1.0 / moments.variance - seen.precision).max(0.0),
            linear: moments.mean / moments.variance - seen.linear,
        };
        let found = found.blurred(self.noise);
        let by_precision = share * (found.precision - before.precision);
        let by_linear = share * (found.linear - before.linear);
        self.factor = Factor {
            precision: before.precision + by_precision,
            linear: before.linear + by_linear,
        };
        (self.seen, self.moments) = (seen, moments);
        gaussian.multiply(mean, variance, by_precision, by_linear)
    }

    /// Appends the factor as one more equation.
    pub(super) fn append_to(&self, equations: &mut Vec<f64>, unknowns: usize) {
        let root = self.factor.precision.sqrt();
        if root == 0.0 {
            return;
        }
        match self.direction {
            Direction::Unknown(place) => {
                equations.extend((0..unknowns).map(|unknown| if unknown == place { root } else { 0.0 }));
            }
            Direction::Form(form) => equations.extend(form.iter().map(|value| root * value)),
        }
        equations.push(self.factor.linear / root);
    }

    /// Mean within the range.
    #[inline(always)]
    pub(super) fn mean(&self) -> f64 {
        self.moments.mean
    }

    /// Distribution within the range.
    pub(super) fn marginal(&self) -> Marginal {
        Marginal {
            mean: self.moments.mean,
            variance: self.moments.variance,
            range: self.range,
            seen: self.seen,
            factor: self.factor,
        }
    }
}
