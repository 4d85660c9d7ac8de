use super::pack::Pack;
use crate::decoupling::row_problem::Range;

/// A Gaussian factor `exp(−½ precision t² + linear t)`, possibly flat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor<T = f64> {
    pub(super) precision: T,
    pub(super) linear: T,
}

/// Ranges side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ranges {
    pub(super) lowest: Pack,
    pub(super) highest: Pack,
    middle: Pack,
}

impl Factor {
    /// The factor of t + `shift`, in terms of t.
    pub(super) fn shifted(self, shift: f64) -> Self {
        Self {
            precision: self.precision,
            linear: self.linear - self.precision * shift,
        }
    }
}

impl Factor<Pack> {
    pub(super) const FLAT: Self = Self {
        precision: Pack::ZERO,
        linear: Pack::ZERO,
    };

    pub(super) fn set(&mut self, lane: usize, factor: Factor) {
        self.precision.set(lane, factor.precision);
        self.linear.set(lane, factor.linear);
    }

    pub(super) fn get(&self, lane: usize) -> Factor {
        Factor {
            precision: self.precision.get(lane),
            linear: self.linear.get(lane),
        }
    }

    /// The factors of t if these are the factors of t + ε, with normal ε of variance `noise`.
    #[inline(always)]
    pub(super) fn blurred(self, noise: f64) -> Self {
        if noise == 0.0 {
            return self;
        }
        let share = Pack::ONE / (Pack::ONE + self.precision.max(Pack::ZERO) * Pack::splat(noise));
        Self {
            precision: self.precision * share,
            linear: self.linear * share,
        }
    }
}

impl Ranges {
    /// Ranges of no width at 0.
    pub(super) const NONE: Self = Self {
        lowest: Pack::ZERO,
        highest: Pack::ZERO,
        middle: Pack::ZERO,
    };

    pub(super) fn set(&mut self, lane: usize, range: Range) {
        self.lowest.set(lane, range.lowest);
        self.highest.set(lane, range.highest);
        self.middle.set(lane, range.middle());
    }

    /// The nearest values within the ranges; their middles for NaN.
    #[inline(always)]
    pub(super) fn clamp(&self, values: Pack) -> Pack {
        let raised = self.lowest.max(values);
        self.highest.min(raised).unless_nan(self.middle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
