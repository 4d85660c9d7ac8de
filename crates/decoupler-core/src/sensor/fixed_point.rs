/// Fixed-point grid fine enough for every coordinate of a row-wire, on which sums are exact.
///
/// A length is split into a multiple of the grid and what is left, each exactly (Rump, Ogita and Oishi, "Accurate
/// floating-point summation", SIAM J. Sci. Comput. 31, 2008). Multiples add without rounding, and what is left is so
/// small that its rounding does not count: differences of coordinates are right to the last place, even where they nearly
/// cancel.
#[derive(Clone, Copy, Debug)]
pub(super) struct FixedPoint {
    /// Three halves of a power of two above any length: adding it rounds to the grid.
    shift: f64,
}

/// Length as a multiple of a grid and what is left.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SplitLength {
    pub(super) upper: f64,
    pub(super) lower: f64,
}

impl FixedPoint {
    /// Returns the grid for lengths whose sums never exceed `bound`.
    pub(super) fn new(bound: f64) -> Self {
        let exponent = bound.to_bits() & f64::INFINITY.to_bits();
        // The power of two below `bound`, and four times as much.
        Self {
            shift: 6.0 * f64::from_bits(exponent),
        }
    }

    #[inline(always)]
    pub(super) fn split(self, length: f64) -> SplitLength {
        let upper = (length + self.shift) - self.shift;
        SplitLength {
            upper,
            lower: length - upper,
        }
    }

    /// Returns a + b.
    #[inline(always)]
    pub(super) fn sum(self, a: f64, b: f64) -> SplitLength {
        let (sum, rest) = two_sum(a, b);
        let SplitLength { upper, lower } = self.split(sum);
        SplitLength {
            upper,
            lower: lower + rest,
        }
    }
}

impl SplitLength {
    #[inline(always)]
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            upper: self.upper + other.upper,
            lower: self.lower + other.lower,
        }
    }

    /// Returns the length times a whole number.
    #[inline(always)]
    pub(super) fn times(self, count: f64) -> Self {
        Self {
            upper: self.upper * count,
            lower: self.lower * count,
        }
    }

    /// Returns the length, rounded once.
    #[inline(always)]
    pub(super) fn rounded(self) -> f64 {
        self.upper + self.lower
    }
}

/// Returns a + b, rounded, and the error of rounding, which is itself a number (Knuth, The Art of Computer Programming,
/// vol. 2, section 4.2.2).
#[inline(always)]
pub(super) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a double, 0.1 is 3602879701896397 / 2⁵⁵.
    #[test]
    fn multiples_keep_their_digits_where_sums_cancel() {
        let unit = 2.0_f64.powi(-55);
        for bound in [2.0, 1e3, 1e9] {
            let grid = FixedPoint::new(bound);
            let product = grid.split(0.1).times(11.0);
            let rest = product.plus(grid.split(-1.1)).rounded();
            let of_decimal = (1.1 / unit) as i64;
            assert_eq!(
                rest / unit,
                (11 * 3_602_879_701_896_397_i64 - of_decimal) as f64,
                "{bound}"
            );
        }
    }

    #[test]
    fn the_rest_of_a_sum_is_kept() {
        let grid = FixedPoint::new(10.0);
        assert_eq!(grid.sum(1.0, 1e-20).plus(grid.split(-1.0)).rounded(), 1e-20);
        assert_eq!(two_sum(1e17, 3.0), (1e17, 3.0));
    }
}
