//! Arithmetic on frames as they arrive: re-zeroing, drift, and faulty wires from the residual.
//!
//! [`WireCheck`] checks whether Eq. (2) explains the readings, identifies the faulty wire, and decodes without it.
//! [`DriftMonitor`] reports readings that no longer look like those of the training. [`ZeroGains`] are the gains of the
//! unloaded state, estimated from recent frames.

mod drift;
mod re_zero;
mod wire_check;

pub use drift::{Drift, DriftMonitor, DriftReference};
pub use re_zero::ZeroGains;
pub use wire_check::{FaultCause, FaultEvent, FaultyWire, WireCheck};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Reason why the readings of a network are not monitored, which its file stores, or why the unloaded state cannot be
/// estimated.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LiveError {
    /// No input varies.
    #[error("every input is constant in the training samples")]
    Constant,
    /// There are too few independent training readings.
    #[error(
        "there are {blocks} independent blocks of training readings, each {block} long, which is five times as long as \
         neighbouring readings are correlated, and {} are needed: record longer",
        DriftReference::MIN_BLOCKS
    )]
    TooFewReadings {
        /// Number of independent blocks.
        blocks: usize,
        /// Number of readings in a block.
        block: usize,
    },
    /// There are too many inputs.
    #[error(
        "the network has {found} inputs, and at most {} can be monitored",
        DriftReference::MAX_CHANNELS
    )]
    TooManyInputs {
        /// Number of inputs.
        found: usize,
    },
    /// Readings are NaN, infinite, or too large to compute with.
    #[error("training readings are not finite, or too large")]
    NotFinite,
    /// The row-wires are known, and each has readings of its own.
    #[error("the network has inputs by row-wire, which are not monitored")]
    RowWires,
    /// The training readings were not described.
    #[error("the network file does not describe the training readings, as those of older versions: train again")]
    NotDescribed,
    /// Too few frames.
    #[serde(skip)]
    #[error("only {found} of {needed} frames have been received: wait a moment and try again")]
    Frames {
        /// Number of frames received.
        found: usize,
        /// Number of frames needed.
        needed: usize,
    },
    /// Half of the rows or more are in contact.
    #[serde(skip)]
    #[error("{touched} of {rows} rows are in contact: remove the load from at least half of the rows and try again")]
    Contact {
        /// Number of rows in contact.
        touched: usize,
        /// Number of rows read.
        rows: usize,
    },
    /// A gain is far from 1.
    #[serde(skip)]
    #[error(
        "row {}, column {}: the reading is {gain:.2} times that at rest, which is too much for drift; check the wire, or \
         remove the load",
        row + 1,
        column + 1
    )]
    Gain {
        /// Index of the row among those read, from 0.
        row: usize,
        /// Column-wire, from 0.
        column: usize,
        /// Its gain.
        gain: f64,
    },
}
