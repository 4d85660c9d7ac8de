use super::{Interval, compare};
use crate::{
    dataset::{Dataset, SplitBy},
    evaluation::auto::{Fits, TriedModel},
    numerics::autocorrelation,
    text::format_number,
};

/// Held-out errors of the better of ridge and kernel ridge regression on the same samples, for folds by group (by time without
/// groups) and for random folds. The difference shows how optimistic a random split is.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitComparison {
    /// Rule of the folds that are not random.
    pub by: SplitBy,
    /// Model by that rule.
    pub model: TriedModel,
    /// RMSE for each target by that rule, and on random folds.
    pub rmse: Vec<[f64; 2]>,
    /// Ratio of the RMSE on random folds to that by [`Self::by`] for each target, with its interval: below 1 if random folds
    /// are optimistic. `None` if it is not determined.
    pub ratios: Vec<Option<Interval>>,
    /// Correlation of each target between successive samples of the recording; `None` for a constant target.
    pub successive: Vec<Option<f64>>,
}

impl SplitComparison {
    /// Minimum share of the error hidden by a random split that is reported.
    const MIN_OPTIMISM: f64 = 0.05;
    /// Minimum correlation of successive targets for which neighbours are called alike.
    const MIN_CORRELATION: f64 = 0.5;

    /// Compares the better fit to `set` by the rule `by` with the better one on random folds.
    pub(super) fn of(set: &Dataset, by: SplitBy, fits: [&Fits; 2]) -> Self {
        let targets = set.targets();
        let compared = compare(set, by, fits.map(|fits| fits.answers[0].1.view()));
        let (rmse, ratios) = compared.into_iter().unzip();
        Self {
            by,
            model: fits[0].answers[0].0.model,
            rmse,
            ratios,
            successive: targets.columns().into_iter().map(|of| autocorrelation(of, 1)).collect(),
        }
    }

    /// Returns a clause on the cause of the optimism, as far as it was measured: alike neighbours leak from the training into
    /// the test samples; otherwise, the relation of readings and target itself changes.
    fn cause(&self, target: usize) -> String {
        let Some(correlation) = self.successive[target] else {
            return String::new();
        };
        let cause = match self.by {
            _ if correlation >= Self::MIN_CORRELATION => "so that random folds share them",
            SplitBy::Group => "so that the relation of readings and target seems to change from group to group",
            _ => "so that the relation of readings and target seems to change over time, as with drift",
        };
        format!("; successive values of the target correlate by {correlation:.2}, {cause}")
    }

    /// Returns a sentence on the error that a random split would have reported for the target of this name.
    pub fn sentence(&self, target: usize, name: &str) -> String {
        let [honest, random] = self.rmse[target].map(format_number);
        let (by, model) = (self.by, self.model);
        match self.ratios[target] {
            Some(ratio) if ratio.high < 1.0 && ratio.value < 1.0 - Self::MIN_OPTIMISM => format!(
                "a random split would report an RMSE of {random} for {name} by {model}; split by {by} it is {honest}: the \
                 random split is optimistic by {:.0} %{}",
                100.0 * (1.0 - ratio.value),
                self.cause(target)
            ),
            None => format!(
                "split at random, the RMSE of {name} by {model} is {random}, and split by {by} {honest}: too few \
                 independent samples to judge the difference"
            ),
            Some(_) => format!(
                "no significant difference between a random split (RMSE {random} for {name} by {model}) and a split by {by} \
                 ({honest})"
            ),
        }
    }
}
