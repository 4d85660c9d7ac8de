use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Quantity computed from a resistance R as the input of a decoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// R in ohm, as in the paper.
    #[default]
    Resistance,
    /// 1/R in siemens. By Eq. (2) it is a plain sum over nodes, and so the most nearly linear in the deformation.
    Conductance,
    /// ln R, in which relative errors are additive.
    LogResistance,
    /// The reading itself, in any unit and with any sign, for measured data other than resistances.
    Raw,
}

/// Largest relative error of a resistance towards 0: it is still above 0.
const LARGEST_REACH: f64 = 1.0 - 1e-6;

/// Error for a word that names no quantity.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not an input: give resistance, conductance or log")]
pub struct QuantityError(String);

impl Quantity {
    /// All quantities of a resistance, in the order offered to the user.
    pub const ALL: [Self; 3] = [Self::Resistance, Self::Conductance, Self::LogResistance];

    /// Returns the value for a resistance in ohm.
    pub fn of(self, resistance_ohm: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => resistance_ohm,
            Self::Conductance => 1.0 / resistance_ohm,
            Self::LogResistance => resistance_ohm.ln(),
        }
    }

    /// Returns `true` if the quantity is defined for a reading: any finite number if raw, otherwise a finite number
    /// above 0.
    #[inline(always)]
    pub fn accepts(self, reading: f64) -> bool {
        match self {
            Self::Raw => reading.is_finite(),
            _ => (reading > 0.0) & (reading < f64::INFINITY),
        }
    }

    /// Returns the resistance in ohm for a value, the inverse of [`Self::of`].
    pub fn resistance_ohm(self, value: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => value,
            Self::Conductance => 1.0 / value,
            Self::LogResistance => value.exp(),
        }
    }

    /// Standard deviation of the value where the reading has `deviation_ohm`: a third of the change that three standard
    /// deviations towards 0 make. For small errors it is |d value / d R| · deviation; a conductance whose resistance may
    /// be read as next to nothing has no bound, and this is large.
    pub fn deviation(self, resistance_ohm: f64, deviation_ohm: f64) -> f64 {
        let three = (3.0 * deviation_ohm / resistance_ohm).min(LARGEST_REACH);
        match self {
            Self::Resistance | Self::Raw => deviation_ohm,
            Self::Conductance => three / (1.0 - three) / (3.0 * resistance_ohm),
            Self::LogResistance => -(-three).ln_1p() / 3.0,
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Resistance => "resistance",
            Self::Conductance => "conductance",
            Self::LogResistance => "log",
            Self::Raw => "raw",
        })
    }
}

impl FromStr for Quantity {
    type Err = QuantityError;

    fn from_str(text: &str) -> Result<Self, QuantityError> {
        let found = Self::ALL
            .into_iter()
            .find(|quantity| quantity.to_string() == text.trim());
        found.ok_or_else(|| QuantityError(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quantity_can_be_undone_and_named() {
        for quantity in Quantity::ALL {
            for ohm in [1e-3, 21.7, 4.2e5] {
                assert!((quantity.resistance_ohm(quantity.of(ohm)) / ohm - 1.0).abs() < 1e-14);
                for relative in [1e-9, 1e-3, 0.1] {
                    let change = quantity.of(ohm * (1.0 - 3.0 * relative)) - quantity.of(ohm);
                    let ratio = quantity.deviation(ohm, relative * ohm) / (change.abs() / 3.0);
                    assert!((ratio - 1.0).abs() < 1e-6, "{quantity} {relative}: {ratio}");
                }
                let hidden = quantity.deviation(ohm, 1e300);
                assert!(hidden.is_finite() && hidden > quantity.deviation(ohm, 0.3 * ohm));
            }
            assert_eq!(quantity.to_string().parse(), Ok(quantity));
        }
        assert!(
            "ohm"
                .parse::<Quantity>()
                .unwrap_err()
                .to_string()
                .contains("conductance")
        );
    }
}
