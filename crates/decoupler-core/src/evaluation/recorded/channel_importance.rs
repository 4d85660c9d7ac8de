use ndarray::ArrayView2;

use super::{FittedModel, Interval, evidence::Evidence};
use crate::{
    dataset::{Dataset, Folds, SplitBy},
    evaluation::{RunError, RunSettings},
};

/// Growth of the error of each target without a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelImportance {
    /// Channel, from 0.
    pub channel: usize,
    /// RMSE without the channel in proportion to that with all, target by target; `None` if either is 0, or the target
    /// constant.
    pub growth: Vec<Option<Interval>>,
}

/// Measures how much the held-out error grows without each channel, in the order of the channels; `None` if cancelled.
///
/// The model is fitted again without the channel, rather than the channel permuted: with correlated channels, permuted
/// readings are such as the sensor never gives, and the model's answers to them say little about the channel (Hooker,
/// Mentch and Zhou 2021, doi:10.1007/s11222-021-10057-z). A channel that others can replace therefore counts little,
/// however much a network uses it; of two copies, neither counts.
///
/// Takes (channels + 1) × folds fits of `model`.
///
/// # Errors
/// If the settings are invalid.
pub fn channel_importance(
    settings: &RunSettings,
    set: &Dataset,
    (folds, by): (&Folds, SplitBy),
    model: FittedModel,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<Vec<ChannelImportance>>, RunError> {
    let channels = set.channels();
    let Some(with_all) = model.held_out(settings, set, folds, is_cancelled)? else {
        return Ok(None);
    };
    let mut found = Vec::with_capacity(channels);
    // Without its only channel, nothing is left to fit.
    for channel in (0..channels).filter(|_| channels > 1) {
        let others: Vec<usize> = (0..channels).filter(|&other| other != channel).collect();
        let Some(without) = model.held_out(settings, &set.of_channels(&others), folds, is_cancelled)? else {
            return Ok(None);
        };
        let growth = |target| rmse_ratio(set, [without.view(), with_all.view()], target, by);
        found.push(ChannelImportance {
            channel,
            growth: (0..set.outputs()).map(growth).collect(),
        });
    }
    Ok(Some(found))
}

/// RMSE of the first answers in proportion to that of the second, both to the same samples; `None` where it is not
/// determined.
pub(super) fn rmse_ratio(
    set: &Dataset,
    [ours, theirs]: [ArrayView2<'_, f64>; 2],
    target: usize,
    by: SplitBy,
) -> Option<Interval> {
    let truth = set.targets();
    let squared = |answers: &ArrayView2<'_, f64>| -> Vec<f64> {
        let pairs = answers.column(target).into_iter().zip(truth.column(target));
        pairs.map(|(answer, truth)| (answer - truth).powi(2)).collect()
    };
    let (ours, theirs) = (squared(&ours), squared(&theirs));
    let total: f64 = theirs.iter().sum();
    let ratio = ours.iter().sum::<f64>() / total;
    let influences = ours
        .iter()
        .zip(&theirs)
        .map(|(ours, theirs)| (ours - ratio * theirs) / total);
    let spread = Evidence::of(set, by).variance(&influences.collect::<Vec<_>>());
    Some(Interval::of_ratio(ratio, spread)?.map(f64::sqrt))
}

impl ChannelImportance {
    /// Largest growth over all targets; `None` if there is none.
    pub fn largest(&self) -> Option<Interval> {
        let growth = self.growth.iter().flatten().copied();
        growth.max_by(|one, other| one.value.total_cmp(&other.value))
    }

    /// Tells whether no target's error grows without the channel by more than its interval shows.
    pub fn is_dispensable(&self) -> bool {
        self.growth.iter().flatten().all(|growth| growth.low <= 1.0)
    }
}
