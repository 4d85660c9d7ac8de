use std::path::PathBuf;

use thiserror::Error;

use super::{BundleDecoder, choice::ChoiceError, fixed_point::FixedPointError, portable::FoldError};
use crate::{
    export::{DocumentError, WriteError},
    import::SetupError,
};
use decoupler_core::{decoupling::NotDescribed, evaluation::RunError};

/// Errors of exporting a bundle. Nothing is left behind.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BundleError {
    /// The format does not have the precision.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// The decoder solves the equations of a sensor, and the samples have none.
    #[error("{0} solves the equations of a sensor, and a recording has no model of one: take another decoder")]
    NoSensor(BundleDecoder),
    /// The decoder needs a network, and none was trained.
    #[error("{0} needs a trained network: train one first")]
    NoNetwork(BundleDecoder),
    /// No other program can compute what the decoder does.
    #[error("{decoder} cannot be exported: {reason}")]
    NotDescribed {
        /// The decoder.
        decoder: BundleDecoder,
        /// The cause.
        reason: NotDescribed,
    },
    /// Rows whose equations leave the answer open.
    #[error(
        "{decoder} cannot be exported: the equations of {open} of {rows} rows drawn in the scene have no solution or more than one; take another decoder"
    )]
    OpenRows {
        /// The decoder.
        decoder: BundleDecoder,
        /// Such rows.
        open: usize,
        /// All rows.
        rows: usize,
    },
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
    /// Something is in the place of the bundle.
    #[error("'{}' is there already: give another name, or delete it first", .0.display())]
    Exists(PathBuf),
    /// The bundle cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The network file cannot be written or read back.
    #[error(transparent)]
    NetworkFile(#[from] DocumentError),
    /// A reading that is 0 or infinite in the numbers of the bundle.
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
