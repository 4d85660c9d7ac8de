use faer::{Mat, Side, linalg::solvers::Solve};
use ndarray::{Array2, ArrayView2};

use super::errors::mean;
use crate::dataset::Folds;

/// Penalties of the standardised inputs, in units of the number of samples.
const PENALTIES: [f64; 9] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Ridge regressions of targets on standardised inputs for a range of penalties, cross-validated on given folds. In
/// contrast to leave-one-out errors, folds of consecutive samples keep neighbours of a test sample out of its training.
///
/// The products AᵀA and AᵀY are summed once for each fold; those of a training set are the sums over the other folds.
pub(super) struct RidgePath {
    /// Mean and reciprocal standard deviation of each input; 0 for one that does not vary.
    standard: Vec<(f64, f64)>,
    /// Products AᵀA and AᵀY of each fold, with a last column of ones in A.
    products: Vec<(Mat<f64>, Mat<f64>)>,
    /// Mean of each target, which is subtracted first: squares of a large offset would hide the changes.
    offsets: Vec<f64>,
    samples: f64,
    /// Index of the best penalty of each target.
    best: Vec<usize>,
    /// Sums of squared held-out errors with these penalties: fold × target.
    squares: Vec<Vec<f64>>,
}

impl RidgePath {
    /// Cross-validates regressions of `targets` (samples × targets) on `inputs` (samples × inputs); `None` if no penalty
    /// gives a solution.
    pub(super) fn new(inputs: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>, folds: &Folds) -> Option<Self> {
        let (n, m) = (inputs.ncols(), targets.ncols());
        let samples = inputs.nrows() as f64;
        let standard: Vec<(f64, f64)> = inputs
            .columns()
            .into_iter()
            .map(|column| {
                let mean = column.sum() / samples;
                let variance = column.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / samples;
                let deviation = variance.sqrt();
                let varies = deviation > 1e-12 * mean.abs() && deviation > 0.0;
                (mean, if varies { 1.0 / deviation } else { 0.0 })
            })
            .collect();
        let offsets: Vec<f64> = targets.columns().into_iter().map(mean).collect();
        let part = |fold: usize| {
            let test = folds.test(fold);
            let a = Mat::from_fn(test.len(), n + 1, |row, i| match standard.get(i) {
                Some((mean, scale)) => (inputs[[test[row], i]] - mean) * scale,
                None => 1.0,
            });
            let y = Mat::from_fn(test.len(), m, |row, t| targets[[test[row], t]] - offsets[t]);
            (a, y)
        };
        let parts: Vec<(Mat<f64>, Mat<f64>)> = (0..folds.count()).map(part).collect();
        let products: Vec<(Mat<f64>, Mat<f64>)> = parts
            .iter()
            .map(|(a, y)| (a.transpose() * a, a.transpose() * y))
            .collect();
        // Fold × penalty × target.
        let mut squares = vec![vec![vec![f64::INFINITY; m]; PENALTIES.len()]; folds.count()];
        for (fold, (a, y)) in parts.iter().enumerate() {
            let (gram, right) = sum(products
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != fold)
                .map(|(_, p)| p));
            let training = samples - a.nrows() as f64;
            for (penalty, squares) in PENALTIES.iter().zip(&mut squares[fold]) {
                let Some(map) = solve(&gram, &right, penalty * training) else {
                    continue;
                };
                let errors = a * map - y;
                for (t, square) in squares.iter_mut().enumerate() {
                    *square = errors.col(t).squared_norm_l2();
                }
            }
        }
        let best = |t: usize| {
            let total = |penalty: usize| squares.iter().map(|fold| fold[penalty][t]).sum::<f64>();
            (0..PENALTIES.len())
                .min_by(|&one, &other| total(one).total_cmp(&total(other)))
                .filter(|&penalty| total(penalty).is_finite())
        };
        let best: Vec<usize> = (0..m).map(best).collect::<Option<_>>()?;
        let of_fold = |fold: &Vec<Vec<f64>>| best.iter().enumerate().map(|(t, &penalty)| fold[penalty][t]).collect();
        Some(Self {
            squares: squares.iter().map(of_fold).collect(),
            standard,
            products,
            offsets,
            samples,
            best,
        })
    }

    /// Sums of squared held-out errors, with the best penalty of each target: fold × target.
    pub(super) fn squares(&self) -> &[Vec<f64>] {
        &self.squares
    }

    /// Returns the map fitted to all samples with the best penalty of each target: inputs + 1 × targets, the constant
    /// last; `None` if it has no solution.
    pub(super) fn coefficients(&self) -> Option<Array2<f64>> {
        let (gram, right) = sum(self.products.iter());
        let (n, m) = (self.standard.len(), self.best.len());
        let mut coefficients = Array2::zeros((n + 1, m));
        for (t, &penalty) in self.best.iter().enumerate() {
            let map = solve(&gram, &right, PENALTIES[penalty] * self.samples)?;
            let mut constant = self.offsets[t] + map[(n, t)];
            for (i, (mean, scale)) in self.standard.iter().enumerate() {
                coefficients[[i, t]] = map[(i, t)] * scale;
                constant -= mean * coefficients[[i, t]];
            }
            coefficients[[n, t]] = constant;
        }
        Some(coefficients)
    }

    /// Approximate number of multiplications of [`Self::new`].
    pub(super) fn multiplications(samples: usize, inputs: usize, folds: usize) -> f64 {
        let [samples, inputs, folds] = [samples, inputs + 1, folds].map(|size| size as f64);
        samples * inputs * inputs + folds * PENALTIES.len() as f64 * inputs.powi(3) / 6.0
    }
}

