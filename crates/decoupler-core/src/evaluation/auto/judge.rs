use ndarray::{Array2, ArrayView1, ArrayView2};

use super::{
    super::{
        RunError,
        cross_validation::{nth_seed, scatter},
        errors::{mean, varies},
    },
    AutoSamples,
};
use crate::{
    dataset::{Folds, Seed, SplitBy, Stream},
    numerics::student_quantile,
};

/// Folds of the training samples, by which all candidates are judged, and the targets that count.
///
/// With the mean squared error e and the variance σ² of each target, both over the same samples, the relative error is
/// √(mean of e/σ²) over the targets that count: 0 for perfect answers, 1 for always answering the mean.
pub(super) struct Judge {
    /// Divisions of all samples: one, or several of few samples.
    pub(super) repeats: Vec<Folds>,
    /// Targets of all samples, once for each division.
    pub(super) truth: Array2<f64>,
    /// Variance of each target that counts; 0 for others.
    pub(super) variances: Vec<f64>,
}

impl Judge {
    /// Number of blocks, or sets of groups.
    pub(super) const FOLDS: usize = 5;
    /// Number of samples below which they are divided repeatedly, and number of divisions.
    pub(super) const FEW: usize = 40;
    const DIVISIONS: usize = 4;

    /// Divides the samples by their rule into up to `wanted` folds.
    pub(super) fn new(samples: &AutoSamples<'_>, wanted: usize, seed: Seed) -> Result<Self, RunError> {
        let set = samples.set;
        let is_few = set.samples() < Self::FEW && samples.by != SplitBy::Time;
        let count = if is_few { Self::DIVISIONS } else { 1 };
        let divide = |repeat| folds(samples, wanted, nth_seed(seed, repeat));
        let mut truth = set.targets().to_owned();
        for _ in 1..count {
            truth.append(ndarray::Axis(0), set.targets()).expect("the same targets");
        }
        Ok(Self {
            repeats: (0..count).map(divide).collect::<Result<_, _>>()?,
            truth,
            variances: variances(set.targets()),
        })
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.truth.nrows() / self.repeats.len()
    }

    /// Number of trainings of a candidate.
    pub(super) fn parts(&self) -> usize {
        self.repeats.iter().map(Folds::count).sum()
    }

    /// Samples outside and inside of each fold, and the rows of the held-out answers to those inside.
    pub(super) fn divisions(&self) -> impl Iterator<Item = (Vec<usize>, &[usize], Vec<usize>)> {
        self.repeats.iter().enumerate().flat_map(|(repeat, folds)| {
            let first = repeat * self.samples();
            (0..folds.count()).map(move |fold| {
                let test = folds.test(fold);
                (
                    folds.without(&[fold]),
                    test,
                    test.iter().map(|sample| first + sample).collect(),
                )
            })
        })
    }

    /// Collects held-out answers, part by part.
    pub(super) fn collect<E>(
        &self,
        mut answer: impl FnMut(&[usize], &[usize]) -> Result<Array2<f64>, E>,
    ) -> Result<Array2<f64>, E> {
        let mut all = Array2::zeros(self.truth.dim());
        for (outside, inside, rows) in self.divisions() {
            scatter(&mut all, &rows, &answer(&outside, inside)?);
        }
        Ok(all)
    }

    /// Mean of e/σ² of held-out answers in each part.
    fn of_parts(&self, answers: &Array2<f64>) -> Vec<f64> {
        let of_part = |(_, _, rows): (Vec<usize>, &[usize], Vec<usize>)| {
            let squares = rows.iter().map(|&row| self.square(answers, row));
            squares.sum::<f64>() / self.counted() / rows.len().max(1) as f64
        };
        self.divisions().map(of_part).collect()
    }

    fn counted(&self) -> f64 {
        self.variances.iter().filter(|variance| **variance > 0.0).count().max(1) as f64
    }

    /// Relative error of held-out answers, and its standard error from the differences between parts.
    pub(super) fn error(&self, answers: &Array2<f64>) -> (f64, f64) {
        let square: f64 = (0..self.variances.len())
            .map(|target| self.unexplained(target, answers))
            .sum();
        let error = (square / self.counted()).sqrt();
        let spread = standard_error(&self.of_parts(answers));
        (error, spread / (2.0 * error).max(f64::MIN_POSITIVE))
    }

    /// Share e/σ² of the variance of a target that held-out answers leave; 0 if it does not count.
    pub(super) fn unexplained(&self, target: usize, answers: &Array2<f64>) -> f64 {
        let variance = self.variances[target];
        let off = &answers.column(target) - &self.truth.column(target);
        let square = off.mapv(|error| error * error).sum() / off.len() as f64;
        if variance > 0.0 { square / variance } else { 0.0 }
    }

    /// Returns `true` if `ours` are better than `theirs`, and than the mean, by a paired t-test of the logarithms of their errors
    /// in the folds, with 1 % for the first of `candidates` that is wrongly found better (Bonferroni).
    pub(super) fn is_clearly_better(&self, ours: &Array2<f64>, theirs: &Array2<f64>, candidates: usize) -> bool {
        /// Fewer folds decide nothing.
        const FEWEST: usize = 4;
        /// Largest error of what is worth the additional inputs, relative to the other and to the mean.
        const WORTH: f64 = 0.97;
        let pairs = self.of_parts(ours).into_iter().zip(self.of_parts(theirs));
        let gains = Vec::from_iter(pairs.map(|(ours, theirs)| (theirs / ours).ln()));
        let mean = gains.iter().sum::<f64>() / gains.len() as f64;
        let error = self.error(ours).0;
        gains.len() >= FEWEST
            && error < WORTH * self.error(theirs).0.min(1.0)
            && mean > student_quantile(0.02 / candidates as f64, gains.len() as f64 - 1.0) * standard_error(&gains)
    }

    /// Sum of e/σ² of one row of held-out answers over the targets that count.
    fn square(&self, answers: &Array2<f64>, row: usize) -> f64 {
        let targets = self
            .variances
            .iter()
            .enumerate()
            .filter(|(_, variance)| **variance > 0.0);
        let square = |(t, variance): (usize, &f64)| (answers[[row, t]] - self.truth[[row, t]]).powi(2) / variance;
        targets.map(square).sum()
    }
}

/// Divides the samples into up to `wanted` folds by their rule; a part without enough groups is divided in time.
pub(super) fn folds(samples: &AutoSamples<'_>, wanted: usize, seed: Seed) -> Result<Folds, RunError> {
    let mut rng = seed.rng(Stream::Folds);
    let (set, groups) = (samples.set, samples.set.snapshots().len());
    Ok(match samples.by {
        SplitBy::Random => Folds::by(set, wanted, SplitBy::Random, &mut rng)?,
        SplitBy::Group if groups >= 2 => Folds::by(set, wanted.min(groups), SplitBy::Group, &mut rng)?,
        SplitBy::Time if groups >= 2 * wanted => Folds::by(set, wanted, SplitBy::Time, &mut rng)?,
        SplitBy::Time | SplitBy::Group => Folds::by(&set.ungrouped(), wanted, SplitBy::Time, &mut rng)?,
    })
}

/// Variance of each target; 0 for one that does not vary, or only by rounding.
fn variances(targets: ArrayView2<'_, f64>) -> Vec<f64> {
    let of_target = |column: ArrayView1<'_, f64>| {
        let mean = mean(column);
        let squares = column.iter().map(|value| (value - mean).powi(2));
        if varies(column) {
            squares.sum::<f64>() / column.len() as f64
        } else {
            0.0
        }
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
