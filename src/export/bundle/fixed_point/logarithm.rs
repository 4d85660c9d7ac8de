/// Binary logarithm of whole numbers: a table with linear interpolation between 1 and 2.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct LogTable {
    /// log₂(1 + i/256), with [`Self::FRACTION_BITS`] bits after the point.
    pub(in crate::export::bundle) values: Vec<i32>,
}

impl LogTable {
    /// Bits of the logarithm after the point.
    pub(in crate::export::bundle) const FRACTION_BITS: u32 = 26;
    /// Bits of the number after its first that select an entry.
    pub(in crate::export::bundle) const INDEX_BITS: u32 = 8;
    /// Largest error of [`Self::of`]: the chord of log₂ over a step h lies at most h²/(8 ln 2) below, and entry and
    /// interpolation are rounded.
    pub(in crate::export::bundle) const ERROR: f64 = {
        let step = 1.0 / (1 << Self::INDEX_BITS) as f64;
        step * step / 8.0 / std::f64::consts::LN_2 + 2.0 / (1_u32 << Self::FRACTION_BITS) as f64
    };

    pub(super) fn new() -> Self {
        let entries = 1 << Self::INDEX_BITS;
        let scale = f64::from(1 << Self::FRACTION_BITS);
        let entry = |index: i32| (libm::log2(1.0 + f64::from(index) / f64::from(entries)) * scale).round() as i32;
        Self {
            values: (0..=entries).map(entry).collect(),
        }
    }

    /// log₂ of a number above 0.
    pub(super) fn of(&self, number: i32) -> i32 {
        let exponent = 31 - number.leading_zeros() as i32;
        // The first bit of the number becomes bit 30.
        let normal = number << (30 - exponent);
        let index = ((normal >> (30 - Self::INDEX_BITS)) & ((1 << Self::INDEX_BITS) - 1)) as usize;
        let rest = i64::from(normal & ((1 << (30 - Self::INDEX_BITS)) - 1));
        let (low, high) = (i64::from(self.values[index]), i64::from(self.values[index + 1]));
        let part = low + (((high - low) * rest) >> (30 - Self::INDEX_BITS));
        (exponent << Self::FRACTION_BITS) + part as i32
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
            largest = largest.max((f64::from(table.of(number)) / scale - f64::from(number).log2()).abs());
        }
        assert!(largest <= LogTable::ERROR && largest > 0.5 * LogTable::ERROR, "{largest}");
    }
}
