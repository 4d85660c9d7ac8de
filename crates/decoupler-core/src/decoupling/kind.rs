use std::fmt;

use serde::{Deserialize, Serialize};

use crate::text::Named;

/// Method of decoding the readings of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DecoderKind {
    /// Mean of the training set, independent of the readings.
    Mean,
    /// Affine map fitted by ridge regression.
    Ridge,
    /// Network trained on the samples.
    Network,
    /// Radial-basis network: Gaussians around centres.
    RadialBasis,
    /// Fuzzy rules with affine consequents: a Takagi-Sugeno system.
    Fuzzy,
    /// Gauss-Newton method on Eq. (2), with noise and prior if the scene has noise or the equations do not determine
    /// the answer.
    Newton,
    /// Network followed by at most [`DecoderKind::POLISH_STEPS`] Gauss-Newton steps.
    Polish,
}

/// Floating-point precision in which a network computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Precision {
    /// 64 bits.
    #[default]
    Double,
    /// 32 bits.
    Single,
}

/// Properties of a decoder.
struct Entry {
    /// Name in the terminal and in files.
    name: &'static str,
    /// Name in tables, charts and forms.
    title: &'static str,
    meaning: &'static str,
}

impl DecoderKind {
    /// All decoders, in the order offered to the user.
    pub const ALL: [Self; 7] = [
        Self::Mean,
        Self::Ridge,
        Self::Network,
        Self::RadialBasis,
        Self::Fuzzy,
        Self::Newton,
        Self::Polish,
    ];

    /// Largest number of steps of [`DecoderKind::Polish`].
    pub const POLISH_STEPS: usize = 3;

    const fn entry(self) -> Entry {
        match self {
            Self::Mean => Entry {
                name: "mean",
                title: "Training mean",
                meaning: "Always answers the mean of the training set",
            },
            Self::Ridge => Entry {
                name: "ridge",
                title: "Ridge",
                meaning: "The best affine map of the chosen inputs: ridge regression, with the penalty of each target chosen by cross-validation",
            },
            Self::Network => Entry {
                name: "network",
                title: "Network",
                meaning: "The trained network, in 64 or in 32 bits",
            },
            Self::RadialBasis => Entry {
                name: "rbf",
                title: "Radial basis",
                meaning: "A radial-basis network by kernel ridge regression: Gaussians around all training samples, or around 1000 of more than 4000, their width and penalties chosen by cross-validation",
            },
            Self::Fuzzy => Entry {
                name: "fuzzy",
                title: "Fuzzy rules",
                meaning: "A Takagi-Sugeno system: fuzzy rules with affine consequents, their number chosen by cross-validation",
            },
            Self::Newton => Entry {
                name: "newton",
                title: "Newton",
                meaning: "Newton's method on Eq. (2) from mid-stroke, with restarts if that fails; with noise and prior if the scene has noise or the readings do not determine the answer",
            },
            Self::Polish => Entry {
                name: "polish",
                title: "Network + Newton",
                meaning: "The network's answer, improved by at most three Newton steps",
            },
        }
    }

    /// Returns the name in tables, charts and forms; a network in single precision is named as such.
    pub fn name(self, precision: Precision) -> &'static str {
        match (self, precision) {
            (Self::Network, Precision::Single) => "Network f32",
            _ => self.entry().title,
        }
    }

    /// Returns a sentence that describes the method of decoding.
    pub fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Returns `true` if the decoder uses the trained network.
    pub fn needs_network(self) -> bool {
        matches!(self, Self::Network | Self::Polish)
    }

    /// Returns `true` if the decoder solves the equations of the sensor, so that measured samples alone are not enough.
    pub fn needs_sensor(self) -> bool {
        matches!(self, Self::Newton | Self::Polish)
    }

    /// Returns the precisions in which the decoder computes.
    pub fn precisions(self) -> &'static [Precision] {
        match self {
            Self::Network => &[Precision::Double, Precision::Single],
            _ => &[Precision::Double],
        }
    }
}

impl Named for DecoderKind {
    const WHAT: &'static str = "a decoder";
    const ALL: &'static [Self] = &Self::ALL;

    fn name(self) -> &'static str {
        self.entry().name
    }
}

impl fmt::Display for DecoderKind {
    /// Writes the name used in the terminal and in files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(Named::name(*self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_and_errors_list_the_choices() {
        for kind in DecoderKind::ALL {
            assert_eq!(DecoderKind::parse(Named::name(kind)), Ok(kind));
        }
        let message = DecoderKind::parse("neural").unwrap_err().to_string();
        assert!(message.ends_with("newton or polish"), "{message}");
    }
}
