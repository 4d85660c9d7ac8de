use serde::{Deserialize, Serialize};

use super::{Errors, NoReference, RunError, RunSettings, Source};
use crate::{
    dataset::{Dataset, PerRow},
    decoupling::{AffineMap, TrainingMean},
    network::Quantity,
    scene::NoiseSource,
};

/// Errors of the baselines on the nodes, shown beside the network in every error table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines {
    /// Errors of always answering the mean of the training set.
    pub mean: Errors,
    /// Errors of the best affine map on resistance.
    pub linear: Errors,
    /// Errors of the Bayesian reference, the limit set by the noise and by the distribution of the loading:
    /// [`reference_errors`](super::reference_errors). Absent from older files.
    #[serde(default)]
    pub reference: Option<Errors>,
    /// Reason for which there is no reference, if one was sought.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_reference: Option<NoReference>,
}

/// Name of the linear baseline in tables.
pub(super) fn linear_name(source: &Source) -> &'static str {
    match source {
        Source::Simulated(_) => "linear map",
        Source::Measured(_) => "ridge",
    }
}

/// Fits the baselines: the training mean, of each row-wire where networks are told theirs, and an affine map on the readings.
/// For simulated samples that is the one of least squares, over all row-wires, for those of one can be fewer than its
/// readings; measured ones can be too few or too alike for it, so theirs is ridge regression.
pub(super) fn fit_baselines(
    training: &Dataset,
    settings: &RunSettings,
) -> Result<(PerRow<TrainingMean>, PerRow<AffineMap>), RunError> {
    let mean = |set: &Dataset| Ok::<_, RunError>(TrainingMean::fit(set));
    let mean = PerRow::fit(training, settings.source.row_model(), mean)?;
    let linear = match settings.source {
        Source::Simulated(_) => PerRow::shared(AffineMap::least_squares(training, Quantity::Resistance)?),
        Source::Measured(measured) => {
            let ridge = |set: &Dataset| AffineMap::ridge(set, settings.inputs, NoiseSource::default());
            PerRow::fit(training, measured.rows, ridge)?
        }
    };
    Ok((mean, linear))
}
