use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::network;

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

    /// eˣ as [`network::exp`] gives it.
    #[inline(always)]
    pub(super) fn exp(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = network::exp(self.0[lane]);
        }
        self
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

    /// The magnitude of this with the sign that `other` has not.
    #[inline(always)]
    pub(super) fn against(mut self, other: Self) -> Self {
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
    pub(super) fn flaws(mut self) -> Self {
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

macro_rules! operator {
    ($operator:ident, $name:ident, $symbol:tt) => {
        impl $operator for Pack {
            type Output = Self;

            #[inline(always)]
            fn $name(mut self, other: Self) -> Self {
                for lane in 0..LANES {
                    self.0[lane] = self.0[lane] $symbol other.0[lane];
                }
                self
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl AddAssign for Pack {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Pack {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign for Pack {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
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

/// Sum of the products, in strands of fixed order, so that additions need not wait for each other.
#[inline(always)]
pub(super) fn dot(a: &[Pack], b: &[Pack]) -> Pack {
    const STRANDS: usize = 4;
    let ((blocks_a, rest_a), (blocks_b, rest_b)) = (a.as_chunks::<STRANDS>(), b.as_chunks::<STRANDS>());
    let mut sums = [Pack::ZERO; STRANDS];
    for (a, b) in blocks_a.iter().zip(blocks_b) {
        for strand in 0..STRANDS {
            sums[strand] += a[strand] * b[strand];
        }
    }
    for (strand, (&a, &b)) in rest_a.iter().zip(rest_b).enumerate() {
        sums[strand] += a * b;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
