use std::path::PathBuf;

use decoupler_core::{decoupling::DecodeError, evaluation::RunError, problem::Channel, text::counted};
use serde::Serialize;
use thiserror::Error;

use super::{
    BundleDecoder,
    choice::{BundleFormat, BundlePrecision, ChoiceError},
    contents::Contents,
    meaning::wrapped,
};
use crate::{
    export::{WriteError, document::PROGRAM, format_number},
    import::SetupError,
};

/// Files written by an export, and their deviation from the decoder.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BundleReport {
    /// Form of the bundle.
    pub format: BundleFormat,
    /// Numbers with which it computes.
    pub precision: BundlePrecision,
    /// The folder.
    pub path: PathBuf,
    /// Names of its files, with their sizes in bytes.
    #[serde(skip)]
    pub files: Vec<(String, u64)>,
    /// Number of readings by which the accuracy was found, and how many of them the bundle contains.
    #[serde(rename = "verified_vectors")]
    pub verified: usize,
    /// See [`Self::verified`].
    #[serde(rename = "golden_vectors")]
    pub golden: usize,
    /// Evaluations of the bundle.
    pub checks: Vec<BundleCheck>,
    /// Largest deviation to be expected of another program, relative to [`Self::output_range_mm`], or to the range of each
    /// target of own data. It includes [`Self::rounding`].
    pub limit: f64,
    /// Change of the targets by rounding the readings to single precision, at most, relative as [`Self::limit`]; `None` for
    /// other precisions.
    #[serde(rename = "change_by_rounding_readings", skip_serializing_if = "Option::is_none")]
    pub rounding: Option<f64>,
    /// Widest range of a coordinate in training, in mm; `None` for own data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_range_mm: Option<f64>,
    /// Proven bounds on the errors in fixed point: of any coordinate of an array, or of each target; empty otherwise.
    #[serde(skip)]
    pub bounds: Vec<(Channel, f64)>,
    /// Remarks for the user, with cause and cure.
    pub remarks: Vec<String>,
}

/// An evaluation of a bundle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BundleCheck {
    /// Name of the program that evaluated it.
    pub evaluator: &'static str,
    /// Largest deviation from the decoder, which takes the readings in double precision, where the bundle takes them as its
    /// callers must round them; relative as [`BundleReport::limit`].
    pub deviation: f64,
}

impl BundleReport {
    /// Returns the sentence on [`Self::bounds`], if there are any.
    pub fn describe_bounds(&self) -> Option<String> {
        let bound = |(output, bound): &(Channel, f64)| {
            let unit = output.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
            format!("{}{unit} ({})", format_number(*bound), output.name)
        };
        let bounds: Vec<String> = self.bounds.iter().map(bound).collect();
        (!bounds.is_empty()).then(|| {
            format!(
                "Proven bound on the error in fixed point, for readings that are not out of range: {}",
                bounds.join(", ")
            )
        })
    }

    /// Returns the sentence on [`Self::rounding`], if there is one.
    pub fn describe_rounding(&self) -> Option<String> {
        let rounding = self.rounding?;
        Some(format!(
            "Rounding the readings to single precision changes a target by at most {rounding:.1e}"
        ))
    }

    /// Returns the largest deviation of all checks; `None` if nothing evaluated the bundle.
    pub fn deviation(&self) -> Option<f64> {
        self.checks.iter().map(|check| check.deviation).reduce(f64::max)
    }
}

/// Returns the README of a bundle: its usage and its accuracy.
pub(super) fn readme(contents: &Contents, decoder: BundleDecoder, usage: &str, report: &BundleReport) -> String {
    let (meaning, noun, BundleReport { format, precision, .. }) = (&contents.meaning, contents.noun, report);
    let rows = match contents.takes_row() {
        true => format!("There is one {noun} for each row, from 1 to {}.\n", contents.rows),
        false => String::new(),
    };
    let state = contents.state_in_words();
    let state = state.map_or_else(String::new, |state| format!("\n{}\n", wrapped(&state).join("\n")));
    let range = report.output_range_mm;
    let range = range.map_or_else(String::new, |range| format!(" ({} mm)", format_number(range)));
    let mut text = format!(
        "{name}, exported by {PROGRAM} as {format}, {precision}.\n\n{purpose}.\nIt takes {readings} and returns {targets}{parts}.\n\n\
         {legend}\n{rows}\nUsage\n\n{usage}\nA line of readings has {inputs}, a line of the answer {outputs}.\n{state}\n\
         Accuracy\n\nAnswers agree with those of the {noun} within {limit:.1e} of {scale}{range}.\n",
        name = decoder.name(),
        purpose = meaning.purpose(),
        readings = counted(contents.channels(), "reading"),
        targets = contents.outputs_in_words(),
        parts = contents.parts_in_words(),
        legend = meaning.legend().join("\n"),
        inputs = counted(contents.channels(), "number"),
        outputs = counted(contents.outputs(), "number"),
        limit = report.limit,
        scale = meaning.scale(),
    );
    for check in &report.checks {
        text += &format!("{}: largest deviation {:.1e}.\n", check.evaluator, check.deviation);
    }
    let sentences = [report.describe_rounding(), report.describe_bounds()];
    for sentence in sentences.into_iter().flatten() {
        text += &format!("{sentence}.\n");
    }
    for remark in &report.remarks {
        text += &format!("Note: {remark}.\n");
    }
    text + &format!(
        "\ngolden.csv has readings in double precision with the {output}s that the {noun} gives to them, for a test of your\n\
         own: convert the readings as you would your own.\n\
         metadata.json has names and units, the errors of the {noun} on test samples, if there were any, the range of the\n\
         readings in training, the seed and the version of the program.\n",
        output = meaning.output(),
    )
}

