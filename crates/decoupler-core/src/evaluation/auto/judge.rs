use ndarray::{Array1, Array2, ArrayView1, Axis, concatenate};

use super::{
    super::{RunError, cross_validation::nth_seed, errors::varies},
    AutoSamples,
};
use crate::{
    dataset::{Folds, Seed, SplitBy, Stream},
    numerics::{is_positive_mean, standard_error},
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

    /// Divides the samples by their rule into up to `wanted` folds; without enough groups, in time.
    pub(super) fn new(samples: &AutoSamples<'_>, wanted: usize, seed: Seed) -> Result<Self, RunError> {
        let set = samples.set;
        let is_few = set.samples() < Self::FEW && samples.by != SplitBy::Time;
        let count = if is_few { Self::DIVISIONS } else { 1 };
        let groups = set.snapshots().len();
        let divide = |repeat| {
            let mut rng = nth_seed(seed, repeat).rng(Stream::Folds);
            match samples.by {
                SplitBy::Random => Folds::by(set, wanted, SplitBy::Random, &mut rng),
                SplitBy::Group if groups >= 2 => Folds::by(set, wanted.min(groups), SplitBy::Group, &mut rng),
                SplitBy::Time if groups >= 2 * wanted => Folds::by(set, wanted, SplitBy::Time, &mut rng),
                SplitBy::Time | SplitBy::Group => Folds::by(&set.ungrouped(), wanted, SplitBy::Time, &mut rng),
            }
        };
        // One that varies only by rounding does not vary.
        let variance = |column: ArrayView1<'_, f64>| if varies(column) { column.var(0.0) } else { 0.0 };
        Ok(Self {
            repeats: (0..count).map(divide).collect::<Result<_, _>>()?,
            truth: concatenate(Axis(0), &vec![set.targets(); count]).expect("the same targets"),
            variances: set.targets().columns().into_iter().map(variance).collect(),
        })
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.truth.nrows() / self.repeats.len()
    }

    /// Mean of the held-out answers to each sample.
    pub(super) fn mean_of_repeats(&self, answers: &Array2<f64>) -> Array2<f64> {
        let repeats = answers.axis_chunks_iter(Axis(0), self.samples());
        let none = Array2::zeros((self.samples(), answers.ncols()));
        repeats.fold(none, |sum, part| sum + part) / self.repeats.len() as f64
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

    /// Targets that count.
    pub(super) fn counted(&self) -> Vec<usize> {
        (0..self.variances.len())
            .filter(|&target| self.variances[target] > 0.0)
            .collect()
    }

    /// Relative squared error of each held-out answer for a target that counts.
    fn squares(&self, target: usize, answers: &Array2<f64>) -> Array1<f64> {
        (&answers.column(target) - &self.truth.column(target)).powi(2) / self.variances[target]
    }

    /// Mean of e/σ² of held-out answers in each part.
    fn of_parts(&self, answers: &Array2<f64>) -> Vec<f64> {
        let counted = self.counted();
        let squares = counted.iter().map(|target| self.squares(*target, answers));
        let squares = squares.fold(Array1::<f64>::zeros(answers.nrows()), |sum, squares| sum + squares);
        let of_part = |(_, _, rows): (Vec<usize>, &[usize], Vec<usize>)| {
            squares.select(Axis(0), &rows).sum() / (counted.len() * rows.len()).max(1) as f64
        };
        self.divisions().map(of_part).collect()
    }

    /// Relative error of held-out answers, and its standard error from the differences between parts.
    pub(super) fn error(&self, answers: &Array2<f64>) -> (f64, f64) {
        let counted = self.counted();
        let squares = counted.iter().map(|target| self.unexplained(*target, answers));
        let error = (squares.sum::<f64>() / counted.len().max(1) as f64).sqrt();
        (
            error,
            standard_error(&self.of_parts(answers)) / (2.0 * error).max(f64::MIN_POSITIVE),
        )
    }

    /// Share e/σ² of the variance of a target that held-out answers leave.
    pub(super) fn unexplained(&self, target: usize, answers: &Array2<f64>) -> f64 {
        self.squares(target, answers).sum() / answers.nrows() as f64
    }

    /// Returns `true` if `ours` are better than `theirs`, and than the mean, by a paired t-test of the logarithms of their errors
    /// in the folds, with 1 % for the first of `candidates` that is wrongly found better (Bonferroni).
    pub(super) fn is_clearly_better(&self, ours: &Array2<f64>, theirs: &Array2<f64>, candidates: usize) -> bool {
        /// Largest error of what is worth the additional inputs, relative to the other and to the mean.
        const WORTH: f64 = 0.97;
        let pairs = self.of_parts(ours).into_iter().zip(self.of_parts(theirs));
        let gains = Vec::from_iter(pairs.map(|(ours, theirs)| (theirs / ours).ln()));
        let error = self.error(ours).0;
        error < WORTH * self.error(theirs).0.min(1.0) && is_positive_mean(&gains, 0.01 / candidates as f64)
    }
}
