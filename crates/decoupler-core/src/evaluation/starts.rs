use serde::{Deserialize, Serialize};

use crate::training::StopReason;

/// Result of one start of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartRecord {
    /// Training error (mse, scaled) of the best network.
    pub train_mse: f64,
    /// Validation error (mse, scaled) of the best network, if anything was held out.
    pub validation_mse: Option<f64>,
    /// AveZerr of the best network on the test set of an array, in percent; never used for selection.
    pub z_percent: Option<f64>,
    /// Mean absolute error of the best network on the test set of a recording, in percent of the range; never used for
    /// selection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub percent_of_range: Option<f64>,
    /// Number of epochs run.
    pub epochs: usize,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Reason for stopping; `None` while running.
    pub stop_reason: Option<StopReason>,
}

impl StartRecord {
    /// Returns the error in percent on the test set: [`TestErrors::percent`](super::TestErrors::percent).
    pub fn percent(&self) -> Option<f64> {
        self.z_percent.or(self.percent_of_range)
    }

    /// Returns the error by which the best start is selected: on the validation set, or on the training set if
    /// nothing is held out.
    pub fn deciding_mse(&self) -> f64 {
        self.validation_mse.unwrap_or(self.train_mse)
    }
}

/// Returns the index of the best start, from 0: the first with the lowest selection error.
pub fn best_start(starts: &[StartRecord]) -> Option<usize> {
    lowest(starts.iter().map(StartRecord::deciding_mse))
}

/// Returns the index of the first of the lowest errors.
pub(super) fn lowest(errors: impl IntoIterator<Item = f64>) -> Option<usize> {
    let numbered = errors.into_iter().enumerate();
    numbered
        .min_by(|(_, one), (_, other)| one.total_cmp(other))
        .map(|(place, _)| place)
}
