use std::{fmt::Write, path::PathBuf};

use decoupler_core::{dataset::Memory, evaluation::RunError, problem::Channel, text::counted};
use thiserror::Error;

use super::{
    BundleDecoder,
    choice::{BundleFormat, BundlePrecision, ChoiceError, ReadingRounding},
    fixed_point::{FixedNetworks, FixedPointError},
    folder::Call,
    meaning::Meaning,
    portable::{FoldError, Portable},
    vectors::Deviation,
};
use crate::{
    export::{DocumentError, WriteError, format_number},
    import::SetupError,
};

/// Files written by an export, and their deviation from the decoder.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BundleReport {
    /// Form of the bundle.
    pub format: BundleFormat,
    /// Numbers with which it computes.
    pub precision: BundlePrecision,
    /// The folder, or the file.
    pub path: PathBuf,
    /// Names of its files, with their sizes in bytes.
    pub files: Vec<(String, u64)>,
    /// Readings with which the bundle was verified, and how many of them it contains.
    pub vectors: VectorCounts,
    /// Evaluations of the bundle after reading it back.
    pub checks: Vec<BundleCheck>,
    /// Largest deviation allowed, relative to [`Self::output_range_mm`], or to the range of each target of own data.
    pub limit: f64,
    /// Changes of the outputs caused by rounding the readings to single precision; `None` for other precisions.
    pub rounding: Option<ReadingRounding>,
    /// Widest range of a coordinate in training, in mm; `None` for own data.
    pub output_range_mm: Option<f64>,
    /// Deviation of `decode` of this program from the same exact answers, relative as [`Self::limit`].
    pub program_deviation: f64,
    /// Proven bounds on the errors in fixed point: of any coordinate of an array, or of each target; empty otherwise.
    pub bounds: Vec<(Channel, f64)>,
    /// Remarks for the user, with cause and cure.
    pub remarks: Vec<String>,
}

/// Numbers of readings of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorCounts {
    /// Number with which the bundle was verified.
    pub verified: usize,
    /// Number in the bundle, as golden vectors.
    pub golden: usize,
}

/// An evaluation of a bundle after reading it back.
#[derive(Clone, Debug, PartialEq)]
pub struct BundleCheck {
    /// Name of the program that evaluated it.
    pub evaluator: &'static str,
    /// Largest deviation from the network, which takes the readings in double precision, where the bundle takes them as its
    /// callers must round them; relative as [`BundleReport::limit`].
    pub deviation: f64,
    /// The part of it that is not caused by rounding the readings.
    pub of_arithmetic: f64,
}

impl BundleCheck {
    pub(super) fn of(evaluator: &'static str, deviation: Deviation) -> Self {
        Self {
            evaluator,
            deviation: deviation.total,
            of_arithmetic: deviation.of_arithmetic,
        }
    }

    /// Checks the deviations.
    ///
    /// # Errors
    /// A deviation exceeds its limit or is NaN.
    pub(super) fn admit(&self, limits: Deviation) -> Result<(), BundleError> {
        for (deviation, limit) in [
            (self.of_arithmetic, limits.of_arithmetic),
            (self.deviation, limits.total),
        ] {
            if deviation.is_nan() || deviation > limit {
                return Err(BundleError::Deviation {
                    evaluator: self.evaluator.to_owned(),
                    deviation,
                    limit,
                });
            }
        }
        Ok(())
    }
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
        self.rounding.map(|rounding| {
            format!(
                "Rounding the readings to single precision alone: {:.1e}, at most {:.1e}",
                rounding.largest,
                rounding.worst()
            )
        })
    }

    /// Returns the largest deviation of all checks.
    pub fn deviation(&self) -> f64 {
        self.checks.iter().map(|check| check.deviation).fold(0.0, f64::max)
    }
}

