//! Analysis of recordings: how well the readings determine each target, the importance of each channel, the errors with
//! fewer samples, and the errors of loading and unloading.
//!
//! Every figure is computed from held-out answers, such as those of a [`CrossValidated`](super::CrossValidated). Intervals
//! have a confidence of 95 %, from independent stretches or groups of samples, because neighbouring samples of a recording
//! are nearly the same.

mod determination;
mod extrapolation;
mod findings;
mod hysteresis;
mod interval;
mod learning_curve;
mod remarks;
mod split_comparison;

pub use determination::{Determinacy, Determination, Undetermined, nonlinear_gains, ridge_remark};
pub use extrapolation::Extrapolation;
pub use findings::{Findings, FittedModel, StudyStep, TargetFindings};
pub use hysteresis::{HysteresisLoop, LoopLevel};
pub(crate) use interval::Evidence;
pub use interval::Interval;
pub use learning_curve::LearningPoint;
pub use remarks::{channel_remarks, target_remarks};
pub use split_comparison::SplitComparison;
