use serde::{Deserialize, Serialize};

use crate::training::StopReason;

/// How one start of a run went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartRecord {
    /// Training error (mse, scaled) of its best network.
    pub train_mse: f64,
    /// Validation error of its best network, if anything was held out.
    pub validation_mse: Option<f64>,
    /// AveZerr of its best network on the test set; it decides nothing.
    pub z_percent: Option<f64>,
    /// Epochs run.
    pub epochs: usize,
    /// The epoch of its best network.
    pub best_epoch: usize,
    /// Why it ended; `None` while it runs.
    pub stop_reason: Option<StopReason>,
}

impl StartRecord {
    /// The error that decides which start is best: on the validation set, or on the training set where nothing is
    /// held out.
    pub fn deciding_mse(&self) -> f64 {
        self.validation_mse.unwrap_or(self.train_mse)
    }
}

/// The number of the best start, from 0: the first of lowest deciding error.
pub fn best_start(starts: &[StartRecord]) -> Option<usize> {
    lowest(starts.iter().map(StartRecord::deciding_mse))
}

/// The place of the first lowest of some errors.
pub(super) fn lowest(errors: impl IntoIterator<Item = f64>) -> Option<usize> {
    let numbered = errors.into_iter().enumerate();
    numbered
        .min_by(|(_, one), (_, other)| one.total_cmp(other))
        .map(|(place, _)| place)
}
