use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// Rows side by side.
pub(super) const LANES: usize = 4;

/// One value of each of several rows, side by side in a vector register.
///
/// Lanes never mix and no operation is fused: a row has the same bits whatever the other lanes hold, on every machine.
/// Loops rather than maps, which are not compiled for vector registers.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Pack([f64; LANES]);

impl Pack {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
    pub(super) const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(super) fn get(self, lane: usize) -> f64 {
        self.0[lane]
    }

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }

    #[inline(always)]
    pub(super) fn sqrt(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = self.0[lane].sqrt();
        }
        self
    }

    #[inline(always)]
    pub(super) fn abs(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = self.0[lane].abs();
        }
        self
    }

    /// eˣ to within 2 units in the last place for |x| up to 0.4: Taylor's polynomial of degree 13, whose remainder is
    /// below 4e-17, in pairs of terms that need not wait for each other (Estrin 1960).
    #[inline(always)]
    pub(super) fn exp_of_small(self) -> Self {
        const fn inverse_factorial(of: u32) -> f64 {
            let (mut product, mut factor) = (1.0, 1);
            while factor <= of {
                product *= factor as f64;
                factor += 1;
            }
            1.0 / product
        }
        let x = self;
        let pair = |even: f64, odd: f64| Self::splat(even) + Self::splat(odd) * x;
        let of_2 = pair(const { inverse_factorial(2) }, const { inverse_factorial(3) });
        let of_4 = pair(const { inverse_factorial(4) }, const { inverse_factorial(5) });
        let of_6 = pair(const { inverse_factorial(6) }, const { inverse_factorial(7) });
        let of_8 = pair(const { inverse_factorial(8) }, const { inverse_factorial(9) });
        let of_10 = pair(const { inverse_factorial(10) }, const { inverse_factorial(11) });
        let of_12 = pair(const { inverse_factorial(12) }, const { inverse_factorial(13) });
        let x2 = x * x;
        let x4 = x2 * x2;
        let x8 = x4 * x4;
        let tail = (of_2 + x2 * of_4) + x4 * (of_6 + x2 * of_8) + x8 * (of_10 + x2 * of_12);
        Self::ONE + (x + x2 * tail)
    }

    /// The larger of the two; `other` where one is NaN.
    #[inline(always)]
    pub(super) fn max(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = if self.0[lane] > other.0[lane] {
                self.0[lane]
            } else {
                other.0[lane]
            };
        }
        self
    }

    /// The smaller of the two; `other` where one is NaN.
    #[inline(always)]
    pub(super) fn min(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = if self.0[lane] < other.0[lane] {
                self.0[lane]
            } else {
                other.0[lane]
            };
        }
        self
    }

    /// `other` where this is NaN.
    #[inline(always)]
    pub(super) fn unless_nan(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = if self.0[lane].is_nan() {
                other.0[lane]
            } else {
                self.0[lane]
            };
        }
        self
    }

    /// This, negated where `other` is above 0.
    #[inline(always)]
    pub(super) fn negated_where_positive(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = if other.0[lane] > 0.0 {
                -self.0[lane]
            } else {
                self.0[lane]
            };
        }
        self
    }

    /// 0 where this is above 0 and finite, NaN elsewhere.
    #[inline(always)]
    pub(super) fn defects(mut self) -> Self {
        for lane in 0..LANES {
            let is_sound = (self.0[lane] > 0.0) & (self.0[lane] < f64::INFINITY);
            self.0[lane] = if is_sound { 0.0 } else { f64::NAN };
        }
        self
    }

    /// The larger of the two; NaN where either is.
    #[inline(always)]
    pub(super) fn max_or_nan(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            let is_new = (other.0[lane] > self.0[lane]) | other.0[lane].is_nan();
            self.0[lane] = if is_new { other.0[lane] } else { self.0[lane] };
        }
        self
    }
}

macro_rules! operators {
    ($($operator:ident $name:ident, $assigning:ident $assign:ident $symbol:tt;)*) => {$(
        impl $assigning for Pack {
            #[inline(always)]
            fn $assign(&mut self, other: Self) {
                for lane in 0..LANES {
                    self.0[lane] $symbol other.0[lane];
                }
            }
        }

        impl $operator for Pack {
            type Output = Self;

            #[inline(always)]
            fn $name(mut self, other: Self) -> Self {
                self.$assign(other);
                self
            }
        }
    )*};
}

operators! {
    Add add, AddAssign add_assign +=;
    Sub sub, SubAssign sub_assign -=;
    Mul mul, MulAssign mul_assign *=;
    Div div, DivAssign div_assign /=;
}

impl Neg for Pack {
    type Output = Self;

    #[inline(always)]
    fn neg(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = -self.0[lane];
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_exponentials_agree_with_the_standard_library() {
        for k in -4000..=4000 {
            let x = f64::from(k) * 1e-4;
            let mut ours = Pack::splat(f64::NAN);
            ours.set(1, x);
            let ours = ours.exp_of_small();
            assert!((ours.get(1) / x.exp() - 1.0).abs() <= 2.0 * f64::EPSILON, "{x}");
            assert!(ours.get(0).is_nan());
        }
    }

    #[test]
    fn what_is_no_number_is_kept_or_replaced_as_it_is_said() {
        let (one, nan) = (Pack::ONE, Pack::splat(f64::NAN));
        assert_eq!(
            [nan.max(one), nan.min(one), nan.unless_nan(one)].map(|pack| pack.get(0)),
            [1.0; 3]
        );
        assert!(
            [one.max(nan), one.min(nan), one.max_or_nan(nan), nan.max_or_nan(one)]
                .iter()
                .all(|pack| pack.get(0).is_nan())
        );
        let defective = [0.0, -1.0, f64::INFINITY, f64::NAN];
        assert!(
            defective
                .iter()
                .all(|&value| Pack::splat(value).defects().get(0).is_nan())
        );
        assert_eq!(Pack::splat(1e-300).defects().get(0), 0.0);
        let negated = [(2.0, 3.0), (2.0, -3.0), (2.0, 0.0)]
            .map(|(a, b)| Pack::splat(a).negated_where_positive(Pack::splat(b)).get(0));
        assert_eq!(negated, [-2.0, 2.0, 2.0]);
    }
}
