//! Numbers with a common power of two, changes of readings as integers, and the table of the hyperbolic tangent.

/// Bits after the point of the inputs of a layer, whose magnitude is at most 1.
pub(in crate::export::bundle) const INPUT_BITS: i32 = 15;
/// Largest input of a layer as an integer.
pub(in crate::export::bundle) const LARGEST_INPUT: i32 = (1 << INPUT_BITS) - 1;
/// Bits of a weight with its sign.
const WEIGHT_BITS: u32 = 16;
/// Maximum number of bits after the point of a weight.
const MAX_BITS: i32 = 20;

/// A row of weights as integers with a common power of two.
#[derive(Clone, Debug)]
pub(super) struct ScaledRow {
    /// The weights times 2^`bits`, rounded.
    pub(super) weights: Vec<i32>,
    pub(super) bits: i32,
    /// Sum of the rounding errors of the weights.
    pub(super) error: f64,
}

impl ScaledRow {
    /// Scales `weights` to give the largest one all bits. `fewest` limits the power of two.
    ///
    /// `None` for a weight that is too large even with the fewest bits.
    pub(super) fn of(weights: &[f64], fewest: i32) -> Option<Self> {
        let largest = weights.iter().map(|weight| weight.abs()).fold(0.0, f64::max);
        let fitting = (f64::from((1 << (WEIGHT_BITS - 1)) - 1) / largest).log2().floor();
        // NaN if a weight is NaN, and infinite if all are 0.
        if fitting.is_nan() || fitting < f64::from(fewest) {
            return None;
        }
        let bits = fitting.min(f64::from(MAX_BITS)) as i32;
        let scale = 2.0_f64.powi(bits);
        let rounded: Vec<i32> = weights.iter().map(|weight| (weight * scale).round() as i32).collect();
        let errors = weights.iter().zip(&rounded);
        let errors = errors.map(|(weight, &rounded)| (weight - f64::from(rounded) / scale).abs());
        Some(Self {
            error: errors.sum(),
            weights: rounded,
            bits,
        })
    }
}

/// A bias with this many bits after the point, and its rounding error. The sum with products of the weights and inputs stays
/// within 64 bits; `None` otherwise.
pub(super) fn whole_bias(bias: f64, bits: i32, weights: &[i32]) -> Option<(i64, f64)> {
    let scale = 2.0_f64.powi(bits);
    let whole = (bias * scale).round();
    let products = weights
        .iter()
        .map(|&weight| f64::from(weight).abs() * 2.0_f64.powi(INPUT_BITS));
    // One bit is left for the rounding of the shift.
    let fits = whole.abs() + products.sum::<f64>() < 2.0_f64.powi(61);
    fits.then(|| (whole as i64, (bias - whole / scale).abs()))
}

/// Relative rounding error of a [`multiplier`].
const MULTIPLIER_ERROR: f64 = 1.0 / (1_u32 << 29) as f64;

/// A factor from about 1e-6 to 2²⁹, rounded to an integer divided by a power of two: the integer and the power.
fn multiplier(factor: f64) -> (i64, i64) {
    let shift = (29 - factor.log2().floor() as i32).clamp(0, 60);
    ((factor * 2.0_f64.powi(shift)).round() as i64, i64::from(shift))
}

/// Bits after the point of a relative change.
pub(in crate::export::bundle) const CONDUCTANCE_BITS: u32 = 30;

/// The change of a reading as slope · d + offset, where d is the integer that the program computes.
pub(super) struct Change {
    pub(super) centre: i32,
    pub(super) offset: f64,
    /// Change per unit of d.
    slope: f64,
    /// Largest |d| within the limits, at least ½.
    span: f64,
    /// Largest error of d, including the rounding of the reading to a unit.
    error: f64,
}

/// Largest rounding error of a reading, in units.
const HALF: f64 = 0.5;

impl Change {
    /// The change of readings within `limits` from `reference`, with this number of units in 1: r − R₀, or `is_relative` to
    /// the reading, (r − R₀)/r.
    pub(super) fn of(is_relative: bool, units: f64, (low, high): (f64, f64), reference: f64) -> Self {
        let origin = reference * units;
        if !is_relative {
            let (low, high) = (low * units - HALF, high * units + HALF);
            let centre = (0.5 * (low + high)).round();
            return Self {
                centre: centre as i32,
                slope: 1.0 / units,
                offset: (centre - origin) / units,
                span: (high - centre).max(centre - low).max(HALF),
                error: HALF,
            };
        }
        // Rounding to units moves readings at the limits outwards; the smallest resistance is 1.
        let (low, high) = ((low * units - HALF).max(1.0), high * units + HALF);
        let one = f64::from(1_u32 << CONDUCTANCE_BITS);
        let centre = (2.0 / (1.0 / low + 1.0 / high)).round().max(1.0);
        // With c the centre: 1 − R₀/r = 1 − R₀/c + R₀/c · (r − c)/r.
        let ratio = origin / centre;
        let span = (1.0 - centre / low).abs().max((1.0 - centre / high).abs());
        Self {
            centre: centre as i32,
            slope: ratio / one,
            offset: 1.0 - ratio,
            span: (span * one).max(HALF),
            // Division truncates.
            error: 1.0 + HALF * one * centre / low / low,
        }
    }

