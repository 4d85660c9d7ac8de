//! What can be exported: decoders, formats and precisions.

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    text::Named,
};
use strum::{EnumMessage, VariantArray};
use thiserror::Error;

/// Format in which a decoder is exported.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, strum::Display, EnumMessage, strum::IntoStaticStr, VariantArray, serde::Serialize,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum BundleFormat {
    /// ONNX graph.
    #[strum(message = "ONNX")]
    #[strum(detailed_message = "A folder with an ONNX graph (opset 13) and golden readings.")]
    Onnx,
    /// C99 source.
    #[strum(message = "C99")]
    #[strum(
        detailed_message = "A folder with one header and one source in C99 and a self-test. fixed16 uses integer arithmetic only, for microcontrollers."
    )]
    C99,
    /// MATLAB or GNU Octave function.
    #[strum(message = "MATLAB/Octave")]
    #[strum(detailed_message = "A folder with one function for MATLAB and GNU Octave and golden readings.")]
    Matlab,
    /// Weights and a program for NumPy.
    #[strum(message = "NumPy")]
    #[strum(detailed_message = "A folder with the weights, a short decode.py and golden readings.")]
    NumPy,
}

/// Numbers with which a bundle computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, strum::Display, strum::IntoStaticStr, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum BundlePrecision {
    /// 64-bit floating point.
    #[default]
    #[strum(serialize = "f64")]
    #[serde(rename = "f64")]
    Double,
    /// 32-bit floating point.
    #[strum(serialize = "f32")]
    #[serde(rename = "f32")]
    Single,
    /// Integers with 16-bit weights and activations.
    Fixed16,
}

/// A combination of decoder, format and precision that is not exported: the cause, and what to give instead.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ChoiceError(String);

/// Why a decoder that solves equations is not exported.
const EQUATIONS: &str =
    "it solves the equations of the sensor, which bundles do not contain: export a network or ridge instead";
/// Why fuzzy rules are not exported.
const RULES: &str = "it is only for comparison: export another decoder instead, such as rbf or ridge";

impl BundleFormat {
    /// Name of the format, as in sentences.
    pub fn title(self) -> &'static str {
        self.get_message().unwrap_or_default()
    }

    /// What is written, in sentences.
    pub fn meaning(self) -> &'static str {
        self.get_detailed_message().unwrap_or_default()
    }

    /// Precisions in which the format is written, the most accurate first.
    pub fn precisions(self) -> &'static [BundlePrecision] {
        use BundlePrecision::{Double, Fixed16, Single};
        match self {
            Self::Onnx | Self::NumPy => &[Double, Single],
            Self::C99 => &[Double, Single, Fixed16],
            Self::Matlab => &[Double],
        }
    }

    /// Help text on all formats.
    pub fn help() -> String {
        let line = |format: &Self| format!("{format}: {}", format.meaning().trim_end_matches('.'));
        Vec::from_iter(Self::VARIANTS.iter().map(line)).join("; ")
    }

    /// Checks that a decoder is exported in this format with this precision.
    ///
    /// # Errors
    /// It is not.
    pub fn check_for(self, decoder: BundleDecoder, precision: BundlePrecision) -> Result<(), ChoiceError> {
        if !self.precisions().contains(&precision) {
            let names = self.precisions().iter().map(BundlePrecision::to_string);
            let names = Vec::from_iter(names).join(" or ");
            return Err(ChoiceError(format!(
                "{self} has no precision {precision}: give {names}"
            )));
        }
        let has_gaussians = decoder == BundleDecoder::Kind(DecoderKind::RadialBasis);
        if precision == BundlePrecision::Fixed16 && has_gaussians {
            let message = "fixed16 has no Gaussians: export rbf in f64 or f32, or another decoder";
            return Err(ChoiceError(message.to_owned()));
        }
        decoder.check()
    }
}

impl Named for BundleFormat {
    const WHAT: &'static str = "a format";
    const ALL: &'static [Self] = Self::VARIANTS;
}

