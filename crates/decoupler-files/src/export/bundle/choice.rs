use std::{fmt, str::FromStr};

use decoupler_core::{
    decoupling::{DecoderKind, NotDescribed, Precision},
    text::Named,
};
use thiserror::Error;

use super::{
    BundleError, c99,
    fixed_point::FixedNetworks,
    folder::{Call, Draft},
    matlab, numpy, onnx,
    report::BundleCheck,
    weights::{self, Digits},
};

/// Format in which a decoder is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BundleFormat {
    /// A graph for ONNX runtimes, opset 13.
    Onnx,
    /// One C99 header and one source.
    C99,
    /// One function file for MATLAB and GNU Octave.
    Matlab,
    /// Weights as `.npz` and a short `decode.py`.
    NumPy,
    /// The network file itself.
    Json,
}

/// Numbers with which a bundle computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BundlePrecision {
    /// Double precision.
    #[default]
    Double,
    /// Single precision; sums that would lose too much in it stay in double precision.
    Single,
    /// Integers only: weights and activations of 16 bits.
    Fixed16,
}

/// Errors of unknown formats, decoders and precisions, and of unsupported combinations.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ChoiceError {
    /// No such format.
    #[error("'{0}' is not a format: give {words}", words = BundleFormat::words())]
    Format(String),
    /// No such decoder.
    #[error("'{0}' is not a decoder: give one of {all}", all = decoder_words())]
    Decoder(String),
    /// Fixed point for a decoder other than a network.
    #[error("fixed16 is for networks only: give f64 or f32")]
    WholeNumbers,
    /// No other program can compute what the decoder does.
    #[error("{} cannot be exported: {reason}", .decoder.name())]
    NotDescribed {
        /// The decoder.
        decoder: BundleDecoder,
        /// The cause.
        reason: NotDescribed,
    },
    /// No such precision.
    #[error("'{0}' is not a precision: give f64, f32 or fixed16")]
    Precision(String),
    /// A format that does not have this precision.
    #[error("{format} has no precision {precision}: give {}", .format.precision_names())]
    Pair {
        /// The format.
        format: BundleFormat,
        /// The precision it lacks.
        precision: BundlePrecision,
    },
}

/// Properties of a format, all in one place.
struct Entry {
    word: &'static str,
    help: &'static str,
    precisions: &'static [BundlePrecision],
    writer: Writer,
}

/// Functions that write a format.
#[derive(Clone, Copy)]
pub(super) struct Writer {
    /// Writes the files of a folder in floating point, reads them back and evaluates them.
    pub(super) export: fn(&mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError>,
    /// Returns the usage section of the README.
    pub(super) call: fn(&Call<'_>) -> String,
}

impl BundleFormat {
    /// All formats, in the order offered to the user.
    pub const ALL: [Self; 5] = [Self::Onnx, Self::C99, Self::Matlab, Self::NumPy, Self::Json];

    fn entry(self) -> Entry {
        use BundlePrecision::{Double, Fixed16, Single};
        match self {
            Self::Onnx => Entry {
                word: "onnx",
                help: "a graph (opset 13) for ONNX runtimes",
                precisions: &[Double, Single],
                writer: Writer {
                    export: onnx::export,
                    call: onnx::call,
                },
            },
            Self::C99 => Entry {
                word: "c99",
                help: "one header and one source in C",
                precisions: &[Double, Single, Fixed16],
                writer: Writer {
                    export: c99::export,
                    call: c99::call,
                },
            },
            Self::Matlab => Entry {
                word: "matlab",
                help: "one function file for MATLAB and GNU Octave",
                precisions: &[Double],
                writer: Writer {
                    export: matlab::export,
                    call: matlab::call,
                },
            },
            Self::NumPy => Entry {
                word: "numpy",
                help: "weights (.npz) and a decode.py",
                precisions: &[Double, Single],
                writer: Writer {
                    export: numpy::export,
                    call: numpy::call,
                },
            },
            Self::Json => Entry {
                word: "json",
                help: "the network file itself, or the numbers of another decoder",
                precisions: &[Double],
                writer: Writer {
                    export: weights::export,
                    call: |_| String::new(),
                },
            },
        }
    }

    /// Functions that write the format.
    pub(super) fn writer(self) -> Writer {
        self.entry().writer
    }

    /// Precisions in which the format can be written.
    pub fn precisions(self) -> &'static [BundlePrecision] {
        self.entry().precisions
    }

    /// Describes each format, for the help of a command.
    pub fn help() -> String {
        let lines = Self::ALL.map(|format| format!("{format}: {}", format.entry().help));
        lines.join("; ")
    }

    /// Lists all formats: `onnx, c99 … or json`.
    fn words() -> String {
        let words = Self::ALL.map(|format| format.entry().word);
        let [others @ .., last] = &words;
        format!("{} or {last}", others.join(", "))
    }

    /// Checks that the format can be written in `precision`.
    ///
    /// # Errors
    /// It cannot.
    pub fn check(self, precision: BundlePrecision) -> Result<(), ChoiceError> {
        if self.precisions().contains(&precision) {
            return Ok(());
        }
        Err(ChoiceError::Pair {
            format: self,
            precision,
        })
    }

    /// Checks that the format can express `decoder` in `precision`.
    ///
    /// # Errors
    /// It cannot.
    pub fn check_for(self, decoder: BundleDecoder, precision: BundlePrecision) -> Result<(), ChoiceError> {
        self.check(precision)?;
        if precision == BundlePrecision::Fixed16 && !decoder.is_network() {
            return Err(ChoiceError::WholeNumbers);
        }
        decoder.check()
    }

    fn precision_names(self) -> String {
        let names = self.precisions().iter().map(BundlePrecision::to_string);
        names.collect::<Vec<_>>().join(" or ")
    }
}

/// Lists all decoders.
fn decoder_words() -> String {
    BundleDecoder::all()
        .map(|decoder| decoder.to_string())
        .collect::<Vec<_>>()
        .join(", ")
}

impl BundlePrecision {
    /// All precisions, in the order offered to the user.
    pub const ALL: [Self; 3] = [Self::Double, Self::Single, Self::Fixed16];
}

impl fmt::Display for BundleFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.entry().word)
    }
}

