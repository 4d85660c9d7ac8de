use thiserror::Error;

use super::{LARGEST_LAG, LARGEST_SAMPLES, Span};
use crate::{scene::SceneError, sensor::SensorError, text::format_number};

/// Error in a set of samples, in drawing it, in its division or frames, or in a memory of the past.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DatasetError {
    /// The number of samples to draw is out of range.
    #[error("{0} samples: give from 1 to {LARGEST_SAMPLES}")]
    Count(usize),
    /// The array to draw samples of has no such row-wire.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model has no resistance for a drawn deformation.
    #[error("snapshot {}: {source}", .snapshot + 1)]
    Sensor {
        /// Index of the snapshot, from 0.
        snapshot: usize,
        /// Error of the sensor model.
        source: SensorError,
    },
    /// There are no samples, channels or targets.
    #[error("the {what} are {samples} × {columns}: give at least one sample and one column")]
    Empty {
        /// Part at fault: readings or targets.
        what: &'static str,
        /// Number of samples found.
        samples: usize,
        /// Number of columns found.
        columns: usize,
    },
    /// A part does not have one entry per sample.
    #[error("there are {found} {what} for {samples} samples: give one for each")]
    Length {
        /// Part at fault: targets, row-wires or groups.
        what: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of samples in the readings.
        samples: usize,
    },
    /// A sample belongs to a row-wire that is not read.
    #[error("sample {}: row-wire {} is not among the rows read; name every row-wire once, in ascending order", .sample + 1, .row_wire + 1)]
    RowWire {
        /// Index of the sample, from 0.
        sample: usize,
        /// Row-wire, from 0.
        row_wire: usize,
    },
    /// A snapshot lacks a row-wire, or has one twice.
    #[error("the snapshot of sample {} is incomplete: {found} samples of row-wire {}, but each row-wire read needs exactly one", .sample + 1, .row_wire + 1)]
    Incomplete {
        /// Index of the first sample of the snapshot, from 0.
        sample: usize,
        /// Row-wire at fault, from 0.
        row_wire: usize,
        /// Number of samples of this row-wire in the snapshot.
        found: usize,
    },
    /// A share is out of range.
    #[error("{part} fraction {value}: give a number from {least} to below 1, such as 0.2")]
    Fraction {
        /// Part at fault: test or validation.
        part: &'static str,
        /// Share given.
        value: f64,
        /// Smallest valid share.
        least: &'static str,
    },
    /// There is only one unit, so none is left for the test.
    #[error("all {samples} samples are one {unit}: a test set needs another; give a test file, or split another way")]
    TooFew {
        /// Number of samples.
        samples: usize,
        /// Name of the unit of division: sample or group.
        unit: &'static str,
    },
    /// The set cannot be divided into the given number of folds.
    #[error("{folds} folds of {units} {unit}s: give from 2 folds to as many as there are {unit}s")]
    Folds {
        /// Number of folds requested.
        folds: usize,
        /// Number of units in the set.
        units: usize,
        /// Name of the unit of the folds: sample, snapshot or group.
        unit: &'static str,
    },
    /// A span in seconds without an interval.
    #[error("a history of {0:#} needs times: name the time column, or give it in samples, as in 20")]
    NoClock(Span),
    /// A span in seconds, and times that do not advance.
    #[error(
        "a history of {0:#} needs the usual interval between samples, and no time is later than the one before in the same \
         group and row-wire: check the columns of times, groups and row-wires"
    )]
    NoInterval(Span),
    /// A time constant that would have no effect.
    #[error(
        "a time constant of {span:#} is shorter than the usual interval between samples{}: it would remember nothing; give a \
         longer one or, if the times are not in seconds, the unit of the time column",
        interval_s.map_or_else(String::new, |interval_s| format!(", {} s", format_number(interval_s)))
    )]
    TooShort {
        /// The time constant.
        span: Span,
        /// The interval in seconds, if known.
        interval_s: Option<f64>,
    },
    /// The interval is not a positive number.
    #[error("the interval of the history is {0} s: it must be more than 0")]
    MemoryInterval(f64),
    /// A lag that is no sample before, or too many.
    #[error("a lag of {lag:#} is {samples:.1} samples: it must be from 1 to {LARGEST_LAG}")]
    Lag {
        /// The lag.
        lag: Span,
        /// The lag in samples.
        samples: f64,
    },
    /// A time constant of no length.
    #[error("a time constant of {0:#} is not possible: it must be more than 0")]
    Average(Span),
    /// More features, or a larger state, than fit.
    #[error(
        "a history of {channels} channels has {features} features and a state of {state} values: use fewer or shorter lags"
    )]
    MemoryExcess {
        /// Number of channels.
        channels: usize,
        /// Number of features.
        features: usize,
        /// Number of values in the state.
        state: usize,
    },
    /// Text that is not a span.
    #[error("'{0}' is not a span of time: write a number of samples as in 20, or a time as in 2s, 100ms or 5min")]
    SpanText(String),
}

impl DatasetError {
    /// Checks that `units` units, each named `unit`, fill `folds` folds.
    ///
    /// # Errors
    /// If there are fewer than two folds, or more folds than units.
    pub(crate) fn check_folds(folds: usize, units: usize, unit: &'static str) -> Result<(), Self> {
        if (2..=units).contains(&folds) {
            Ok(())
        } else {
            Err(Self::Folds { folds, units, unit })
        }
    }
}