impl Named for BundlePrecision {
    const WHAT: &'static str = "a precision";
    const ALL: &'static [Self] = &[Self::Double, Self::Single, Self::Fixed16];
}

/// Decoder that is exported as a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum BundleDecoder {
    /// A decoder of the error tables.
    #[strum(transparent)]
    Kind(DecoderKind),
    /// The linear map of the error table.
    Linear,
    /// What a choice of settings found best.
    Chosen,
}

impl BundleDecoder {
    /// All decoders that can be exported.
    pub fn all() -> impl Iterator<Item = Self> {
        let all = <Self as Named>::ALL.iter().copied();
        all.filter(|decoder| decoder.check().is_ok())
    }

    /// Checks that other programs can evaluate the decoder.
    ///
    /// # Errors
    /// They cannot.
    pub fn check(self) -> Result<(), ChoiceError> {
        let reason = match self {
            Self::Kind(kind) if kind.needs_sensor() => EQUATIONS,
            Self::Kind(DecoderKind::Fuzzy) => RULES,
            _ => return Ok(()),
        };
        Err(ChoiceError(format!("{} cannot be exported: {reason}", self.name())))
    }

    /// Help text on all decoders.
    pub fn help() -> String {
        let meaning = |decoder: Self| match decoder {
            Self::Kind(kind) => kind.meaning(),
            Self::Linear => "The linear map of the error table",
            Self::Chosen => {
                "What the file answers with: the combination that a choice of settings found, or the network"
            }
        };
        let lines = Self::all().map(|decoder| format!("{decoder}: {}", meaning(decoder)));
        format!("Decoder to export. {}", Vec::from_iter(lines).join("; "))
    }

    /// `true` for the trained network, and for the combination with it: those that a network file contains.
    pub fn is_network(self) -> bool {
        matches!(self, Self::Chosen | Self::Kind(DecoderKind::Network))
    }

    /// Name in sentences.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kind(kind) => kind.name(Precision::Double),
            Self::Linear => "Linear map",
            Self::Chosen => "Chosen combination",
        }
    }

    /// Word for it in sentences, and the name of its files: network or decoder.
    pub(super) fn noun(self) -> &'static str {
        if self == Self::default() { "network" } else { "decoder" }
    }
}

impl Named for BundleDecoder {
    const WHAT: &'static str = "a decoder";
    const ALL: &'static [Self] = &{
        let mut all = [Self::Chosen; DecoderKind::ALL.len() + 2];
        let mut index = 0;
        while index < DecoderKind::ALL.len() {
            all[index] = Self::Kind(DecoderKind::ALL[index]);
            index += 1;
        }
        all[index] = Self::Linear;
        all
    };
}

impl Default for BundleDecoder {
    fn default() -> Self {
        Self::Kind(DecoderKind::Network)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_unsupported_pairs_are_refused_with_the_supported_ones() {
        let network = BundleDecoder::default();
        for &format in BundleFormat::ALL {
            assert_eq!(BundleFormat::parse(&format.to_string()), Ok(format));
            assert_eq!(
                format.check_for(network, BundlePrecision::default()),
                Ok(()),
                "{format}"
            );
        }
        for &precision in <BundlePrecision as Named>::ALL {
            assert_eq!(BundlePrecision::parse(&precision.to_string()), Ok(precision));
        }
        for kind in DecoderKind::ALL {
            assert_eq!(BundleDecoder::parse(&kind.to_string()), Ok(BundleDecoder::Kind(kind)));
        }
        let refused = BundleFormat::Onnx.check_for(network, BundlePrecision::Fixed16);
        let message = refused.unwrap_err().to_string();
        assert_eq!(message, "onnx has no precision fixed16: give f64 or f32");
        let message = BundleFormat::parse("tflite").unwrap_err().to_string();
        assert!(message.contains("onnx, c99"), "{message}");
    }
}
