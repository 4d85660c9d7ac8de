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
