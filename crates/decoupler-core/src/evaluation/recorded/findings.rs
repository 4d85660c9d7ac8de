use std::fmt;

use ndarray::Array2;

use super::{
    ChannelImportance, ChannelRemark, Determinacy, Determination, FittedModel, Interval, LearningCurve,
    SplitComparison, Undetermined, channel_importance, channel_remarks, nonlinear_gains,
};
use crate::{
    dataset::{Dataset, Division, Folds, Stream},
    evaluation::{CrossValidated, RunError, RunSettings},
    job::Job,
};

/// Findings on a recording: for each target, for each channel, and with more samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Model behind [`Self::importance`] and the learning curves.
    pub model: FittedModel,
    /// Findings on each target.
    pub targets: Vec<TargetFindings>,
    /// Channels with too little or too much information, and targets whose changes cannot be held out.
    pub remarks: Vec<ChannelRemark>,
    /// Importance of each channel; empty if there is only one.
    pub importance: Vec<ChannelImportance>,
    /// Comparison with a random split; `None` without networks.
    pub comparison: Option<SplitComparison>,
    /// Steps that were left out, or done by ridge regression in place of the network, because the time was spent.
    pub left_out: Vec<StudyStep>,
}

/// Findings on one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetFindings {
    /// R² of the network; `None` without networks, or if it is not determined.
    pub network: Option<Determination>,
    /// R² of ridge regression, or the reason why it is not determined.
    pub ridge: Result<Determination, Undetermined>,
    /// Ratio of the RMSE of the network to that of ridge.
    pub gain: Option<Interval>,
    /// Error with fewer and more samples.
    pub curve: LearningCurve,
}

/// Stage of [`Findings::measure`], or of the measurements next to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StudyStep {
    /// Cross-validation by the rule of the split.
    Folds,
    /// Cross-validation by other rules, for comparison.
    OtherFolds,
    /// Fits without each channel.
    Channels,
    /// Fits to fewer samples.
    Samples,
    /// Cross-validation with a memory; see [`MemoryGain`](super::MemoryGain).
    Memory,
}

impl fmt::Display for StudyStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Folds => "cross-validation",
            Self::OtherFolds => "cross-validation by another split",
            Self::Channels => "fits without each channel",
            Self::Samples => "fits to fewer samples",
            Self::Memory => "cross-validation with inputs from the past",
        })
    }
}

impl Findings {
    /// Maximum number of networks that [`Self::measure`] trains for this many channels, with this many folds.
    pub fn max_trainings(channels: usize, folds: usize) -> usize {
        (3 + channels + 1) * folds + LearningCurve::MAX_FITS
    }

    /// Analyses `set` by cross-validation with `folds` folds by the rule of `division`, whose test samples are used for
    /// the learning curve. `model` is fitted without each channel and to fewer samples. By
    /// default it is the network if it is better than ridge regression for a target, otherwise ridge; with ridge, no
    /// network is trained at all. Once `is_spent` returns `true`, no network is trained any more and no channel left out; ridge
    /// regression comes first.
    ///
    /// # Errors
    /// If the set cannot be divided, the settings are invalid, or the job is cancelled.
    pub fn measure(
        settings: &RunSettings,
        set: &Dataset,
        (division, folds): (&Division, usize),
        model: Option<FittedModel>,
        begin: &dyn Fn(StudyStep),
        (job, is_spent): (&Job<'_>, &dyn Fn() -> bool),
    ) -> Result<Self, RunError> {
        let by = division.by;
        let folds_by = |by| Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split));
        let ends = || job.is_cancelled() || is_spent();
        let in_time = Job::new(&ends);
        begin(StudyStep::Folds);
        let judged = |answers: &Array2<f64>| Determination::measure(set, answers.view(), by);
        let ridge = judged(&FittedModel::Ridge.held_out(settings, set, &folds_by(by)?, job)?);
        let (mut network, mut gains, mut comparison) = (vec![None; set.outputs()], vec![None; set.outputs()], None);
        let mut left_out = Vec::new();
        if model != Some(FittedModel::Ridge) {
            match unless_cancelled(CrossValidated::on_folds(settings, set, folds_by(by)?, &in_time))? {
                None => left_out.push(StudyStep::Folds),
                Some(validated) => {
                    network = judged(&validated.network).into_iter().map(Result::ok).collect();
                    gains = nonlinear_gains(set, &validated, by);
                    begin(StudyStep::OtherFolds);
                    let compared = SplitComparison::complete(settings, set, folds, (by, &validated), &in_time);
                    comparison = unless_cancelled(compared)?;
                }
            }
            if comparison.is_none() {
                left_out.push(StudyStep::OtherFolds);
            }
        }
        job.check()?;
        // If the readings determine nothing, the better answer is only closer to the mean.
        let is_worth_it = gains.iter().zip(&network).any(|(gain, network)| {
            let is_told = network.as_ref().is_some_and(|network| {
                matches!(
                    network.determinacy(),
                    Determinacy::Determined | Determinacy::WeaklyDetermined
                )
            });
            is_told && gain.as_ref().is_some_and(Interval::is_improvement)
        });
        let best = if is_worth_it {
            FittedModel::Network
        } else {
            FittedModel::Ridge
        };
        let mut model = model.unwrap_or(best);
        begin(StudyStep::Samples);
        let parts = division.divide(set, &mut settings.seed.rng(Stream::Split))?;
        let curves = LearningCurve::measure(settings, set, (&parts, by), model, &in_time);
        let curves = match unless_cancelled(curves)? {
            Some(curves) => curves,
            None => {
                left_out.push(StudyStep::Samples);
                model = FittedModel::Ridge;
                LearningCurve::measure(settings, set, (&parts, by), model, job)?
            }
        };
        begin(StudyStep::Channels);
        let importance = channel_importance(settings, set, (&folds_by(by)?, by), model, &in_time);
        job.check()?;
        let importance = unless_cancelled(importance)?.unwrap_or_else(|| {
            left_out.push(StudyStep::Channels);
            Vec::new()
        });
        let targets = network.into_iter().zip(ridge).zip(gains).zip(curves);
        let target = |(((network, ridge), gain), curve)| TargetFindings {
            network,
            ridge,
            gain,
            curve,
        };
        Ok(Self {
            model,
            targets: targets.map(target).collect(),
            remarks: channel_remarks(set, by),
            importance,
            comparison,
            left_out,
        })
    }
}

/// Returns what was measured; `None` if the measurement was cancelled.
fn unless_cancelled<T>(measured: Result<T, RunError>) -> Result<Option<T>, RunError> {
    match measured {
        Err(RunError::Cancelled(_)) => Ok(None),
        measured => measured.map(Some),
    }
}

impl TargetFindings {
    /// Returns the better of network and ridge, with its R².
    pub fn best(&self) -> Option<(FittedModel, Determination)> {
        let network = self.network.map(|network| (FittedModel::Network, network));
        let ridge = self.ridge.ok().map(|ridge| (FittedModel::Ridge, ridge));
        match (network, ridge) {
            (Some(network), Some(ridge)) if ridge.1.r2.value >= network.1.r2.value => Some(ridge),
            (network, ridge) => network.or(ridge),
        }
    }
}
