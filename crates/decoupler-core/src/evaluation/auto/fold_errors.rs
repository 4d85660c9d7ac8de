use ndarray::{ArrayView1, ArrayView2};

use super::super::errors::{mean, varies};
use crate::dataset::Folds;

/// Errors of held-out answers, fold by fold, relative to the spread of the targets.
///
/// With the mean squared error e and the variance σ² of each target, both over the same samples, the relative error is
/// √(mean of e/σ²) over the targets that vary: 0 for perfect answers, 1 for always answering the mean.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FoldErrors {
    /// Mean of e/σ² in each fold.
    of_folds: Vec<f64>,
    /// Mean of e/σ² over all samples.
    mean_square: f64,
}

impl FoldErrors {
    /// Evaluates the sums of squared errors `squares` (fold × target) of answers to targets with these [`variances`].
    pub(super) fn new(squares: &[Vec<f64>], variances: &[f64], folds: &Folds) -> Self {
        let sizes = Vec::from_iter((0..folds.count()).map(|fold| folds.test(fold).len()));
        let samples = sizes.iter().sum::<usize>() as f64;
        let varying = variances.iter().filter(|variance| **variance > 0.0).count().max(1) as f64;
        let of_fold = |(squares, size): (&Vec<f64>, &usize)| {
            let relative = squares.iter().zip(variances).filter(|(_, variance)| **variance > 0.0);
            let sum: f64 = relative.map(|(square, variance)| square / variance).sum();
            sum / varying / (*size).max(1) as f64
        };
        let of_folds = Vec::from_iter(squares.iter().zip(&sizes).map(of_fold));
        let shares = sizes.iter().map(|&size| size as f64 / samples);
        Self {
            mean_square: of_folds.iter().zip(shares).map(|(error, share)| error * share).sum(),
            of_folds,
        }
    }

    /// Relative error over all samples.
    pub(super) fn relative(&self) -> f64 {
        self.mean_square.sqrt()
    }

    /// Standard error of [`Self::relative`], from the differences between folds.
    pub(super) fn standard_error(&self) -> f64 {
        standard_error(&self.of_folds) / (2.0 * self.relative()).max(f64::MIN_POSITIVE)
    }

    /// Relative error plus its standard error. Candidates are ranked by it: of two that are alike on average, the one
    /// that is steadier from fold to fold is the safer choice for data yet to come.
    pub(super) fn upper(&self) -> f64 {
        self.relative() + self.standard_error()
    }

    /// Returns `true` if these errors exceed those of `other` on the same folds by no more than the standard error of
    /// the difference.
    pub(super) fn is_as_good_as(&self, other: &Self) -> bool {
        let differences = self
            .of_folds
            .iter()
            .zip(&other.of_folds)
            .map(|(one, other)| one - other);
        self.mean_square - other.mean_square <= standard_error(&Vec::from_iter(differences))
    }
}

/// Variance of each target; 0 for one that does not vary, or only by rounding.
pub(super) fn variances(targets: ArrayView2<'_, f64>) -> Vec<f64> {
    let of_target = |column: ArrayView1<'_, f64>| {
        if !varies(column) {
            return 0.0;
        }
        let mean = mean(column);
        column.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / column.len() as f64
    };
    targets.columns().into_iter().map(of_target).collect()
}

/// Standard error of the mean of a few values.
fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (count - 1.0).max(1.0) / count).sqrt()
}
