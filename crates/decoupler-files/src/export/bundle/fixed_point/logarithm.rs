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
}