/// Returns the README of a bundle: its usage and its accuracy.
pub(super) fn readme(name: &str, portable: &Portable, fixed: Option<&FixedNetworks>, report: &BundleReport) -> String {
    let meaning = &portable.meaning;
    let subject = match meaning {
        Meaning::Array(scale) => format!("a tactile array {scale}"),
        Meaning::Own { .. } => "own data".to_owned(),
    };
    let mut text = format!(
        "{decoder} of {subject}, exported by {program} as {format}, {precision}.\n\n",
        decoder = portable.name,
        program = crate::export::document::PROGRAM,
        format = report.format,
        precision = report.precision,
    );
    text += &match meaning {
        Meaning::Array(_) => format!(
            "It converts the {channels} of one row-wire (r_1 to r_{channels}, in ohm) into the {outputs} of\n\
             its nodes (x_1, y_1, z_1, x_2, ... {last}, in mm).",
            channels = counted(portable.channels, "reading"),
            outputs = counted(portable.outputs, "coordinate"),
            last = meaning.targets().last().map_or("", |target| &target.name),
        ),
        Meaning::Own { .. } => format!(
            "It converts {channels} into {outputs}.\n\n{legend}",
            channels = counted(portable.channels, "reading"),
            outputs = counted(portable.outputs, "target"),
            legend = meaning.legend().join("\n"),
        ),
    };
    if portable.takes_row() {
        let _ = write!(
            text,
            " There is one {} for each row, from 1 to {}.",
            portable.decoder,
            portable.rows()
        );
    }
    text += "\n\nUsage\n\n";
    let call = Call {
        name,
        portable,
        fixed,
        precision: report.precision,
    };
    text += &(report.format.writer().call)(&call);
    text += "\n\nAccuracy\n\n";
    for check in &report.checks {
        let _ = writeln!(
            text,
            "{}: largest deviation {:.1e} of {}{}.",
            check.evaluator,
            check.deviation,
            meaning.scale(),
            report
                .output_range_mm
                .map_or_else(String::new, |range| format!(" ({} mm)", format_number(range)))
        );
    }
    if let Some(rounding) = report.describe_rounding() {
        let _ = writeln!(text, "{rounding}.");
    }
    if let Some(bounds) = report.describe_bounds() {
        let _ = writeln!(text, "{bounds}.");
    }
    for remark in &report.remarks {
        let _ = writeln!(text, "Note: {remark}.");
    }
    let subject = match meaning {
        Meaning::Array(_) => "the array, its geometry",
        Meaning::Own { .. } => "names and units",
    };
    text + &format!(
        "\ngolden.csv has readings in double precision with the {output}s that the {decoder} gives to them, for a test of your\n\
         own: convert the readings as you would your own.\n\
         metadata.json has {subject}, the errors of the {decoder} on test samples, if there were any, the range of the\n\
         readings in training, the seed and the version of the program.\n",
        output = meaning.output(),
        decoder = portable.decoder,
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
    /// The network was trained on samples in memory and has no network file.
    #[error("json is the network file, and a network trained on samples in memory has none: give another format")]
    NoFile,
    /// A memory is exported in double precision only.
    #[error("a network with a memory ({1}) cannot be exported in {0}: give --precision f64, or train without a memory")]
    Memory(&'static str, Memory),
    /// The lag is too long for a graph.
    #[error(
        "a lag of {0} samples is too long for an ONNX graph, which copies its state for each sample: export as c99, numpy or matlab"
    )]
    LongLag(usize),
    /// The scaling cannot be folded into the weights.
    #[error(transparent)]
    Fold(#[from] FoldError),
    /// The readings with which the bundle is verified could not be drawn.
    #[error("no readings to verify the bundle: {0}")]
    Readings(#[from] Box<RunError>),
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
    /// The network file cannot be written or read back.
    #[error(transparent)]
    NetworkFile(#[from] DocumentError),
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
    /// The numbers do not fit 16 bits.
    #[error(transparent)]
    FixedPoint(#[from] FixedPointError),
    /// A file of the bundle could not be read back.
    #[error("'{file}' of the bundle could not be read back: {reason}; nothing is left of the bundle")]
    ReadBack {
        /// Name of the file.
        file: String,
        /// The cause.
        reason: String,
    },
    /// The C compiler refused the source, or its program failed.
    #[error("{step} failed: {reason}; nothing is left of the bundle")]
    SelfTest {
        /// Compiling, or running.
        step: &'static str,
        /// First lines of the message.
        reason: String,
    },
    /// The bundle gives other answers than the decoder.
    #[error(
        "{evaluator} gives answers that deviate by {deviation:.1e} of the range of the outputs, more than {limit:.1e}; nothing is left of the bundle"
    )]
    Deviation {
        /// Name of the program that evaluated the bundle.
        evaluator: String,
        /// Largest deviation relative to the widest range of an output.
        deviation: f64,
        /// Largest deviation allowed.
        limit: f64,
    },
}

impl BundleError {
    /// The error for a file of a bundle that could not be read back.
    pub(super) fn read_back(file: &str, reason: String) -> Self {
        Self::ReadBack {
            file: file.to_owned(),
            reason,
        }
    }
}
