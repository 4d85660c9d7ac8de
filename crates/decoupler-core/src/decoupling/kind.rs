use serde::{Deserialize, Serialize};
use strum::{EnumMessage, VariantArray};

use crate::text::Named;

/// Method of decoding the readings of a frame.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    strum::Display,
    strum::EnumMessage,
    strum::IntoStaticStr,
    strum::VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum DecoderKind {
    /// Mean of the training set, independent of the readings.
    #[strum(message = "Training mean")]
    #[strum(detailed_message = "Always answers the mean of the training set")]
    Mean,
    /// Affine map fitted by ridge regression.
    #[strum(message = "Ridge")]
    #[strum(
        detailed_message = "The best affine map of the chosen inputs: ridge regression, with the penalty of each target chosen by cross-validation"
    )]
    Ridge,
    /// Network trained on the samples.
    #[strum(message = "Network")]
    #[strum(detailed_message = "The trained network, in 64 or in 32 bits")]
    Network,
    /// Radial-basis network: Gaussians around centres.
    #[strum(serialize = "rbf")]
    #[strum(message = "Radial basis")]
    #[strum(
        detailed_message = "A radial-basis network by kernel ridge regression: Gaussians around all training samples, or around 1000 of more than 4000, their width and penalties chosen by cross-validation"
    )]
    RadialBasis,
    /// Fuzzy rules with affine consequents: a Takagi-Sugeno system.
    #[strum(message = "Fuzzy rules")]
    #[strum(
        detailed_message = "A Takagi-Sugeno system: fuzzy rules with affine consequents, their number chosen by cross-validation"
    )]
    Fuzzy,
    /// Gauss-Newton method on Eq. (2), with noise and prior if the scene has noise or the equations do not determine
    /// the answer.
    #[strum(message = "Newton")]
    #[strum(
        detailed_message = "Newton's method on Eq. (2) from mid-stroke, with restarts if that fails; with noise and prior if the scene has noise or the readings do not determine the answer"
    )]
    Newton,
    /// Network followed by at most [`DecoderKind::POLISH_STEPS`] Gauss-Newton steps.
    #[strum(message = "Network + Newton")]
    #[strum(detailed_message = "The network's answer, improved by at most three Newton steps")]
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

impl DecoderKind {
    /// All decoders, in the order offered to the user.
    pub const ALL: [Self; Self::VARIANTS.len()] = *Self::VARIANTS.as_array().expect("as many as there are");

    /// Largest number of steps of [`DecoderKind::Polish`].
    pub const POLISH_STEPS: usize = 3;

    /// Returns the name in tables, charts and forms; a network in single precision is named as such.
    pub fn name(self, precision: Precision) -> &'static str {
        match (self, precision) {
            (Self::Network, Precision::Single) => "Network f32",
            _ => self.get_message().unwrap_or_default(),
        }
    }

    /// Returns a sentence that describes the method of decoding.
    pub fn meaning(self) -> &'static str {
        self.get_detailed_message().unwrap_or_default()
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
