use super::{
    Interval,
    channel_remark::rmse_ratio,
    evidence::{Evidence, SumVariance},
};
use crate::{
    dataset::{Dataset, Folds, SplitBy, Stream},
    evaluation::{CrossValidated, Run, RunError, RunSettings, Scores, TargetErrors},
    job::Job,
    numerics::autocorrelation,
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
