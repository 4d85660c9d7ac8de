use super::{
    Interval,
    interval::{Evidence, SumVariance, squared_errors},
};
use crate::{
    dataset::{Dataset, Folds, SplitBy, Stream},
    evaluation::{CrossValidated, Run, RunError, RunSettings, Scores},
    job::Job,
    numerics::autocorrelation,
};

/// Held-out errors with the same settings and samples, for folds by group (by time without groups) and for random
/// folds. The difference shows how optimistic a random split is.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitComparison {
    /// Rule of the folds that are not random.
    pub by: SplitBy,
    /// Errors by that rule.
    pub honest: Scores,
    /// Errors on random folds.
    pub random: Scores,
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
        let by = SplitBy::honest(set);
        let (honest, random) = (validate(by)?, validate(SplitBy::Random)?);
        let answers = [random.network.view(), honest.network.view()];
        let ratio = |target| Interval::of_rmse(set, answers, target, by);
        Ok(Self::of(set, by, [honest.scores(set), random.scores(set)], ratio))
    }

    /// Compares the test errors of two runs on parts of `set`, split by `by` and at random; `None` if a run is of a single fold.
    pub fn of_runs(set: &Dataset, by: SplitBy, runs: [&Run; 2]) -> Option<Self> {
        let [honest, random] = runs;
        let scores = [honest.scores()?, random.scores()?];
        let tested = runs.map(|run| (run.test(), run.decouple_test()));
        let ratio = |target| {
            // Mean squared error, and the variance of its logarithm.
            let [honest, random] = tested.each_ref().map(|(test, answers)| {
                let squares = squared_errors(test, answers.view(), target);
                let total = squares.iter().sum::<f64>();
                let mean = total / squares.len() as f64;
                (mean, Evidence::of(test, by).variance(&((squares - mean) / total)))
            });
            let ratio = random.0 / honest.0;
            // The test samples differ, so that the variances of the logarithms add up.
            let spread = SumVariance {
                variance: ratio * ratio * (random.1.variance + honest.1.variance),
                units: random.1.units.min(honest.1.units),
            };
            Some(Interval::of_ratio(ratio, spread)?.map(f64::sqrt))
        };
        Some(Self::of(set, by, scores, ratio))
    }

    fn of(
        set: &Dataset,
        by: SplitBy,
        [honest, random]: [Scores; 2],
        ratio: impl Fn(usize) -> Option<Interval>,
    ) -> Self {
        let targets = set.targets();
        Self {
            by,
            honest,
            random,
            ratios: (0..set.outputs()).map(ratio).collect(),
            successive: targets.columns().into_iter().map(|of| autocorrelation(of, 1)).collect(),
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
        let [honest, random] = [&self.honest, &self.random].map(|scores| scores.network.targets()[target].rmse);
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
