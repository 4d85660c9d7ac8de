//! Analysis of recordings: how well the readings determine each target, channels without information, and the errors of
//! loading and unloading.
//!
//! Every figure is computed from held-out answers, such as those of a [`CrossValidated`](super::CrossValidated). Intervals
//! have a confidence of 95 %, from independent stretches or groups of samples, because neighbouring samples of a recording
//! are nearly the same.

mod determination;
mod extrapolation;
mod findings;
mod hysteresis;
mod interval;
mod remarks;
mod split_comparison;

use ndarray::{Array1, ArrayView1};

use super::errors::mean;
pub use determination::{Determinacy, Determination, Undetermined, nonlinear_gains, ridge_remark};
pub use extrapolation::extrapolation;
pub use findings::{Findings, FittedModel, StudyStep, TargetFindings};
pub use hysteresis::{HysteresisLoop, LoopLevel};
pub(crate) use interval::Evidence;
pub use interval::Interval;
pub use remarks::{channel_remarks, target_remarks};
pub use split_comparison::SplitComparison;

/// Returns the deviations of the values from their mean, divided by the largest to avoid overflow, and the largest.
fn scaled_deviations(values: ArrayView1<'_, f64>) -> (Array1<f64>, f64) {
    let mean = mean(values);
    let off = values.mapv(|value| value - mean);
    let largest = off.fold(0.0_f64, |largest, off| largest.max(off.abs()));
    (off / largest, largest)
}
