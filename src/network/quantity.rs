use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a decoder is given of a resistance R.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// R in ohm: the paper.
    #[default]
    Resistance,
    /// 1/R in siemens. By Eq. (2) it is a plain sum over nodes, hence the most nearly linear in the deformation.
    Conductance,
    /// ln R: relative errors become additive.
    LogResistance,
    /// The reading as it is, of whatever unit and sign: for measured data that are no resistances.
    Raw,
}

/// A word that is none of the quantities.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not an input: give resistance, conductance or log")]
pub struct QuantityError(String);

impl Quantity {
    /// Those of a resistance, in the order offered.
    pub const ALL: [Self; 3] = [Self::Resistance, Self::Conductance, Self::LogResistance];

    /// The value for a resistance in ohm.
    pub fn of(self, resistance_ohm: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => resistance_ohm,
            Self::Conductance => 1.0 / resistance_ohm,
            Self::LogResistance => resistance_ohm.ln(),
        }
    }

    /// Whether it has a value for a reading: any finite number, and where it is a resistance above 0.
    #[inline(always)]
    pub fn accepts(self, reading: f64) -> bool {
        match self {
            Self::Raw => reading.is_finite(),
            _ => (reading > 0.0) & (reading < f64::INFINITY),
        }
    }

    /// The resistance in ohm behind a value.
    pub fn resistance_ohm(self, value: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => value,
            Self::Conductance => 1.0 / value,
            Self::LogResistance => value.exp(),
        }
    }

    /// How much the value changes with the logarithm of the resistance, without sign: a relative error ε of a reading
    /// is an error of ε times this.
    pub fn per_relative_error(self, resistance_ohm: f64) -> f64 {
        match self {
            Self::Resistance => resistance_ohm,
            Self::Conductance => 1.0 / resistance_ohm,
            Self::LogResistance => 1.0,
            Self::Raw => resistance_ohm.abs(),
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
                let step = 1e-6;
                let change = (quantity.of(ohm * (1.0 + step)) - quantity.of(ohm * (1.0 - step))).abs() / (2.0 * step);
                assert!((change / quantity.per_relative_error(ohm) - 1.0).abs() < 1e-6);
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