impl fmt::Display for BundlePrecision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Double => "f64",
            Self::Single => "f32",
            Self::Fixed16 => "fixed16",
        })
    }
}

impl FromStr for BundleFormat {
    type Err = ChoiceError;

    fn from_str(text: &str) -> Result<Self, ChoiceError> {
        let found = Self::ALL.into_iter().find(|format| format.to_string() == text.trim());
        found.ok_or_else(|| ChoiceError::Format(text.to_owned()))
    }
}

impl FromStr for BundlePrecision {
    type Err = ChoiceError;

    fn from_str(text: &str) -> Result<Self, ChoiceError> {
        let mut all = Self::ALL.into_iter();
        let found = all.find(|precision| precision.to_string() == text.trim());
        found.ok_or_else(|| ChoiceError::Precision(text.to_owned()))
    }
}

/// Decoder that is exported as a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BundleDecoder {
    /// One of the decoders that are compared with the network.
    Kind(DecoderKind),
    /// The linear map of the error table.
    Linear,
}

impl BundleDecoder {
    /// Decoders that can be exported, in the order offered to the user.
    pub fn all() -> impl Iterator<Item = Self> {
        let kinds = DecoderKind::ALL.into_iter().map(Self::Kind);
        kinds.chain([Self::Linear]).filter(|decoder| decoder.check().is_ok())
    }

    /// Checks that the decoder can be exported.
    ///
    /// # Errors
    /// It cannot.
    pub fn check(self) -> Result<(), ChoiceError> {
        let reason = match self {
            Self::Kind(kind) if kind.needs_sensor() => NotDescribed::Equations,
            Self::Kind(DecoderKind::Fuzzy) => NotDescribed::Rules,
            _ => return Ok(()),
        };
        Err(ChoiceError::NotDescribed { decoder: self, reason })
    }

    /// Describes each decoder, for the help of a command.
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
        match (text.trim(), DecoderKind::parse(text)) {
            ("linear", _) => Ok(Self::Linear),
            (_, Ok(kind)) => Ok(Self::Kind(kind)),
            (_, Err(_)) => Err(ChoiceError::Decoder(text.to_owned())),
        }
    }
}

/// Numbers in which a bundle takes readings; callers round their readings to them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Taking<'a> {
    /// Double precision.
    Double,
    /// Single precision.
    Single,
    /// Integer multiples of units.
    Whole(&'a FixedNetworks),
}

/// Changes of the outputs caused by rounding the readings to the numbers that a bundle takes, relative to the scales of
/// the outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingRounding {
    /// Largest change found.
    pub largest: f64,
    /// First-order bound on the change at the readings that were tried.
    pub bound: f64,
}

impl Taking<'_> {
    /// Returns the number that is passed to a bundle for a reading of a channel.
    pub(super) fn rounded(self, channel: usize, reading: f64) -> f64 {
        match self {
            Self::Double => reading,
            Self::Single => Digits::Single.round(reading),
            Self::Whole(networks) => networks.representable(channel, reading),
        }
    }

    /// Largest rounding error of a reading of a channel.
    pub(super) fn error(self, channel: usize, reading: f64) -> f64 {
        match self {
            Self::Double => 0.0,
            Self::Single => {
                let of_digits = reading.abs() * Digits::Single.unit_roundoff();
                // Subnormal numbers have fewer digits.
                of_digits.max(0.5 * f64::from(f32::from_bits(1)))
            }
            Self::Whole(networks) => 0.5 * networks.readings.unit(channel),
        }
    }
}

impl ReadingRounding {
    /// Largest change for which a bundle is still written.
    pub(super) const LARGEST: f64 = 0.01;

    /// The larger of both figures.
    pub fn worst(self) -> f64 {
        if self.largest.is_nan() {
            f64::NAN
        } else {
            self.largest.max(self.bound)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_unsupported_pairs_are_refused_with_the_supported_ones() {
        for format in BundleFormat::ALL {
            assert_eq!(format.to_string().parse(), Ok(format));
            assert_eq!(format.check(BundlePrecision::default()), Ok(()), "{format}");
        }
        for precision in BundlePrecision::ALL {
            assert_eq!(precision.to_string().parse(), Ok(precision));
        }
        let message = BundleFormat::Onnx
            .check(BundlePrecision::Fixed16)
            .unwrap_err()
            .to_string();
        assert_eq!(message, "onnx has no precision fixed16: give f64 or f32");
        assert!(
            "tflite"
                .parse::<BundleFormat>()
                .unwrap_err()
                .to_string()
                .contains("onnx, c99")
        );
    }
}
