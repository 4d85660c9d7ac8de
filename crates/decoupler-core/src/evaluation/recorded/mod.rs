//! Analysis of recordings: how well the readings determine each target, the importance of each channel, the gain from
//! more samples, and the errors of loading and unloading.
//!
//! Every figure is computed from held-out answers, such as those of a [`CrossValidated`](super::CrossValidated), and
//! has a 95 % confidence interval from independent stretches or groups of samples, because neighbouring samples of a
//! recording are nearly the same.

mod channel_remark;
mod determination;
mod evidence;
mod extrapolation;
mod findings;
mod hysteresis;
mod interval;
mod learning_curve;
mod memory_gain;
mod split_comparison;

pub use channel_remark::{ChannelImportance, ChannelRemark, channel_importance, channel_remarks, target_remarks};
pub use determination::{Determinacy, Determination, Undetermined, nonlinear_gains, ridge_remark};
pub(crate) use evidence::Evidence;
pub use evidence::FittedModel;
pub use extrapolation::Extrapolation;
pub use findings::{Findings, StudyStep, TargetFindings};
pub use hysteresis::{HysteresisLoop, LoopLevel};
pub use interval::Interval;
pub use learning_curve::{LearningCurve, LearningPoint, PowerLaw};
pub use memory_gain::MemoryGain;
pub use split_comparison::SplitComparison;
