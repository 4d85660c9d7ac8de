use super::{Interval, channel_importance::rmse_ratio};
use crate::{
    dataset::{Dataset, SplitBy},
    evaluation::CrossValidated,
};

/// Held-out error of the network next to that of ridge regression for one target.
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
                "little better"
            } else {
                "no better"
            };
            // Decimals that show on which side of 1 the interval ends.
            let differs = |decimals: &usize| format!("{:.decimals$}", self.ratio.high) != format!("{:.decimals$}", 1.0);
            let decimals = (2..6).find(differs).unwrap_or(2);
            // A training can miss what there is: restarts of Bayesian regularisation that all end as a linear map are no
            // proof that another method finds no more.
            format!(
                "the network is {better} than ridge for {name} (error {:.decimals$} times ridge's): this training found \
                 little more than a linear map; try another method or more starts, give more samples, or take ridge",
                self.ratio
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remark_blames_the_training_and_shows_on_which_side_of_ridge_the_error_is() {
        let remark = |value, low, high| {
            NonlinearGain {
                ratio: Interval { value, low, high },
            }
            .remark("y")
        };
        let worse = remark(1.004, 0.98, 1.02).unwrap();
        assert!(
            worse.contains("no better than ridge for y (error 1.00 (0.98 to 1.02) times ridge's)"),
            "{worse}"
        );
        assert!(
            worse.contains("this training found little more than a linear map; try another method"),
            "{worse}"
        );
        assert!(!worse.contains("these data do not support"), "{worse}");
        let hardly = remark(0.996, 0.994, 0.9991).unwrap();
        assert!(
            hardly.contains("little better") && hardly.contains("0.996 (0.994 to 0.999) times ridge's)"),
            "{hardly}"
        );
        assert_eq!(remark(0.7, 0.6, 0.8), None);
    }
}
