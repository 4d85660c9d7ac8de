use std::{fmt, str::FromStr};

use super::ChoiceError;
use decoupler_core::decoupling::{DecoderKind, Precision};

/// Decoder that leaves the program as a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BundleDecoder {
    /// One of the decoders that are compared with the network.
    Kind(DecoderKind),
    /// The linear map of the error table.
    Linear,
}

impl BundleDecoder {
    /// All decoders, in the order offered to the user.
    pub fn all() -> impl Iterator<Item = Self> {
        DecoderKind::ALL.into_iter().map(Self::Kind).chain([Self::Linear])
    }

    /// Says what each decoder is, for the help of a command.
    pub fn help() -> String {
        let line = |decoder: Self| {
            let meaning = match decoder {
                Self::Kind(kind) => kind.meaning(),
                Self::Linear => "The linear map of the error table",
            };
            format!("{decoder}: {meaning}")
        };
        let lines: Vec<String> = Self::all().map(line).collect();
        format!("Decoder to export. {}", lines.join("; "))
    }

    /// Returns `true` for the trained network.
    pub fn is_network(self) -> bool {
        self == Self::Kind(DecoderKind::Network)
    }

    /// Returns `true` if the decoder computes with a trained network.
    pub fn needs_network(self) -> bool {
        matches!(self, Self::Kind(kind) if kind.needs_network())
    }

    /// Returns `true` if the decoder iterates on the equations of the sensor.
    pub fn solves_equations(self) -> bool {
        matches!(self, Self::Kind(kind) if kind.needs_sensor())
    }

    /// Name in tables and forms.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kind(kind) => kind.name(Precision::Double),
            Self::Linear => "Linear map",
        }
    }

    /// Word for it in sentences, and the name of its file of weights: network or decoder.
    pub(super) fn noun(self) -> &'static str {
        if self.is_network() { "network" } else { "decoder" }
    }
}

impl Default for BundleDecoder {
    fn default() -> Self {
        Self::Kind(DecoderKind::Network)
    }
}

impl fmt::Display for BundleDecoder {
    /// Writes the word used in the terminal and in files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kind(kind) => kind.fmt(f),
            Self::Linear => f.pad("linear"),
        }
    }
}

impl FromStr for BundleDecoder {
    type Err = ChoiceError;

    fn from_str(text: &str) -> Result<Self, ChoiceError> {
        let found = Self::all().find(|decoder| decoder.to_string() == text.trim());
        found.ok_or_else(|| ChoiceError::Decoder(text.to_owned()))
    }
}
