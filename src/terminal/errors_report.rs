//! Errors of an answer in JSON: of the nodes of an array, or of each target of a recording.

use serde::Serialize;

use decoupler_core::evaluation::{
    Channel, TargetErrors, TestErrors,
    recorded::{Determination, Undetermined},
};

/// Errors of a decoder.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum ErrorsReport<'a> {
    /// On the nodes of an array.
    Nodes { z_percent: Option<f64>, z_mm: f64 },
    /// Target by target.
    Targets {
        /// Mean absolute error in percent of the range, averaged over the targets.
        percent_of_range: Option<f64>,
        targets: Vec<Target<'a>>,
    },
}

/// Errors for one target.
#[derive(Serialize)]
pub(super) struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    rmse: f64,
    mae: f64,
    r2: Option<f64>,
    /// 95 % confidence interval of R², of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    r2_interval: Option<[f64; 2]>,
    worst: f64,
    percent_of_range: Option<f64>,
}

impl<'a> ErrorsReport<'a> {
    pub(super) fn new(channels: &'a [Channel], errors: &TestErrors) -> Self {
        match errors {
            TestErrors::Nodes(errors) => Self::Nodes {
                z_percent: errors.z_percent,
                z_mm: errors.z_mm,
            },
            TestErrors::Targets(_) => Self::Targets {
                percent_of_range: errors.percent(),
                targets: targets(channels, errors, &[]),
            },
        }
    }
}

/// Returns the errors of the targets `channels`; `determined` are the coefficients of determination with their intervals, if they were
/// measured.
pub(super) fn targets<'a>(
    channels: &'a [Channel],
    errors: &TestErrors,
    determined: &[Result<Determination, Undetermined>],
) -> Vec<Target<'a>> {
    let target = |(index, (channel, errors)): (usize, (&'a Channel, &TargetErrors))| Target {
        name: &channel.name,
        unit: channel.unit.as_deref(),
        rmse: errors.rmse,
        mae: errors.mae,
        r2: errors.r2,
        r2_interval: determined
            .get(index)
            .and_then(|determined| determined.ok())
            .map(|determined| [determined.r2.low, determined.r2.high]),
        worst: errors.worst,
        percent_of_range: errors.percent_of_range,
    };
    let channels = channels.iter().zip(errors.targets());
    channels.enumerate().map(target).collect()
}
