use std::fmt;

use ndarray::Array2;

use super::{
    ChannelImportance, ChannelRemark, Determinacy, Determination, FittedModel, LearningCurve, NonlinearGain,
    Undetermined, channel_importance,
    channel_remark::rmse_ratio,
    channel_remarks,
    evidence::{Evidence, SumVariance},
};
use crate::{
    dataset::{Dataset, Division, Folds, SplitBy, Stream},
    evaluation::{CrossValidated, Run, RunError, RunSettings, Scores, TargetErrors},
    job::Job,
    numerics::{autocorrelation, student_quantile},
};

/// Held-out errors with the same settings and samples, for folds by group (by time without groups) and for random
/// folds. The difference shows how optimistic a random split is.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitComparison {
    /// Rule of the folds that are not random.
    pub by: SplitBy,
    /// Errors of the network by that rule, target by target.
    pub network: Vec<TargetErrors>,
    /// Errors of ridge regression by that rule.
    pub ridge: Vec<TargetErrors>,
    /// Errors of the network on random folds.
    pub random_network: Vec<TargetErrors>,
    /// Errors of ridge regression on random folds.
    pub random_ridge: Vec<TargetErrors>,
    /// Ratio of the RMSE of the network on random folds to that by [`Self::by`] for each target, with its interval: below 1
    /// if random folds are optimistic. `None` if it is not determined.
    pub ratios: Vec<Option<Interval>>,
    /// Correlation of each target between successive samples of the recording; `None` for a constant target.
    pub successive: Vec<Option<f64>>,
}

impl SplitComparison {
    /// Minimum share of the error hidden by a random split that is reported.
    const MIN_OPTIMISM: f64 = 0.05;
    /// Minimum correlation of successive targets for which neighbours are called alike.
    const MIN_CORRELATION: f64 = 0.5;

    /// Compares random folds of `set` with folds by group if there are groups, otherwise by `by`, or by time if `by` is
    /// random. `validated` is the cross-validation with `folds` folds by `by`. Takes up to 2 × folds trainings.
    ///
    /// # Errors
    /// If the settings are invalid, or the job is cancelled.
    pub fn complete(
        settings: &RunSettings,
        set: &Dataset,
        folds: usize,
        (by, validated): (SplitBy, &CrossValidated),
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let validate = |rule: SplitBy| -> Result<CrossValidated, RunError> {
            if rule == by {
                return Ok(validated.clone());
            }
            let folds = rule.folds_of(set, folds);
            let folds = Folds::by(set, folds, rule, &mut settings.seed.rng(Stream::Split))?;
            CrossValidated::on_folds(settings, set, folds, job)
        };
        let honest = SplitBy::honest(set);
        let (of_honest, random) = (validate(honest)?, validate(SplitBy::Random)?);
        let answers = [random.network.view(), of_honest.network.view()];
        let ratio = |target| rmse_ratio(set, answers, target, honest);
        let ratios = (0..set.outputs()).map(ratio).collect();
        let scores = [of_honest.scores(set), random.scores(set)];
        Ok(Self::of(set, honest, scores, ratios))
    }

    /// Compares the test errors of two runs on parts of `set`, split by `by` and at random; `None` if a run is of a single fold.
    pub fn of_runs(set: &Dataset, by: SplitBy, [honest, random]: [&Run; 2]) -> Option<Self> {
        let scores = [honest.scores()?, random.scores()?];
        let spreads = [random, honest].map(|run| {
            let (test, answers) = (run.test(), run.decouple_test());
            let evidence = Evidence::of(test, by);
            let of_target = move |target: usize| {
                let truth = test.targets();
                let pairs = answers.column(target).into_iter().zip(truth.column(target));
                let squares = Vec::from_iter(pairs.map(|(answer, truth)| (answer - truth).powi(2)));
                evidence.variance_of_log_mean(&squares)
            };
            (0..set.outputs()).map(of_target).collect::<Vec<_>>()
        });
        // The test samples differ, so that the variances of the logarithms add up.
        let ratio = |target: usize| {
            let [random, honest] = [&spreads[0][target], &spreads[1][target]];
            let ratio = random.0 / honest.0;
            let spread = SumVariance {
                variance: ratio * ratio * (random.1.variance + honest.1.variance),
                units: random.1.units.min(honest.1.units),
                freedom: random.1.freedom.min(honest.1.freedom),
            };
            Some(Interval::of_ratio(ratio, spread)?.map(f64::sqrt))
        };
        let ratios = (0..set.outputs()).map(ratio).collect();
        Some(Self::of(set, by, scores, ratios))
    }

    fn of(set: &Dataset, by: SplitBy, [honest, random]: [Scores; 2], ratios: Vec<Option<Interval>>) -> Self {
        let errors =
            |scores: Scores| [&scores.baselines.linear, &scores.network].map(|errors| errors.targets().to_vec());
        let ([ridge, network], [random_ridge, random_network]) = (errors(honest), errors(random));
        Self {
            by,
            network,
            ridge,
            random_network,
            random_ridge,
            ratios,
            successive: set
                .targets()
                .columns()
                .into_iter()
                .map(|column| autocorrelation(column, 1))
                .collect(),
        }
    }