fn sum<'a>(mut products: impl Iterator<Item = &'a (Mat<f64>, Mat<f64>)>) -> (Mat<f64>, Mat<f64>) {
    let first = products.next().expect("there are at least two folds");
    products.fold(first.clone(), |(gram, right), (of_gram, of_right)| {
        (gram + of_gram, right + of_right)
    })
}

/// Solves the normal equations with a penalty on all but the constant.
fn solve(gram: &Mat<f64>, right: &Mat<f64>, penalty: f64) -> Option<Mat<f64>> {
    let constant = gram.nrows() - 1;
    let penalised = Mat::from_fn(constant + 1, constant + 1, |i, j| {
        gram[(i, j)] + if i == j && i < constant { penalty } else { 0.0 }
    });
    Some(penalised.llt(Side::Lower).ok()?.solve(right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the solution of scikit-learn: `Ridge(alpha=penalty · samples)` on standardised inputs.
    #[test]
    fn an_affine_relation_is_found_with_the_smallest_penalty() {
        let inputs = Array2::from_shape_fn((60, 3), |(s, i)| {
            ((7 * s + 13 * i * s + i) as f64).sin() * 10.0_f64.powi(i as i32)
        });
        let targets = Array2::from_shape_fn((60, 2), |(s, t)| match t {
            0 => 3.0 * inputs[[s, 0]] - 0.2 * inputs[[s, 2]] + 5.0,
            _ => inputs[[s, 1]],
        });
        let path = RidgePath::new(inputs.view(), targets.view(), &Folds::consecutive(60, 4)).unwrap();
        assert_eq!(path.best, [0, 0]);
        let map = path.coefficients().unwrap();
        for (found, expected) in [
            (map[[0, 0]], 3.0),
            (map[[1, 0]], 0.0),
            (map[[2, 0]], -0.2),
            (map[[3, 0]], 5.0),
            (map[[1, 1]], 1.0),
        ] {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }

    #[test]
    fn noise_is_answered_with_the_mean() {
        let inputs = Array2::from_shape_fn((80, 30), |(s, i)| ((s * s + 3 * i * s) as f64 * 0.7).sin());
        let targets = Array2::from_shape_fn((80, 1), |(s, _)| ((s * s * s) as f64 * 1.3).cos());
        let path = RidgePath::new(inputs.view(), targets.view(), &Folds::consecutive(80, 4)).unwrap();
        assert!(path.best[0] >= PENALTIES.len() - 2, "{:?}", path.best);
    }
}
