use decoupler_core::network::Quantity;

use crate::export::bundle::exact::Twofold;

/// A row of weights as integers with a common power of two.
#[derive(Clone, Debug)]
pub(super) struct ScaledRow {
    /// The weights times 2^`bits`, rounded.
    pub(super) weights: Vec<i32>,
    pub(super) bits: i32,
    /// Sum of the rounding errors of the weights.
    pub(super) error: f64,
}

/// Maximum number of bits after the point of a weight.
const MAX_BITS: i32 = 20;

impl ScaledRow {
    /// Scales `weights` to give the largest one `width` bits with its sign. `fewest` limits the power of two.
    ///
    /// `None` for a weight that is too large even with the fewest bits.
    pub(super) fn of(weights: &[f64], width: u32, fewest: i32) -> Option<Self> {
        let largest = weights
            .iter()
            .fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        let fitting = (f64::from((1 << (width - 1)) - 1) / largest).log2().floor();
        // NaN if a weight is NaN, and infinite if all are 0.
        if fitting.is_nan() || fitting < f64::from(fewest) {
            return None;
        }
        let bits = fitting.min(f64::from(MAX_BITS)) as i32;
        let scale = 2.0_f64.powi(bits);
        let rounded: Vec<i32> = weights.iter().map(|weight| (weight * scale).round() as i32).collect();
        let errors = weights
            .iter()
            .zip(&rounded)
            .map(|(weight, &rounded)| (weight - f64::from(rounded) / scale).abs());
        Some(Self {
            error: errors.sum(),
            weights: rounded,
            bits,
        })
    }
}

/// A factor as an integer divided by a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Multiplier {
    pub(super) factor: i32,
    pub(super) shift: u8,
}

impl Multiplier {
    /// Relative rounding error.
    pub(super) const ERROR: f64 = 1.0 / (1_u32 << 29) as f64;

    /// Rounds a factor from about 1e-6 to 2²⁹.
    pub(super) fn of(factor: f64) -> Self {
        let shift = (29 - factor.log2().floor() as i32).clamp(0, 60);
        Self {
            factor: (factor * 2.0_f64.powi(shift)).round() as i32,
            shift: shift as u8,
        }
    }
}

/// Bits after the point of a relative change of a conductance.
pub(in crate::export::bundle) const CONDUCTANCE_BITS: u32 = 30;

/// Bits of the changes of the readings and of the hidden weights, with their sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::export::bundle) enum HiddenWidth {
    Sixteen,
    /// Kept in 32 bits. For networks whose large products nearly cancel.
    TwentyFour,
}

impl HiddenWidth {
    pub(super) fn bits(self) -> u32 {
        match self {
            Self::Sixteen => 16,
            Self::TwentyFour => 24,
        }
    }

    /// Largest scaled change of a reading.
    pub(in crate::export::bundle) fn largest_change(self) -> i32 {
        (1 << (self.bits() - 1)) - 1
    }
}

/// The change x of a reading as slope · d + offset, where d is the integer that the decoder computes.
pub(super) struct Change {
    pub(super) centre: i32,
    pub(super) slope: Twofold,
    pub(super) offset: Twofold,
    /// Largest |d| within the limits, at least ½.
    pub(super) span: f64,
    /// Largest error of d, including the rounding of the reading to a unit.
    error: f64,
}

/// Largest rounding error of a reading, in units.
const HALF: f64 = 0.5;

impl Change {
    pub(super) fn of(quantity: Quantity, units: f64, (low, high): (f64, f64), centre_ohm: f64) -> Self {
        // Rounding to units moves readings at the limits outwards by up to this; the smallest resistance is 1.
        let lowest = if quantity == Quantity::Raw { f64::MIN } else { 1.0 };
        let (low, high) = ((low * units - HALF).max(lowest), high * units + HALF);
        let origin = Twofold::from(centre_ohm) * Twofold::from(units);
        let wide = |centre: f64| (high - centre).max(centre - low).max(0.5);
        match quantity {
            Quantity::Resistance | Quantity::Raw => {
                let centre = (0.5 * (low + high)).round();
                let unit = Twofold::from(1.0) / Twofold::from(units);
                Self {
                    centre: centre as i32,
                    slope: unit,
                    offset: (Twofold::from(centre) - origin) * unit,
                    span: wide(centre),
                    error: HALF,
                }
            }
            Quantity::Conductance => {
                let one = f64::from(1_u32 << CONDUCTANCE_BITS);
                let centre = (2.0 / (1.0 / low + 1.0 / high)).round().max(1.0);
                let ratio = origin / Twofold::from(centre);
                let span = ((centre / low - 1.0).abs()).max((centre / high - 1.0).abs());
                Self {
                    centre: centre as i32,
                    slope: ratio / Twofold::from(one),
                    offset: ratio - Twofold::from(1.0),
                    span: (span * one).max(0.5),
                    // Division truncates.
                    error: 1.0 + HALF * one * centre / low / low,
                }
            }
            Quantity::LogResistance => {
                let one = f64::from(1 << LogTable::FRACTION_BITS);
                let centre = (0.5 * (low.ln() + high.ln()) * one).round();
                Self {
                    centre: centre as i32,
                    slope: Twofold::from(1.0) / Twofold::from(one),
                    offset: Twofold::from(centre / one) - origin.ln(),
                    span: (high.ln() * one - centre).max(centre - low.ln() * one).max(0.5),
                    error: LogTable::ERROR * one + HALF * one / low,
                }
            }
        }
    }

    /// Factor that brings the span to the largest scaled change.
    pub(super) fn multiplier(&self, width: HiddenWidth) -> Multiplier {
        Multiplier::of(f64::from(width.largest_change()) / self.span)
    }

    /// Error of the scaled change, where the span is 1.
    pub(super) fn scaled_error(&self, width: HiddenWidth) -> f64 {
        Multiplier::ERROR + 0.5 / f64::from(width.largest_change()) + self.error / self.span
    }
}

/// Natural logarithm of integers: a table between 1 and 2, and three terms of the series from its nearest entry
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

/// Hyperbolic tangent of integers: a table with linear interpolation.
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
    fn weights_use_all_bits_and_have_their_rounding_error() {
        let row = ScaledRow::of(&[1.0, -0.3, 0.1], 16, 0).unwrap();
        assert_eq!((row.bits, &row.weights[..]), (14, &[16384, -4915, 1638][..]));
        assert!((row.error - (0.3 - 4915.0 / 16384.0_f64).abs() - (0.1 - 1638.0 / 16384.0_f64).abs()).abs() < 1e-15);
        assert_eq!(ScaledRow::of(&[0.0], 16, 0).unwrap().bits, 20);
        assert!(ScaledRow::of(&[40_000.0], 16, 0).is_none());
        assert!(ScaledRow::of(&[f64::INFINITY], 24, 0).is_none());
    }

    #[test]
    fn factors_keep_thirty_bits() {
        for factor in [1.5e-5, 0.3, 1.0, 77.7, 65534.0, 3.2e7] {
            let Multiplier { factor: whole, shift } = Multiplier::of(factor);
            let relative = f64::from(whole) / 2.0_f64.powi(i32::from(shift)) / factor - 1.0;
            assert!(relative.abs() <= Multiplier::ERROR, "{factor}: {relative}");
        }
    }

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
