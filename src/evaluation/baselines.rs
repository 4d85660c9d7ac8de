use serde::{Deserialize, Serialize};

use super::{Errors, RunError, RunSettings, Source};
use crate::{
    dataset::Dataset,
    decoupling::{AffineMap, TrainingMean},
    network::Quantity,
};

/// Errors of the baselines on the nodes, shown beside the network in every error table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines {
    /// Errors of always answering the mean of the training set.
    pub mean: Errors,
    /// Errors of the best affine map on resistance.
    pub linear: Errors,
    /// Errors of the Bayesian reference, the limit set by the noise and by the mean and covariance of the loading:
    /// [`reference_errors`](super::reference_errors). Absent from older files.
    #[serde(default)]
    pub reference: Option<Errors>,
}

/// Fits the baselines: the training mean, and the affine map of least squares on the readings.
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
