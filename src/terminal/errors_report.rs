//! Errors of a decoder in JSON: of the nodes of an array, or of each target of a recording.

use decoupler_core::{
    evaluation::{
        Coverage, TargetErrors, TestErrors,
        recorded::{Determination, Undetermined},
    },
    problem::Channel,
};
use serde_json::{Value, json};

use super::output::{joined, value};

/// Errors of a decoder: of the nodes of an array, or of each target with the mean absolute error in percent of the range.
pub(super) fn errors_object(channels: &[Channel], errors: &TestErrors) -> Value {
    match errors {
        TestErrors::Nodes(errors) => json!({"z_percent": errors.z_percent, "z_mm": errors.z_mm}),
        TestErrors::Targets(_) => {
            json!({"percent_of_range": errors.percent(), "targets": targets(channels, errors, &[], &[])})
        }
    }
}

/// Returns the errors of the targets `channels`; `determined` are the coefficients of determination with their 95 %
/// confidence intervals, and `coverage` that of the 90 % prediction intervals, if they were measured.
pub(super) fn targets(
    channels: &[Channel],
    errors: &TestErrors,
    determined: &[Result<Determination, Undetermined>],
    coverage: &[Option<Coverage>],
) -> Value {
    let target = |(index, (channel, errors)): (usize, (&Channel, &TargetErrors))| {
        let mut target = joined([json!({"name": channel.name, "unit": channel.unit}), value(errors)]);
        if let Some(Ok(Determination { r2, .. })) = determined.get(index) {
            target["r2_interval"] = json!([r2.low, r2.high]);
        }
        if let Some(Some(coverage)) = coverage.get(index) {
            target["interval"] = value(coverage);
        }
        target
    };
    let channels = channels.iter().zip(errors.targets());
    channels.enumerate().map(target).collect()
}
