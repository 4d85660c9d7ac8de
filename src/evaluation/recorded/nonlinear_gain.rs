use super::{Interval, channel_importance::rmse_ratio};
use crate::{
    dataset::{Dataset, SplitBy},
    evaluation::CrossValidated,
};

/// Held-out error of the network beside that of ridge regression for one target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonlinearGain {
    /// RMSE of the network in proportion to that of ridge.
    pub ratio: Interval,
}

impl NonlinearGain {
    /// Compares the networks of a cross-validation on `set` with its ridge regressions, target by target; `None` where
    /// either has no error.
    ///
    /// # Panics
    /// If the set is not the one that was cross-validated.
    pub fn of_validated(set: &Dataset, validated: &CrossValidated, by: SplitBy) -> Vec<Option<Self>> {
        let answers = [validated.network.view(), validated.linear.view()];
        (0..set.outputs())
            .map(|target| {
                let ratio = rmse_ratio(set, answers, target, by)?;
                Some(Self { ratio })
            })
            .collect()
    }

    /// Part of ridge's error that a network must save to be worth its weights.
    const WORTH_HAVING: f64 = 0.05;

    /// Tells whether the network is better than ridge by at least 5 %, and by more than the interval shows.
    pub fn is_supported(&self) -> bool {
        self.ratio.high < 1.0 && self.ratio.value <= 1.0 - Self::WORTH_HAVING
    }

    /// A sentence on the target of this name where the network is no better than ridge, or hardly.
    pub fn remark(&self, name: &str) -> Option<String> {
        (!self.is_supported()).then(|| {
            let better = if self.ratio.high < 1.0 {
                "hardly better"
            } else {
                "no better"
            };
            format!(
                "the network is {better} than ridge for {name} (error {} times ridge's): these \
                 data do not support more than a linear map; give more samples, or take ridge",
                self.ratio
            )
        })
    }
}
