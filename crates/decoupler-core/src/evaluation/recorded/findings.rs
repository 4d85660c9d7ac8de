use std::fmt;

use ndarray::Array2;

use super::{Determinacy, Determination, Interval, LearningPoint, SplitComparison, Undetermined, nonlinear_gains};
use crate::{
    dataset::{Dataset, Division, Folds, Split, Stream},
    decoupling::decode_set,
    evaluation::{
        Begin, CrossValidated, Run, RunError, RunSets, RunSettings,
        baselines::fit_baselines,
        cross_validation::{nth_seed, scatter},
    },
    job::Job,
};

/// Findings on a recording: for each target, for each channel, and with fewer samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Model behind [`Self::importance`] and [`Self::curve`].
    pub model: FittedModel,
    /// Findings on each target.
    pub targets: Vec<TargetFindings>,
    /// Ratio of the held-out RMSE without a channel to that with all channels: channels × targets; `None` if it is not
    /// determined. Empty if there is only one channel.
    ///
    /// The model is fitted again without the channel, instead of permuting the channel: with correlated channels, the
    /// sensor never gives permuted readings, and the model's answers to them contain little information about the channel
    /// (Hooker, Mentch and Zhou 2021, doi:10.1007/s11222-021-10057-z). A channel that others can replace is therefore
    /// unimportant, even if a network relies on it; of two copies, neither is important.
    pub importance: Vec<Vec<Option<Interval>>>,
    /// Test errors by the number of training samples, in ascending order.
    pub curve: Vec<LearningPoint>,
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
}

/// Stage of [`Findings::measure`].
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
}

impl fmt::Display for StudyStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Folds => "cross-validation",
            Self::OtherFolds => "cross-validation by another split",
            Self::Channels => "fits without each channel",
            Self::Samples => "fits to fewer samples",
        })
    }
}

impl Findings {
    /// Maximum number of networks that [`Self::measure`] trains for this many channels, with this many folds.
    pub fn max_trainings(channels: usize, folds: usize) -> usize {
        (3 + channels) * folds + LearningPoint::MAX_FITS
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
        let (by, rng) = (division.by, || settings.seed.rng(Stream::Split));
        let all_folds = Folds::by(set, folds, by, &mut rng())?;
        let ends = || job.is_cancelled() || is_spent();
        let in_time = Job::new(&ends);
        begin(StudyStep::Folds);
        let of_ridge = FittedModel::Ridge.held_out(settings, set, &all_folds, job)?;
        let (mut validated, mut comparison, mut left_out) = (None, None, Vec::new());
        if model != Some(FittedModel::Ridge) {
            validated = unless_cancelled(CrossValidated::on_folds(settings, set, all_folds.clone(), &in_time))?;
            if let Some(validated) = &validated {
                begin(StudyStep::OtherFolds);
                let compared = SplitComparison::complete(settings, set, folds, (by, validated), &in_time);
                comparison = unless_cancelled(compared)?;
            }
            left_out.extend(validated.is_none().then_some(StudyStep::Folds));
            left_out.extend(comparison.is_none().then_some(StudyStep::OtherFolds));
        }
        job.check()?;
        let judged = |answers: &Array2<f64>| Determination::measure(set, answers.view(), by);
        let of_network = validated.as_ref();
        let of_network = of_network.map(|of| (judged(&of.network), nonlinear_gains(set, of, by)));
        let target = |(target, ridge): (usize, _)| TargetFindings {
            network: of_network.as_ref().and_then(|(network, _)| network[target].ok()),
            ridge,
            gain: of_network.as_ref().and_then(|(_, gains)| gains[target]),
        };
        let targets = Vec::from_iter(judged(&of_ridge).into_iter().enumerate().map(target));
        let best = match targets.iter().any(TargetFindings::needs_network) {
            true => FittedModel::Network,
            false => FittedModel::Ridge,
        };
        let mut model = model.unwrap_or(best);
        begin(StudyStep::Samples);
        let parts = division.divide(set, &mut rng())?;
        let curve = |model, job: &Job<'_>| LearningPoint::measure(settings, set, (&parts, by), model, job);
        let mut measured = unless_cancelled(curve(model, &in_time))?;
        if measured.is_none() {
            left_out.push(StudyStep::Samples);
            model = FittedModel::Ridge;
            measured = Some(curve(model, job)?);
        }
        begin(StudyStep::Channels);
        let with_all = match &validated {
            Some(validated) if model == FittedModel::Network => &validated.network,
            _ => &of_ridge,
        };
        let without = |channel: usize| -> Result<Vec<Option<Interval>>, RunError> {
            let others = Vec::from_iter((0..set.channels()).filter(|&other| other != channel));
            let without = model.held_out(settings, &set.of_channels(&others), &all_folds, &in_time)?;
            let growth = |target| Interval::of_rmse(set, [without.view(), with_all.view()], target, by);
            Ok((0..set.outputs()).map(growth).collect())
        };
        // With a single channel, there would be nothing left to fit.
        let channels = (0..set.channels()).filter(|_| set.channels() > 1);
        let importance = unless_cancelled(channels.map(without).collect())?;
        job.check()?;
        left_out.extend(importance.is_none().then_some(StudyStep::Channels));
        Ok(Self {
            model,
            targets,
            importance: importance.unwrap_or_default(),
            curve: measured.unwrap_or_default(),
            comparison,
            left_out,
        })
    }