/// Errors of exporting a bundle. Nothing is left behind.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BundleError {
    /// The format does not have the precision.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// The decoder needs a network, and none was trained.
    #[error("{0} needs a trained network: train one first")]
    NoNetwork(BundleDecoder),
    /// The lag is too long for a graph.
    #[error(
        "a lag of {0} samples is too long for an ONNX graph, which copies its state for each sample: export as c99, numpy or matlab"
    )]
    LongLag(usize),
    /// A constant of the program is beyond the range of the numbers.
    #[error("a constant of the decoder is beyond the range of {0}: {1}")]
    NotFinite(&'static str, &'static str),
    /// The readings by which the accuracy is found could not be drawn or decoded.
    #[error("no readings to verify the bundle: {0}")]
    Readings(#[from] Box<RunError>),
    /// A reading could not be decoded.
    #[error("no readings to verify the bundle: {0}")]
    Decoding(#[from] DecodeError),
    /// The network file does not have the range of the readings.
    #[error(
        "the network file does not have the range of the readings in training, without which no bundle can be verified: train again"
    )]
    NoRange,
    /// The samples to which the decoder is fitted could not be drawn or read again.
    #[error(transparent)]
    Samples(#[from] SetupError),
    /// Something exists already at the path of the bundle.
    #[error("'{}' is there already: give another name, or delete it first", .0.display())]
    Exists(PathBuf),
    /// The bundle cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A reading that becomes 0 or infinite in the numbers of the bundle.
    #[error(
        "a reading of {reading:.1e} ({channel}) is beyond the range of the numbers in which the bundle takes it: give --precision f64"
    )]
    ReadingBeyond {
        /// Name of the channel.
        channel: String,
        /// The reading.
        reading: f64,
    },
    /// Single precision has too few digits for the readings.
    #[error(
        "single precision cannot resolve the readings: rounding them to it changes the answers by up to {change}; {cure}"
    )]
    Unresolved {
        /// The change, with its unit.
        change: String,
        /// What to do.
        cure: String,
    },
    /// Steps that have no form in integers (fixed16).
    #[error("fixed16 has no {0}: give --precision f64 or f32")]
    FixedStep(&'static str),
    /// The file does not contain the range of the readings, which fixed16 needs.
    #[error(
        "fixed16 needs the range of the readings in training, which the network file does not have: train again, or give --precision f32"
    )]
    FixedNoRange,
    /// Resistances that exceed 32 bits in every unit of fixed16.
    #[error(
        "fixed16 reads resistances up to 1e9 ohm, and in training they were up to {0:.1e} ohm: give --precision f32"
    )]
    FixedReading(f64),
    /// Weights or outputs beyond the range of the numbers of fixed16.
    #[error("fixed16 cannot hold the weights of {what}: {cure}, which keeps weights small, or give --precision f32")]
    FixedRange {
        /// A way to train a network with smaller weights.
        cure: &'static str,
        /// Name of the value that is too large.
        what: &'static str,
    },
    /// An error bound of fixed16 that is too large.
    #[error(
        "in fixed point the error is only known to be below {bound:.3} times {scale}: {cure} (the decoder amplifies differences of its readings too much), or give --precision f32"
    )]
    FixedCoarse {
        /// The bound, in proportion to the range.
        bound: f64,
        /// Name of the range.
        scale: &'static str,
        /// A way to train a network that amplifies less.
        cure: &'static str,
    },
    /// The C compiler refused the source, or its program failed.
    #[error("{step} failed: {reason}; nothing is left of the bundle")]
    SelfTest {
        /// Compiling, or running.
        step: &'static str,
        /// First lines of the message.
        reason: String,
    },
}
