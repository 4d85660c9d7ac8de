//! Sums and products of vectors of packs, in blocks that hide the latency of additions.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::network::exp;

/// Number of rows side by side.
pub(super) const LANES: usize = 4;

/// One value of each of several rows, side by side in a vector register.
///
/// Lanes never mix and no operation is fused: the result of a row has the same bits whatever the other lanes contain,
/// on every machine. Uses loops rather than maps, which are not compiled to vector registers.
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

    /// eˣ of each lane.
    #[inline(always)]
    pub(super) fn exp(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = exp(self.0[lane]);
        }
        self
    }

    /// Maximum of the two; `other` where one is NaN.
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

    /// Minimum of the two; `other` where one is NaN.
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

    /// Replaces NaN by `other`.
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

    /// Negates where `other` is above 0.
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

    /// 0 where the value is above 0 and finite, NaN elsewhere.
    #[inline(always)]
    pub(super) fn defects(mut self) -> Self {
        for lane in 0..LANES {
            let is_valid = (self.0[lane] > 0.0) & (self.0[lane] < f64::INFINITY);
            self.0[lane] = if is_valid { 0.0 } else { f64::NAN };
        }
        self
    }

    /// Maximum of the two; NaN where either is.
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

/// Number of entries of a block.
const STRANDS: usize = 4;

/// Sum of the products.
#[inline(always)]
pub(super) fn dot(a: &[Pack], b: &[Pack]) -> Pack {
    let ((blocks_a, rest_a), (blocks_b, rest_b)) = (a.as_chunks::<STRANDS>(), b.as_chunks::<STRANDS>());
    let mut sums = [Pack::ZERO; STRANDS];
    for (a, b) in blocks_a.iter().zip(blocks_b) {
        for strand in 0..STRANDS {
            sums[strand] += a[strand] * b[strand];
        }
    }
    for (strand, sum) in sums.iter_mut().enumerate().take(STRANDS - 1) {
        if let (Some(&a), Some(&b)) = (rest_a.get(strand), rest_b.get(strand)) {
            *sum += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Sums of the products of two vectors with a third.
#[inline(always)]
pub(super) fn dots([a, b]: [&[Pack]; 2], c: &[Pack]) -> [Pack; 2] {
    const STRANDS: usize = 2;
    let (blocks_a, rest_a) = a.as_chunks::<STRANDS>();
    let (blocks_b, rest_b) = b.as_chunks::<STRANDS>();
    let (blocks_c, rest_c) = c.as_chunks::<STRANDS>();
    let mut sums = [[Pack::ZERO; STRANDS]; 2];
    for ((a, b), c) in blocks_a.iter().zip(blocks_b).zip(blocks_c) {
        for strand in 0..STRANDS {
            sums[0][strand] += a[strand] * c[strand];
            sums[1][strand] += b[strand] * c[strand];
        }
    }
    if let ([a], [b], [c]) = (rest_a, rest_b, rest_c) {
        sums[0][0] += *a * *c;
        sums[1][0] += *b * *c;
    }
    [sums[0][0] + sums[0][1], sums[1][0] + sums[1][1]]
}

/// Adds a factor times `from` to each of two vectors.
#[inline(always)]
pub(super) fn add_to_both([a, b]: [&mut [Pack]; 2], factors: [Pack; 2], from: &[Pack]) {
    const STRANDS: usize = 2;
    let (blocks_a, rest_a) = a.as_chunks_mut::<STRANDS>();
    let (blocks_b, rest_b) = b.as_chunks_mut::<STRANDS>();
    let (blocks_from, rest_from) = from.as_chunks::<STRANDS>();
    for ((a, b), from) in blocks_a.iter_mut().zip(blocks_b).zip(blocks_from) {
        for strand in 0..STRANDS {
            a[strand] += factors[0] * from[strand];
            b[strand] += factors[1] * from[strand];
        }
    }
    if let ([a], [b], [from]) = (rest_a, rest_b, rest_from) {
        *a += factors[0] * *from;
        *b += factors[1] * *from;
    }
}

/// Adds `factor` times `from`; returns the sum of squares of the result.
#[inline(always)]
pub(super) fn add(to: &mut [Pack], factor: Pack, from: &[Pack]) -> Pack {
    let ((blocks_to, rest_to), (blocks_from, rest_from)) = (to.as_chunks_mut::<STRANDS>(), from.as_chunks::<STRANDS>());
    let mut sums = [Pack::ZERO; STRANDS];
    for (to, from) in blocks_to.iter_mut().zip(blocks_from) {
        for strand in 0..STRANDS {
            to[strand] += factor * from[strand];
            sums[strand] += to[strand] * to[strand];
        }
    }
    for (strand, sum) in sums.iter_mut().enumerate().take(STRANDS - 1) {
        if let (Some(to), Some(&from)) = (rest_to.get_mut(strand), rest_from.get(strand)) {
            *to += factor * from;
            *sum += *to * *to;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

#[cfg(test)]
mod tests {
    use super::{LANES, *};

    #[test]
    fn small_exponentials_agree_with_the_standard_library() {
        for k in -4000..=4000 {
            let x = f64::from(k) * 1e-4;
            let mut ours = Pack::splat(f64::NAN);
            ours.set(1, x);
            let ours = ours.exp();
            assert!((ours.get(1) / x.exp() - 1.0).abs() <= 2.0 * f64::EPSILON, "{x}");
            assert!(ours.get(0).is_nan());
        }
    }

    #[test]
    fn nan_is_kept_or_replaced_as_documented() {
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

    fn pack(value: impl Fn(usize) -> f64) -> Pack {
        let mut pack = Pack::ZERO;
        (0..LANES).for_each(|lane| pack.set(lane, value(lane)));
        pack
    }

    fn values(pack: Pack) -> Vec<f64> {
        (0..LANES).map(|lane| pack.get(lane)).collect()
    }

    /// Integers, whose sums are exact in any order.
    #[test]
    fn products_and_sums_are_exact_in_every_lane_for_any_length() {
        for length in 0..=11 {
            let vector = |seed: usize| -> Vec<Pack> {
                let entry = |place: usize| pack(|lane| ((7 * place + 5 * lane + seed) % 11) as f64 - 5.0);
                (0..length).map(entry).collect()
            };
            let [a, b, c] = [1, 3, 8].map(vector);
            let product = |a: &[Pack], b: &[Pack]| -> Vec<f64> {
                let of_lane = |lane: usize| a.iter().zip(b).map(|(a, b)| a.get(lane) * b.get(lane)).sum();
                (0..LANES).map(of_lane).collect()
            };
            assert_eq!(values(dot(&a, &b)), product(&a, &b));
            assert_eq!(dots([&a, &b], &c).map(values), [product(&a, &c), product(&b, &c)]);
            let factors = [pack(|lane| lane as f64), pack(|lane| 2.0 - lane as f64)];
            let sums = |to: &[Pack], factor: Pack| -> Vec<Vec<f64>> {
                to.iter().zip(&c).map(|(&to, &c)| values(to + factor * c)).collect()
            };
            let (mut added, mut first, mut second) = (a.clone(), a.clone(), b.clone());
            let squares = add(&mut added, factors[0], &c);
            add_to_both([&mut first, &mut second], factors, &c);
            let of = |packs: &[Pack]| -> Vec<Vec<f64>> { packs.iter().map(|&pack| values(pack)).collect() };
            assert_eq!(
                (of(&added), values(squares)),
                (sums(&a, factors[0]), product(&added, &added))
            );
            assert_eq!((of(&first), of(&second)), (sums(&a, factors[0]), sums(&b, factors[1])));
        }
    }
}