    /// Returns a clause on the cause of the optimism, as far as it was measured: alike neighbours leak from the training into
    /// the test samples; otherwise, the relation of readings and target itself changes.
    fn cause(&self, target: usize) -> String {
        let over = match self.by {
            SplitBy::Group => "from group to group",
            SplitBy::Time | SplitBy::Random => "over time, as with drift",
        };
        match self.successive[target] {
            Some(correlation) if correlation >= Self::MIN_CORRELATION => {
                format!(
                    "; successive values of the target correlate by {correlation:.2}, so that random folds share them"
                )
            }
            Some(correlation) => format!(
                "; successive values of the target correlate by {correlation:.2} only, so that the relation of readings \
                 and target seems to change {over}"
            ),
            None => String::new(),
        }
    }

    /// Returns a sentence on the error that a random split would have reported for the target of this name.
    pub fn sentence(&self, target: usize, name: &str) -> String {
        let (honest, random) = (self.network[target].rmse, self.random_network[target].rmse);
        let by = self.by;
        match self.ratios[target] {
            Some(ratio) if ratio.high < 1.0 && ratio.value < 1.0 - Self::MIN_OPTIMISM => format!(
                "a random split would report an RMSE of {random:.4} for {name}; split by {by} it is {honest:.4}: the random \
                 split is optimistic by {:.0} %{}",
                100.0 * (1.0 - ratio.value),
                self.cause(target)
            ),
            None => format!(
                "split at random, the RMSE of {name} is {random:.4}, and split by {by} {honest:.4}: too few independent \
                 samples to judge the difference"
            ),
            Some(_) => format!(
                "no significant difference between a random split (RMSE {random:.4} for {name}) and a split by {by} \
                 ({honest:.4})"
            ),
        }
    }
}

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
    /// Error of the network compared with ridge.
    pub gain: Option<NonlinearGain>,
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
                    gains = NonlinearGain::of_validated(set, &validated, by);
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
            is_told && gain.as_ref().is_some_and(NonlinearGain::is_supported)
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

/// Figure with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Figure from all samples.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Interval {
    /// Minimum number of independent units for an interval.
    pub(super) const FEWEST_UNITS: usize = 3;
    /// Maximum factor between an end and the figure; beyond it, the figure is not determined.
    const MAX_FACTOR: f64 = 100.0;

    /// Returns the interval of a positive ratio with sampling variance `spread`: a Student's t interval in the
    /// logarithm, in which the ratio of two sums of squares is nearly normal. `None` if the ratio is not determined.
    pub(super) fn of_ratio(ratio: f64, spread: SumVariance) -> Option<Self> {
        let reach = student_quantile(spread.freedom) * spread.variance.sqrt() / ratio;
        // False for NaN.
        let is_determined = ratio.is_finite() && ratio > 0.0 && reach <= Self::MAX_FACTOR.ln();
        (is_determined && spread.units >= Self::FEWEST_UNITS).then(|| Self {
            value: ratio,
            low: ratio * (-reach).exp(),
            high: ratio * reach.exp(),
        })
    }

    /// Returns the percentile interval (Efron 1979) of `replicates`, ignoring NaN; `None` if the figure itself is NaN,
    /// or fewer than half of the replicates remain.
    pub(super) fn of_replicates(value: f64, replicates: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = replicates.iter().copied().filter(|value| value.is_finite()).collect();
        if !value.is_finite() || 2 * sorted.len() < replicates.len() || sorted.is_empty() {
            return None;
        }
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64).round() as usize];
        Some(Self {
            value,
            // All of a few replicates may lie on one side.
            low: at(0.025).min(value),
            high: at(0.975).max(value),
        })
    }

    /// Returns the interval of a monotonic function of the figure.
    #[must_use]
    pub(super) fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        let [low, high] = [self.low, self.high].map(&function);
        Self {
            value: function(self.value),
            low: low.min(high),
            high: low.max(high),
        }
    }
}

impl fmt::Display for Interval {
    /// Writes `0.04 (0.01 to 0.09)`, with the given number of decimals, or two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        // Avoids -0.00.
        let places = 10.0_f64.powi(digits as i32);
        let [value, low, high] =
            [self.value, self.low, self.high].map(|figure| (figure * places).round() / places + 0.0);
        write!(f, "{value:.digits$} ({low:.digits$} to {high:.digits$})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_ratio(ratio: f64, variance: f64, units: usize) -> Option<Interval> {
        let freedom = units as f64 - 1.0;
        let spread = SumVariance {
            variance,
            units,
            freedom,
        };
        Interval::of_ratio(ratio, spread)
    }

    #[test]
    fn an_interval_is_written_with_both_ends() {
        // t with 20 degrees of freedom is 2.086: e^(±0.2086).
        let interval = of_ratio(1.0, 0.01, 21).unwrap();
        assert_eq!(format!("{interval:.4}"), "1.0000 (0.8117 to 1.2319)");
        assert_eq!(interval.map(|ratio| 1.0 - ratio).to_string(), "0.00 (-0.23 to 0.19)");
    }

    #[test]
    fn an_undetermined_ratio_has_no_interval() {
        for (ratio, variance, units) in [
            (1.0, 0.01, 2),
            (1.0, 10.0, 20),
            (1.0, f64::INFINITY, 20),
            (1.0, f64::NAN, 20),
            (0.0, 0.01, 20),
            (f64::INFINITY, 0.01, 20),
            (f64::NAN, 0.01, 20),
        ] {
            assert_eq!(of_ratio(ratio, variance, units), None, "{ratio} {variance} {units}");
        }
    }
}
