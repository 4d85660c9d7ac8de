use super::{logarithm::LogTable, scaled::Multiplier};
use crate::export::bundle::twofold::Twofold;
use decoupler_core::network::Quantity;

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
