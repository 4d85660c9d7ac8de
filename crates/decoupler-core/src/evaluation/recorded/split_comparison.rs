use crate::{
    dataset::{Dataset, Folds, SplitBy, Stream},
    evaluation::{CrossValidated, RunError, RunSettings, Scores, TargetErrors},
};

/// Held-out errors of the same settings on the same samples, once with folds by group (by time without groups), once with
/// random folds: the difference is how optimistic a random split is.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitComparison {
    /// Rule of the folds that are not optimistic.
    pub by: SplitBy,
    /// Errors of the network by that rule, target by target.
    pub network: Vec<TargetErrors>,
    /// Errors of ridge regression by that rule.
    pub ridge: Vec<TargetErrors>,
    /// Errors of the network on random folds.
    pub random_network: Vec<TargetErrors>,
    /// Errors of ridge regression on random folds.
    pub random_ridge: Vec<TargetErrors>,
}

impl SplitComparison {
    /// Share of the error that a random split must hide to be worth a sentence.
    const WORTH_SAYING: f64 = 0.05;

    /// Compares the cross-validation `validated` of `set`, with `folds` folds by `by`, with random folds: by group if there
    /// are groups, else by `by`, or by time if that is random; `None` if cancelled. Takes up to 2 × folds trainings.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn complete(
        settings: &RunSettings,
        set: &Dataset,
        folds: usize,
        (by, validated): (SplitBy, &CrossValidated),
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let scores = |rule: SplitBy| -> Result<Option<Scores>, RunError> {
            if rule == by {
                return Ok(Some(validated.scores(set)));
            }
            let folds = rule.folds_of(set, folds);
            let folds = Folds::by(set, folds, rule, &mut settings.seed.rng(Stream::Split))?;
            let validated = CrossValidated::on_folds(settings, set, folds, is_cancelled)?;
            Ok(validated.map(|validated| validated.scores(set)))
        };
        let honest = SplitBy::honest(set);
        let Some(of_honest) = scores(honest)? else {
            return Ok(None);
        };
        let random = scores(SplitBy::Random)?;
        Ok(random.map(|random| Self::of(honest, [of_honest, random])))
    }

    /// Compares the errors of two runs or cross-validations, by `by` and at random.
    pub fn of(by: SplitBy, [honest, random]: [Scores; 2]) -> Self {
        let errors =
            |scores: Scores| [&scores.baselines.linear, &scores.network].map(|errors| errors.targets().to_vec());
        let ([ridge, network], [random_ridge, random_network]) = (errors(honest), errors(random));
        Self {
            by,
            network,
            ridge,
            random_network,
            random_ridge,
        }
    }

    /// RMSE of the network on random folds in proportion to that by [`Self::by`]: below 1 where random folds are optimistic.
    /// `None` if the latter is 0.
    pub fn network_ratio(&self, target: usize) -> Option<f64> {
        ratio(&self.random_network[target], &self.network[target])
    }

    /// As [`Self::network_ratio`], of ridge regression.
    pub fn ridge_ratio(&self, target: usize) -> Option<f64> {
        ratio(&self.random_ridge[target], &self.ridge[target])
    }

    /// A sentence on what a random split would have reported for the target of this name.
    pub fn sentence(&self, target: usize, name: &str) -> String {
        let (honest, random) = (self.network[target].rmse, self.random_network[target].rmse);
        let by = self.by;
        match self.network_ratio(target) {
            Some(ratio) if ratio < 1.0 - Self::WORTH_SAYING => format!(
                "a random split would report an RMSE of {random:.4} for {name}; split by {by} it is {honest:.4}: the random \
                 split is optimistic by {:.0} %, because neighbouring samples are nearly the same",
                100.0 * (1.0 - ratio)
            ),
            _ => format!(
                "a random split is not optimistic here: RMSE {random:.4} for {name}, and {honest:.4} split by {by}"
            ),
        }
    }
}

fn ratio(random: &TargetErrors, honest: &TargetErrors) -> Option<f64> {
    Some(random.rmse / honest.rmse).filter(|ratio| ratio.is_finite())
}
