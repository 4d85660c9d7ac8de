use std::fmt;

use ndarray::Array2;

use super::{Determination, Interval, SplitComparison, Undetermined, nonlinear_gains};
use crate::{
    dataset::{Dataset, Folds, SplitBy, Stream},
    decoupling::decode_set,
    evaluation::{CrossValidated, RunError, RunSettings, baselines::fit_baselines, cross_validation::scatter},
    job::Job,
};

/// Findings on a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Findings on each target.
    pub targets: Vec<TargetFindings>,
    /// Comparison with a random split; `None` without networks.
    pub comparison: Option<SplitComparison>,
    /// Steps that were left out because the time was spent.
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
}

/// Stage of [`Findings::measure`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyStep {
    /// Cross-validation by the rule of the split.
    Folds,
    /// Cross-validation by other rules, for comparison.
    OtherFolds,
}

impl fmt::Display for StudyStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Folds => "cross-validation",
            Self::OtherFolds => "cross-validation by another split",
        })
    }
}

/// Model that is fitted to measure how well the readings determine the targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FittedModel {
    /// Ridge regression: a fit takes milliseconds, but it finds only linear relations.
    Ridge,
    /// The network of the settings: each fit is a training.
    Network,
}

impl Findings {
    /// Analyses `set` by cross-validation with this number of folds by this rule: with ridge regression, and with networks
    /// unless `model` is ridge. Once `is_spent` returns `true`, no network is trained any more; ridge regression comes first.
    /// Takes up to 3 trainings per fold.
    ///
    /// # Errors
    /// If the set cannot be divided, the settings are invalid, or the job is cancelled.
    pub fn measure(
        settings: &RunSettings,
        set: &Dataset,
        (by, count): (SplitBy, usize),
        model: FittedModel,
        begin: &dyn Fn(StudyStep),
        (job, is_spent): (&Job<'_>, &dyn Fn() -> bool),
    ) -> Result<Self, RunError> {
        let folds = Folds::by(set, count, by, &mut settings.seed.rng(Stream::Split))?;
        begin(StudyStep::Folds);
        let of_ridge = ridge_answers(settings, set, &folds, job)?;
        let (mut validated, mut comparison, mut left_out) = (None, None, Vec::new());
        if model == FittedModel::Network {
            let ends = || job.is_cancelled() || is_spent();
            let in_time = Job::new(&ends);
            validated = unless_cancelled(CrossValidated::on_folds(settings, set, folds, &in_time))?;
            if let Some(validated) = &validated {
                begin(StudyStep::OtherFolds);
                let compared = SplitComparison::complete(settings, set, count, (by, validated), &in_time);
                comparison = unless_cancelled(compared)?;
            }
            left_out.extend(validated.is_none().then_some(StudyStep::Folds));
            left_out.extend(comparison.is_none().then_some(StudyStep::OtherFolds));
        }
        job.check()?;
        let ridge = Determination::measure(set, of_ridge.view(), by).into_iter();
        let mut targets = Vec::from_iter(ridge.map(|ridge| TargetFindings {
            network: None,
            ridge,
            gain: None,
        }));
        if let Some(validated) = &validated {
            let networks = Determination::measure(set, validated.network.view(), by);
            let gains = nonlinear_gains(set, validated, by);
            for (target, (network, gain)) in targets.iter_mut().zip(networks.into_iter().zip(gains)) {
                (target.network, target.gain) = (network.ok(), gain);
            }
        }
        Ok(Self {
            targets,
            comparison,
            left_out,
        })
    }
}

/// Returns answers for every sample of `set` by ridge regression, each fitted without its fold.
fn ridge_answers(settings: &RunSettings, set: &Dataset, folds: &Folds, job: &Job<'_>) -> Result<Array2<f64>, RunError> {
    let mut answers = Array2::zeros(set.targets().dim());
    for fold in 0..folds.count() {
        job.check()?;
        let (_, mut ridge) = fit_baselines(&set.select(&folds.without(&[fold])), settings)?;
        let test = folds.test(fold);
        scatter(&mut answers, test, &decode_set(&mut ridge, &set.select(test))?);
    }
    Ok(answers)
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