    /// Factor that brings the span to the largest input, as an integer divided by a power of two.
    pub(super) fn multiplier(&self) -> (i64, i64) {
        multiplier(f64::from(LARGEST_INPUT) / self.span)
    }

    /// Change per 1 of the input.
    pub(super) fn slope(&self) -> f64 {
        self.slope * self.span * f64::from(1 << INPUT_BITS) / f64::from(LARGEST_INPUT)
    }

    /// Error of the input.
    pub(super) fn error(&self) -> f64 {
        MULTIPLIER_ERROR + HALF / f64::from(LARGEST_INPUT) + self.error / self.span
    }
}

/// Hyperbolic tangent of integers: a table with linear interpolation.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct TangentTable {
    /// tanh at multiples of 2^(STEP_BITS − FRACTION_BITS), with [`Self::ACTIVATION_BITS`] bits after the point.
    pub(in crate::export::bundle) values: Vec<i16>,
    /// Largest error of the interpolation over all arguments, and beyond them, where it stays at the last value.
    pub(in crate::export::bundle) error: f64,
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
        let mut table = Self {
            values: (0..entries).map(entry).collect(),
            error: 0.0,
        };
        table.error = table.largest_error();
        table
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

    fn largest_error(&self) -> f64 {
        let one = f64::from(1 << Self::ACTIVATION_BITS);
        let scale = f64::from(1 << Self::FRACTION_BITS);
        let errors = (0..=Self::LARGEST).map(|argument| {
            let exact = libm::tanh(f64::from(argument) / scale);
            (f64::from(self.of(argument)) / one - exact).abs()
        });
        let beyond = 1.0 - f64::from(self.of(Self::LARGEST)) / one;
        errors.fold(beyond, f64::max)
    }

    /// Bound on the error of an activation whose argument has this `error`: the argument is `bias` plus weights times numbers
    /// of at most 1.
    pub(super) fn passed_on(&self, error: f64, bias: f64, weights: &[f64]) -> f64 {
        let spread: f64 = weights.iter().map(|weight| weight.abs()).sum();
        // Within the limits the argument is at least this far from 0, where the tangent is steepest.
        let nearest = (bias.abs() - spread - error).max(0.0);
        let slope = 1.0 - libm::tanh(nearest).powi(2);
        (slope * error).min(2.0) + self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_use_all_bits_and_have_their_rounding_error() {
        let row = ScaledRow::of(&[1.0, -0.3, 0.1], 0).unwrap();
        assert_eq!((row.bits, &row.weights[..]), (14, &[16384, -4915, 1638][..]));
        assert!((row.error - (0.3 - 4915.0 / 16384.0_f64).abs() - (0.1 - 1638.0 / 16384.0_f64).abs()).abs() < 1e-15);
        assert_eq!(ScaledRow::of(&[0.0], 0).unwrap().bits, 20);
        assert!(ScaledRow::of(&[40_000.0], 0).is_none());
        assert!(ScaledRow::of(&[f64::INFINITY], 0).is_none());
    }

    #[test]
    fn factors_keep_thirty_bits() {
        for factor in [1.5e-5, 0.3, 1.0, 77.7, 65534.0, 3.2e7] {
            let (whole, shift) = multiplier(factor);
            let relative = whole as f64 / 2.0_f64.powi(shift as i32) / factor - 1.0;
            assert!(relative.abs() <= MULTIPLIER_ERROR, "{factor}: {relative}");
        }
    }

    /// Curvature |tanh″| ≤ 0.77 over steps of 1/64 gives 2.4e-5, and three roundings half a unit of 2⁻¹⁵ each at most.
    #[test]
    fn its_error_is_that_of_the_interpolation_and_of_sixteen_bits() {
        let table = TangentTable::new();
        assert!((3e-5..7.0e-5).contains(&table.error), "{}", table.error);
        assert_eq!((table.of(0), table.of(TangentTable::LARGEST)), (0, i16::MAX));
        assert_eq!(table.of(-70_000), -table.of(70_000));
        assert!((1..=TangentTable::LARGEST).all(|argument| table.of(argument) >= table.of(argument - 1)));
    }
}
