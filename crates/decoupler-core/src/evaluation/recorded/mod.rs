//! Analysis of recordings: how well the readings determine each target, channels without information, and the errors of
//! loading and unloading.
//!
//! Every figure is computed from held-out answers. Intervals have a confidence of 95 %, from independent stretches or groups
//! of samples, because neighbouring samples of a recording are nearly the same.

mod determination;
mod extrapolation;
mod findings;
mod hysteresis;
mod remarks;
mod split_comparison;

use ndarray::{Array1, ArrayView1, ArrayView2};

use super::{CrossValidated, errors::mean};
pub use crate::numerics::Interval;
use crate::{
    dataset::{Dataset, SplitBy},
    numerics::Evidence,
    problem::Channel,
};
pub use determination::{Determinacy, Determination, Undetermined};
pub use extrapolation::extrapolation;
pub use findings::{Findings, TargetFindings};
pub use hysteresis::HysteresisLoop;
pub use remarks::{channel_remarks, target_remarks};
pub use split_comparison::SplitComparison;

/// Returns the independent units of `set`: its groups if it is split by group, otherwise stretches of its samples.
pub(crate) fn evidence(set: &Dataset, by: SplitBy) -> Evidence {
    match by {
        SplitBy::Group => Evidence::Groups(set.snapshots()),
        SplitBy::Time | SplitBy::Random => Evidence::Order,
    }
}

/// Compares two decoders by their answers to all samples of `set` (samples × targets), target by target: the RMSE of both, and
/// the ratio of the second to the first; `None` if it is not determined.
fn compare(set: &Dataset, by: SplitBy, answers: [ArrayView2<'_, f64>; 2]) -> Vec<([f64; 2], Option<Interval>)> {
    let (evidence, targets) = (evidence(set, by), set.targets());
    let of_target = |target: usize| {
        let squares = |answers: ArrayView2<'_, f64>| (&answers.column(target) - &targets.column(target)).powi(2);
        let [one, other] = answers.map(squares);
        let totals = [one.sum(), other.sum()];
        let ratio = totals[1] / totals[0];
        let spread = evidence.variance(&((other - one * ratio) / totals[0]));
        let rmse = totals.map(|total| (total / set.samples() as f64).sqrt());
        (
            rmse,
            Interval::of_ratio(ratio, spread).map(|ratio| ratio.map(f64::sqrt)),
        )
    };
    (0..set.outputs()).map(of_target).collect()
}

/// Returns a remark on each target for which the network of a cross-validation of `set` is no or little better than ridge:
/// unless the ratio of their errors is a significant reduction by at least 5 %.
pub fn ridge_remarks(set: &Dataset, validated: &CrossValidated, by: SplitBy, targets: &[Channel]) -> Vec<String> {
    let compared = compare(set, by, [validated.linear.view(), validated.network.view()]);
    let remark = |(target, (_, ratio)): (&Channel, ([f64; 2], Option<Interval>))| {
        let Interval { value, low, high } = ratio.filter(|ratio| ratio.high >= 1.0 || ratio.value > 0.95)?;
        let better = if high < 1.0 { "little better" } else { "no better" };
        // The error does not show whether a nonlinear relation is absent, or this training has missed it.
        Some(format!(
            "the network is {better} than ridge for {} (error {value:.3} ({low:.3} to {high:.3}) times ridge's): with these \
             settings, use ridge",
            target.name
        ))
    };
    targets.iter().zip(compared).filter_map(remark).collect()
}

/// Returns the deviations of the values from their mean, divided by the largest to avoid overflow, and the largest.
fn scaled_deviations(values: ArrayView1<'_, f64>) -> (Array1<f64>, f64) {
    let mean = mean(values);
    let off = values.mapv(|value| value - mean);
    let largest = off.fold(0.0_f64, |largest, off| largest.max(off.abs()));
    (off / largest, largest)
}
