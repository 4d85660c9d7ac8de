use decoupler_core::network::Quantity;

use super::logarithm::LogTable;
use crate::export::bundle::twofold::Twofold;

/// A row of weights as whole numbers with a common power of two.
#[derive(Clone, Debug)]
pub(super) struct ScaledRow {
    /// The weights times 2^`bits`, rounded.
    pub(super) weights: Vec<i32>,
    pub(super) bits: i32,
    /// Sum of the rounding errors of the weights.
    pub(super) error: f64,
}

/// Most bits after the point of a weight.
const MAX_BITS: i32 = 20;

impl ScaledRow {
    /// Scales `weights` so that the largest takes `width` bits with its sign. `fewest` limits the power of two.
    ///
    /// `None` for a weight that is too large even with the fewest bits.
    pub(super) fn of(weights: &[f64], width: u32, fewest: i32) -> Option<Self> {
        let largest = weights
            .iter()
            .fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        let fitting = (f64::from((1 << (width - 1)) - 1) / largest).log2().floor();
        // Not a number for a weight that is none, and infinite for zeros.
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

/// A factor as a whole number divided by a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Multiplier {
    pub(super) factor: i32,
    pub(super) shift: u8,
}

impl Multiplier {
    /// Relative rounding error.
    pub(super) const ERROR: f64 = 1.0 / (1_u32 << 29) as f64;

    /// A factor from some 1e-6 to 2²⁹.
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

/// The change x of a reading as slope · d + offset, where d is the whole number that the decoder computes.
pub(super) struct Change {
    pub(super) centre: i32,
    pub(super) slope: Twofold,
    pub(super) offset: Twofold,
    /// Largest |d| within the limits, at least ½.
    pub(super) span: f64,
    /// Largest error of d, with that of rounding the reading to a unit.
    error: f64,
}

/// Largest rounding error of a reading, in units.
const HALF: f64 = 0.5;

impl Change {
    pub(super) fn of(quantity: Quantity, units: f64, (low, high): (f64, f64), centre_ohm: f64) -> Self {
        // Rounding to units takes readings at the limits this much further; of resistances, 1 is the smallest number.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_take_all_bits_and_tell_their_error() {
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
}