    /// Returns `true` if the error of no target grows significantly without the channel.
    pub fn is_dispensable(&self, channel: usize) -> bool {
        self.importance[channel]
            .iter()
            .flatten()
            .all(|growth| growth.low <= 1.0)
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

    /// Returns `true` if the network is better than ridge. If the readings determine nothing, the better answer is only
    /// closer to the mean.
    fn needs_network(&self) -> bool {
        let is_explained = self.network.is_some_and(|network| {
            matches!(
                network.determinacy(),
                Determinacy::Determined | Determinacy::WeaklyDetermined
            )
        });
        is_explained && self.gain.as_ref().is_some_and(Interval::is_improvement)
    }
}

/// Model that is fitted repeatedly to measure how well the readings determine the targets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FittedModel {
    /// Ridge regression: a fit takes milliseconds, but it finds only linear relations.
    #[default]
    Ridge,
    /// The network of the settings: each fit is a training.
    Network,
}

impl FittedModel {
    /// Returns held-out answers for every sample of `set`, each by a model fitted without its fold; for the network,
    /// those of [`CrossValidated`].
    fn held_out(
        self,
        settings: &RunSettings,
        set: &Dataset,
        folds: &Folds,
        job: &Job<'_>,
    ) -> Result<Array2<f64>, RunError> {
        let holds_out = self == Self::Network && settings.training.method.needs_validation();
        let mut answers = Array2::zeros(set.targets().dim());
        for fold in 0..folds.count() {
            job.check()?;
            let seed = nth_seed(settings.seed, fold);
            let (split, test) = (folds.divided(fold, holds_out).split(set), set.select(folds.test(fold)));
            let of_fold = self.answers(&RunSettings { seed, ..*settings }, split, &test, job)?;
            scatter(&mut answers, folds.test(fold), &of_fold);
        }
        Ok(answers)
    }

    /// Returns the answers to `test` of the model fitted to `split`.
    pub(super) fn answers(
        self,
        settings: &RunSettings,
        split: Split,
        test: &Dataset,
        job: &Job<'_>,
    ) -> Result<Array2<f64>, RunError> {
        // A stretch may have no variation to learn from: ridge regression then answers with its mean.
        if self == Self::Ridge || !split.training.has_varying_target() {
            let (_, mut ridge) = fit_baselines(&split.training, settings)?;
            return Ok(decode_set(&mut ridge, test)?);
        }
        let mut run = Run::new(*settings, RunSets::new(split, test.clone()), Begin::Initialize, job)?;
        run.finish(job)?;
        Ok(run.decouple_test())
    }
}
