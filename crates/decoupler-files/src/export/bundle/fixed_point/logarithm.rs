/// Natural logarithm of whole numbers: a table between 1 and 2, and three terms of the series from its nearest entry
/// below.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct LogTable {
    /// ln(1 + i/256), with [`Self::FRACTION_BITS`] bits after the point.
    pub(in crate::export::bundle) values: Vec<i32>,
}

impl LogTable {
    /// Bits of the logarithm after the point.
    pub(in crate::export::bundle) const FRACTION_BITS: u32 = 26;
    /// Bits of the number after its first that select an entry.
    pub(in crate::export::bundle) const INDEX_BITS: u32 = 8;
    /// Bits of the quotient that the series takes.
    pub(in crate::export::bundle) const QUOTIENT_BITS: u32 = 30;
    /// ln 2, with ten bits more.
    pub(in crate::export::bundle) const LN_2: i64 = 47_632_711_549;
    /// Bits that ln 2 has more than the logarithm.
    pub(in crate::export::bundle) const LN_2_BITS: u32 = 10;
    /// Largest error of [`Self::of`]: the next term of the series, t⁴/4 with t < 1/256, the truncation of its terms in
    /// 2⁻³⁰, and the roundings of entry and multiple of ln 2 and the truncation of the series in the last bit.
    pub(in crate::export::bundle) const ERROR: f64 =
        1.0 / 4.0 / 4_294_967_296.0 + 4.0 / (1_u32 << Self::QUOTIENT_BITS) as f64 + 2.01 / Self::ONE;
    const ONE: f64 = (1_u32 << Self::FRACTION_BITS) as f64;

    pub(super) fn new() -> Self {
        let entries = 1 << Self::INDEX_BITS;
        let entry = |index: i32| (libm::log1p(f64::from(index) / f64::from(entries)) * Self::ONE).round() as i32;
        Self {
            values: (0..entries).map(entry).collect(),
        }
    }

    /// ln of a number above 0.
    pub(super) fn of(&self, number: i32) -> i32 {
        let exponent = 31 - number.leading_zeros();
        // The first bit of the number becomes bit 30.
        let normal = i64::from(number) << (30 - exponent);
        let rest = normal & ((1 << (30 - Self::INDEX_BITS)) - 1);
        let entry = normal - rest;
        let index = (entry >> (30 - Self::INDEX_BITS)) - (1 << Self::INDEX_BITS);
        let quotient = (rest << Self::QUOTIENT_BITS) / entry;
        let square = (quotient * quotient) >> Self::QUOTIENT_BITS;
        let cube = (square * quotient) >> Self::QUOTIENT_BITS;
        let series = (quotient - square / 2 + cube / 3) >> (Self::QUOTIENT_BITS - Self::FRACTION_BITS);
        let of_exponent = (i64::from(exponent) * Self::LN_2 + (1 << (Self::LN_2_BITS - 1))) >> Self::LN_2_BITS;
        (of_exponent + i64::from(self.values[index as usize]) + series) as i32
    }
}

/// Hyperbolic tangent of whole numbers: a table with linear interpolation.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct TangentTable {
    /// tanh at multiples of 2^(STEP_BITS − FRACTION_BITS), with [`Self::ACTIVATION_BITS`] bits after the point.
    pub(in crate::export::bundle) values: Vec<i16>,
}

impl TangentTable {
    /// Bits of the argument after the point.
    pub(in crate::export::bundle) const FRACTION_BITS: u32 = 16;
    /// Bits of an activation after the point.
    pub(in crate::export::bundle) const ACTIVATION_BITS: u32 = 15;
    /// Bits of the argument between two entries.
    pub(in crate::export::bundle) const STEP_BITS: u32 = 10;
    /// Largest argument: tanh 8 is 1 within 3e-7.
    pub(in crate::export::bundle) const LARGEST: i32 = 8 << Self::FRACTION_BITS;

    pub(super) fn new() -> Self {
        let one = f64::from(1 << Self::ACTIVATION_BITS);
        let step = f64::from(1 << Self::STEP_BITS) / f64::from(1 << Self::FRACTION_BITS);
        // One entry beyond the last, for the interpolation at the end.
        let entries = (Self::LARGEST >> Self::STEP_BITS) + 2;
        let entry = |index: i32| (libm::tanh(f64::from(index) * step) * one).round().min(one - 1.0) as i16;
        Self {
            values: (0..entries).map(entry).collect(),
        }
    }

    /// tanh of an argument from −[`Self::LARGEST`] to [`Self::LARGEST`].
    pub(super) fn of(&self, argument: i32) -> i16 {
        let size = argument.abs();
        let index = (size >> Self::STEP_BITS) as usize;
        let rest = size & ((1 << Self::STEP_BITS) - 1);
        let (low, high) = (i32::from(self.values[index]), i32::from(self.values[index + 1]));
        let half = 1 << (Self::STEP_BITS - 1);
        let value = low + (((high - low) * rest + half) >> Self::STEP_BITS);
        // The table ends at 2¹⁵ − 1.
        (if argument < 0 { -value } else { value }) as i16
    }

    /// Largest error of [`Self::of`] over all its arguments, and beyond them, where it stays at the last one.
    pub(in crate::export::bundle) fn error(&self) -> f64 {
        let one = f64::from(1 << Self::ACTIVATION_BITS);
        let scale = f64::from(1 << Self::FRACTION_BITS);
        let errors = (0..=Self::LARGEST).map(|argument| {
            let exact = libm::tanh(f64::from(argument) / scale);
            (f64::from(self.of(argument)) / one - exact).abs()
        });
        let beyond = 1.0 - f64::from(self.of(Self::LARGEST)) / one;
        errors.fold(beyond, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_within_its_error_everywhere() {
        let table = LogTable::new();
        let numbers = (1..3000).chain((1..40_000).map(|k| k * 53_687)).chain([i32::MAX]);
        let scale = f64::from(1 << LogTable::FRACTION_BITS);
        let mut largest = 0.0_f64;
        for number in numbers {
            largest = largest.max((f64::from(table.of(number)) / scale - f64::from(number).ln()).abs());
        }
        assert!(
            largest <= LogTable::ERROR && largest > 0.1 * LogTable::ERROR,
            "{largest}"
        );
    }

    /// Curvature |tanh″| ≤ 0.77 over steps of 1/64 gives 2.4e-5, and three roundings half a unit of 2⁻¹⁵ each at most.
    #[test]
    fn its_error_is_that_of_the_interpolation_and_of_sixteen_bits() {
        let table = TangentTable::new();
        assert!((3e-5..7.0e-5).contains(&table.error()), "{}", table.error());
        assert_eq!((table.of(0), table.of(TangentTable::LARGEST)), (0, i16::MAX));
        assert_eq!(table.of(-70_000), -table.of(70_000));
        assert!((1..=TangentTable::LARGEST).all(|argument| table.of(argument) >= table.of(argument - 1)));
    }
}
