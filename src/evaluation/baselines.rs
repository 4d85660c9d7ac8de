use serde::{Deserialize, Serialize};

use super::{Errors, RunError, RunSettings, Source};
use crate::{
    dataset::Dataset,
    decoupling::{AffineMap, TrainingMean},
    network::Quantity,
};

/// Errors on nodes that stand beside a network's in every table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines {
    /// Always answering the mean of the training set.
    pub mean: Errors,
    /// The best affine map on resistance.
    pub linear: Errors,
    /// The Bayesian reference, the limit that noise and the loading's mean and covariance set:
    /// [`reference_errors`](super::reference_errors). Absent from older files.
    #[serde(default)]
    pub reference: Option<Errors>,
}

/// Fits what every network is held against: the training mean, and the affine map of least squares on the readings.
pub(super) fn fit_baselines(training: &Dataset, settings: &RunSettings) -> Result<(TrainingMean, AffineMap), RunError> {
    let quantity = match settings.source {
        Source::Simulated(_) => Quantity::Resistance,
        Source::Measured(_) => Quantity::Raw,
    };
    Ok((
        TrainingMean::fit(training),
        AffineMap::least_squares(training, quantity)?,
    ))
}
