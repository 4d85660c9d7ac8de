use std::ops::Range;

use faer::{Mat, Side, linalg::solvers::Solve};
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::antecedents::Antecedents;

/// Normal equations of the consequents on some samples: AᵀA and AᵀT of the regressors A and the targets T.
#[derive(Clone)]
pub(super) struct NormalEquations {
    gram: Mat<f64>,
    right: Mat<f64>,
}

/// Samples whose regressors are held at once.
const BLOCK: usize = 2048;

impl NormalEquations {
    /// Those of `samples` of the regressors and the targets.
    pub fn of(regressors: &Mat<f64>, targets: &Mat<f64>, samples: Range<usize>) -> Self {
        let a = regressors.subrows(samples.start, samples.len());
        let t = targets.subrows(samples.start, samples.len());
        Self {
            gram: a.transpose() * a,
            right: a.transpose() * t,
        }
    }

    /// Those of all samples, without holding all regressors at once.
    pub fn in_blocks(antecedents: &Antecedents, x: ArrayView2<'_, f64>, y: ArrayView2<'_, f64>) -> Self {
        let blocks = (0..x.nrows()).step_by(BLOCK).map(|start| {
            let block = Slice::from(start..x.nrows().min(start + BLOCK));
            let regressors = regressors(antecedents, x.slice_axis(Axis(0), block));
            let samples = 0..regressors.nrows();
            Self::of(&regressors, &matrix(y.slice_axis(Axis(0), block)), samples)
        });
        let order = antecedents.rules() * (x.ncols() + 1);
        blocks.fold(Self::zeros(order, y.ncols()), |sum, block| sum.plus(&block))
    }

    pub fn zeros(order: usize, outputs: usize) -> Self {
        Self {
            gram: Mat::zeros(order, order),
            right: Mat::zeros(order, outputs),
        }
    }

    pub fn plus(mut self, other: &Self) -> Self {
        self.gram += &other.gram;
        self.right += &other.right;
        self
    }

    pub fn minus(mut self, other: &Self) -> Self {
        self.gram -= &other.gram;
        self.right -= &other.right;
        self
    }

    /// Consequents (regressors × outputs) with a penalty of `ridge`, in proportion to the mean of the diagonal of AᵀA, on
    /// their squares. A penalty too small for the rounding of AᵀA is raised.
    pub fn consequents(&self, ridge: f64) -> Mat<f64> {
        let order = self.gram.nrows();
        let mean = self.gram.diagonal().column_vector().iter().sum::<f64>() / order as f64;
        let mut ridge = ridge;
        while ridge < 1.0 {
            let mut penalised = self.gram.clone();
            for k in 0..order {
                penalised[(k, k)] += ridge * mean;
            }
            if let Ok(factor) = penalised.llt(Side::Lower) {
                let solution = factor.solve(&self.right);
                if solution.is_all_finite() {
                    return solution;
                }
            }
            ridge *= 100.0;
        }
        Mat::zeros(order, self.right.ncols())
    }
}

/// Regressors (samples × rules·(inputs + 1)) of the inputs `x`: the firing strength of each rule times [x, 1].
pub(super) fn regressors(antecedents: &Antecedents, x: ArrayView2<'_, f64>) -> Mat<f64> {
    let strengths = antecedents.firing_strengths(x);
    let inputs = x.ncols();
    Mat::from_fn(x.nrows(), antecedents.rules() * (inputs + 1), |sample, column| {
        let (rule, input) = (column / (inputs + 1), column % (inputs + 1));
        let value = if input < inputs { x[[sample, input]] } else { 1.0 };
        strengths[[sample, rule]] * value
    })
}

/// The same values as a matrix of the solvers.
pub(super) fn matrix(values: ArrayView2<'_, f64>) -> Mat<f64> {
    Mat::from_fn(values.nrows(), values.ncols(), |i, j| values[[i, j]])
}

/// Consequents (regressors × outputs) of `y` on `x`. The penalty draws them to the mean of the targets, not to 0.
pub(super) fn fit_consequents(
    antecedents: &Antecedents,
    x: ArrayView2<'_, f64>,
    y: ArrayView2<'_, f64>,
    ridge: f64,
) -> Array2<f64> {
    let order = antecedents.rules() * (x.ncols() + 1);
    let Some(mean) = y.mean_axis(Axis(0)) else {
        return Array2::zeros((order, y.ncols()));
    };
    let solution = NormalEquations::in_blocks(antecedents, x, (&y - &mean).view()).consequents(ridge);
    // Firing strengths add up to 1, and so the constants of all rules together are one.
    Array2::from_shape_fn((order, y.ncols()), |(row, output)| {
        let constant = if row % (x.ncols() + 1) == x.ncols() {
            mean[output]
        } else {
            0.0
        };
        solution[(row, output)] + constant
    })
}
