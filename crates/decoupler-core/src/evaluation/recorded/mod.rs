//! Judges recordings by the knowledge in them: of each target, by each channel, and with more samples.
//!
//! Everything is judged on held-out answers, such as those of a [`CrossValidated`](super::CrossValidated), and every
//! figure has a 95 % confidence interval from independent stretches or groups of samples, because neighbouring samples of a
//! recording are nearly the same.

mod channel_importance;
mod channel_remark;
mod determination;
mod evidence;
mod findings;
mod held_out;
mod interval;
mod learning_curve;
mod nonlinear_gain;
mod power_law;
mod resampling;
mod split_comparison;
mod student;

pub use channel_importance::{ChannelImportance, channel_importance};
pub use channel_remark::{ChannelRemark, channel_remarks};
pub use determination::{Determinacy, Determination, Undetermined};
pub use findings::{Findings, Stage, TargetFindings};
pub use held_out::FittedModel;
pub use interval::Interval;
pub use learning_curve::{Doubling, LearningCurve, LearningPoint};
pub use nonlinear_gain::NonlinearGain;
pub use power_law::PowerLaw;
pub use split_comparison::SplitComparison;
