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
        let bounds = Vec::from_iter(self.bounds.iter().map(bound)).join(", ");
        let about = "Proven bound on the error in fixed point, for readings that are not out of range";
        (!bounds.is_empty()).then(|| format!("{about}: {bounds}"))
    }

    /// Returns the sentence on [`Self::rounding`], if there is one.
    pub fn describe_rounding(&self) -> Option<String> {
        let about = "Rounding the readings to single precision changes a target by at most";
        self.rounding.map(|rounding| format!("{about} {rounding:.1e}"))
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
    /// The decoder, its numbers or the range of its readings do not suit the format or the precision: the cause, and what to do.
    #[error("{0}")]
    Unsuitable(String),
    /// The readings by which the accuracy is found could not be drawn or decoded.
    #[error("no readings to verify the bundle: {0}")]
    Readings(#[from] Box<RunError>),
    /// A reading could not be decoded.
    #[error("no readings to verify the bundle: {0}")]
    Decoding(#[from] DecodeError),
    /// The samples to which the decoder is fitted could not be drawn or read again.
    #[error(transparent)]
    Samples(#[from] SetupError),
    /// Something exists already at the path of the bundle.
    #[error("'{}' is there already: give another name, or delete it first", .0.display())]
    Exists(PathBuf),
    /// The bundle cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The C compiler refused the source, or its program failed.
    #[error("{0} failed: {1}; nothing is left of the bundle")]
    SelfTest(&'static str, String),
}
