mod half_width;

use std::time::Duration;

use ndarray::{ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use super::{CrossValidated, Run, RunError, RunSettings, recorded::evidence};
use crate::{
    dataset::{Dataset, Folds, Seed, SplitBy, Stream},
    job::Job,
};
pub use half_width::HalfWidth;

/// Prediction intervals of decoded values: the answer plus or minus a half-width, target by target.
///
/// The half-widths come from held-out errors (conformal prediction: Vovk, Gammerman and Shafer 2005; cross-conformal
/// form: Barber, Candès, Ramdas and Tibshirani 2021, doi:10.1214/20-AOS1965), so they need no model of the noise. An
/// interval contains the true value with probability [`Self::NOMINAL`] as long as new samples are like the calibration
/// samples.
///
/// Errors of neighbouring samples of a recording are correlated. The level of the quantile of the absolute errors
/// therefore depends on the effective number of samples in place of their number. A target with fewer than
/// [`Self::FEWEST_SAMPLES`] effective samples has no interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intervals {
    /// Interval of each target; `None` if there are too few effective samples, or errors that are not finite.
    pub targets: Vec<Option<HalfWidth>>,
}

/// Coverage of the intervals of one target on a test set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Share of the test samples whose target is within its interval.
    pub share: f64,
    /// Mean half-width, in the unit of the target.
    pub half_width: f64,
    /// Lowest and highest share expected for test samples that are like the training samples, with 99 % confidence.
    pub expected: [f64; 2],
    /// Mean error (answer − target), in the unit of the target.
    pub bias: f64,
    /// `true` if too many errors are within a quarter of the half-width that the intervals are much too wide.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_too_wide: bool,
}

impl Intervals {
    /// Nominal coverage, 1 − α.
    pub const NOMINAL: f64 = 0.9;
    /// Minimum number of effective samples: with fewer independent ones, the rank of the quantile exceeds their number.
    pub const FEWEST_SAMPLES: f64 = 9.0;
    /// Number of folds of the cross-validation that yields held-out answers.
    pub const FOLDS: usize = 5;
    /// Longest [estimated time](Self::time) of a calibration that is not requested.
    pub const MAX_TIME: Duration = Duration::from_secs(60);

    /// Calibrates intervals on held-out `answers` (samples × targets) to all samples of `set`, each answer by a model
    /// that was fitted without its block of time or its group. `by` is the rule by which they were held out.
    ///
    /// Models that were fitted to fewer samples than the one in use are usually less accurate, which makes the intervals
    /// conservative.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn calibrate(set: &Dataset, answers: ArrayView2<'_, f64>, by: SplitBy) -> Self {
        assert_eq!(set.targets().dim(), answers.dim());
        let evidence = evidence(set, by);
        let folds = by.folds_of(set, Self::FOLDS);
        let folds = Folds::by(set, folds, by, &mut Seed(0).rng(Stream::Split)).ok();
        let targets = set.targets();
        let columns = targets.columns().into_iter().zip(answers.columns());
        let half_width = |(truth, answers): (ArrayView1<'_, f64>, ArrayView1<'_, f64>)| {
            let answers = answers.to_vec();
            let errors: Vec<f64> = answers
                .iter()
                .zip(truth)
                .map(|(answer, truth)| (answer - truth).abs())
                .collect();
            HalfWidth::calibrate(&answers, &errors, folds.as_ref(), &evidence)
        };
        Self {
            targets: columns.map(half_width).collect(),
        }
    }

    /// Estimates the time of [`Self::cross_validate`] after the training of `run`: each of the folds trains on the share
    /// (k − 1) / k of the samples. `None` if the time of the training is not known.
    pub fn time(run: &Run) -> Option<Duration> {
        Some((Self::FOLDS - 1) as u32 * run.wall_time()?)
    }

    /// Trains a network with `settings` for each of [`Self::FOLDS`] folds of `set` and calibrates on their held-out
    /// answers.
    ///
    /// # Errors
    /// If the settings are invalid, the set cannot be divided into folds or contains too few independent samples, or `job`,
    /// which is checked in every epoch, is cancelled.
    pub fn cross_validate(settings: &RunSettings, set: &Dataset, by: SplitBy, job: &Job<'_>) -> Result<Self, RunError> {
        let folds = by.folds_of(set, Self::FOLDS);
        let folds = Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split))?;
        let validated = CrossValidated::on_folds(settings, set, folds, job)?;
        Self::calibrate(set, validated.network.view(), by).checked()
    }

    /// Returns the intervals.
    ///
    /// # Errors
    /// If no target has one.
    pub fn checked(self) -> Result<Self, RunError> {
        if self.targets.iter().all(Option::is_none) {
            return Err(RunError::NoIntervals);
        }
        Ok(self)
    }

    /// Half-width of the interval of target `target` at this answer, in the unit of the target; `None` if the target
    /// has no interval.
    pub fn half_width(&self, target: usize, answer: f64) -> Option<f64> {
        Some(self.targets.get(target)?.as_ref()?.at(answer))
    }

    /// Measures the coverage of `answers` (samples × targets) to the test samples `test`; `None` for targets without an
    /// interval.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn coverage(&self, test: &Dataset, answers: ArrayView2<'_, f64>) -> Vec<Option<Coverage>> {
        assert_eq!(test.targets().dim(), answers.dim());
        let of = |(target, half_width): (usize, &Option<HalfWidth>)| {
            let half_width = half_width.as_ref()?;
            let (truth, answers) = (test.targets().column(target).to_vec(), answers.column(target));
            let pairs = truth.into_iter().zip(answers.iter().copied());
            Some(half_width.coverage(&Vec::from_iter(pairs)))
        };
        self.targets.iter().enumerate().map(of).collect()
    }

    /// Describes the first invalid value, for files.
    pub fn check(&self, targets: usize) -> Result<(), RunError> {
        if self.targets.len() != targets {
            let found = self.targets.len();
            return Err(RunError::IntervalCount {
                found,
                expected: targets,
            });
        }
        let is_valid = |half_width: &HalfWidth| {
            let widths = half_width.by_answer.iter().map(|point| point[1]);
            let mut widths = widths.chain([half_width.constant]);
            widths.all(|width| width >= 0.0 && width.is_finite())
                && half_width.by_answer.iter().all(|point| point[0].is_finite())
                && half_width.by_answer.windows(2).all(|pair| pair[0][0] < pair[1][0])
        };
        match self.targets.iter().position(|of| !of.as_ref().is_none_or(is_valid)) {
            Some(target) => Err(RunError::Interval(target)),
            None => Ok(()),
        }
    }
}

impl Coverage {
    /// Returns `true` if the coverage is significantly too low.
    pub fn is_too_low(&self) -> bool {
        self.share < self.expected[0]
    }

    /// Returns `true` if the coverage is significantly too high, or the intervals are much too wide.
    pub fn is_too_high(&self) -> bool {
        self.share > self.expected[1] || self.is_too_wide
    }
}

#[cfg(test)]
mod tests;
