use std::ops::Range;

use faer::{
    Accum, Mat, Par, Side,
    linalg::{
        matmul::triangular::{self, BlockStructure},
        solvers::Solve,
    },
};
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::antecedents::Antecedents;

/// Normal equations of the consequents on some samples: AᵀA and AᵀT of the regressors A and the targets T.
#[derive(Clone)]
pub(super) struct NormalEquations {
    /// The lower triangle.
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
        let mut gram = Mat::zeros(a.ncols(), a.ncols());
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular::matmul(
            gram.as_mut(),
            lower,
            Accum::Replace,
            a.transpose(),
            full,
            a,
            full,
            1.0,
            Par::Seq,
        );
        Self {
            gram,
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

    /// Consequents (regressors × outputs) that minimise the squared errors expected when the inputs have additional
    /// noise of these variances, with a penalty of `ridge`, in proportion to the mean of the diagonal of AᵀA, on their squares. A penalty
    /// too small for the rounding of AᵀA is raised.
    pub fn consequents(&self, ridge: f64, noise: Option<&[f64]>) -> Mat<f64> {
        let order = self.gram.nrows();
        let mean = self.gram.diagonal().column_vector().iter().sum::<f64>() / order as f64;
        let mut with_noise = self.gram.clone();
        if let Some(variances) = noise {
            self.add_noise(&mut with_noise, variances);
        }
        let mut ridge = ridge.max(f64::EPSILON);
        while ridge < 1.0 {
            let mut penalised = with_noise.clone();
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

    /// Adds to the lower triangle of AᵀA what noise of the inputs with these variances does, the firing strengths taken as
    /// they are: variance · Σ φᵣφₛ for each input and pair of rules.
    fn add_noise(&self, gram: &mut Mat<f64>, variances: &[f64]) {
        let of_rule = variances.len() + 1;
        let rules = gram.nrows() / of_rule;
        for (r, s) in (0..rules).flat_map(|r| (0..=r).map(move |s| (r * of_rule, s * of_rule))) {
            // The regressors of the constants, the last of each rule, are the firing strengths.
            let strengths = self.gram[(r + of_rule - 1, s + of_rule - 1)];
            for (k, variance) in variances.iter().enumerate() {
                gram[(r + k, s + k)] += variance * strengths;
            }
        }
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
    noise: Option<&[f64]>,
) -> Array2<f64> {
    let order = antecedents.rules() * (x.ncols() + 1);
    let Some(mean) = y.mean_axis(Axis(0)) else {
        return Array2::zeros((order, y.ncols()));
    };
    let solution = NormalEquations::in_blocks(antecedents, x, (&y - &mean).view()).consequents(ridge, noise);
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

#[cfg(test)]
mod tests {
    use super::*;
    use faer::linalg::solvers::SolveLstsq;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use serde::Deserialize;

    use crate::scene::normal::standard_normal;

    /// A case of `tests/fixtures/takagi_sugeno.py`.
    #[derive(Deserialize)]
    struct Case {
        x: Vec<Vec<f64>>,
        y: Vec<Vec<f64>>,
        centres: Vec<Vec<f64>>,
        width: f64,
        ridge: f64,
        firing_strengths: Vec<Vec<f64>>,
        consequents: Vec<Vec<f64>>,
    }

    fn array(rows: &[Vec<f64>]) -> Array2<f64> {
        Array2::from_shape_fn((rows.len(), rows[0].len()), |(i, j)| rows[i][j])
    }

    fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
        assert_eq!(a.dim(), b.dim());
        a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    /// The truth are consequents of many copies of the samples with drawn noise and the firing strengths of the samples
    /// without.
    #[test]
    fn noise_of_the_inputs_is_answered_as_if_many_noisy_copies_were_given() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let x = Array2::from_shape_simple_fn((30, 2), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((30, 1), |(s, _)| (x[[s, 0]] - 0.4 * x[[s, 1]]).sin());
        let y = &y - y.mean().unwrap();
        let antecedents = Antecedents::new(ndarray::array![[-1.0, 0.5], [1.0, -0.5]], 1.0);
        let variances = [0.09, 0.2];
        let clean = NormalEquations::in_blocks(&antecedents, x.view(), y.view());
        let ours = clean.consequents(1e-9, Some(&variances));
        let strengths = antecedents.firing_strengths(x.view());
        let copies = 4000;
        let draws = Array2::from_shape_simple_fn((30 * copies, 2), || standard_normal(&mut rng));
        let regressors = Mat::from_fn(30 * copies, 6, |row, column| {
            let (rule, k) = (column / 3, column % 3);
            let noisy = |k: usize| x[[row % 30, k]] + variances[k].sqrt() * draws[[row, k]];
            strengths[[row % 30, rule]] * if k < 2 { noisy(k) } else { 1.0 }
        });
        let targets = Mat::from_fn(30 * copies, 1, |row, t| y[[row % 30, t]]);
        let truth = regressors.qr().solve_lstsq(&targets);
        for k in 0..6 {
            let (ours, truth) = (ours[(k, 0)], truth[(k, 0)]);
            assert!((ours - truth).abs() < 0.02, "{k}: {ours} {truth}");
        }
    }

    #[test]
    fn firing_strengths_and_consequents_are_those_of_numpy() {
        let cases = include_str!("../../../tests/fixtures/takagi_sugeno.json");
        let cases: Vec<Case> = serde_json::from_str(cases).unwrap();
        assert_eq!(cases.len(), 4);
        for case in cases {
            let (x, y) = (array(&case.x), array(&case.y));
            let antecedents = Antecedents::new(array(&case.centres), case.width);
            let strengths = antecedents.firing_strengths(x.view());
            let error = largest_difference(&strengths, &array(&case.firing_strengths));
            assert!(error < 1e-12, "firing strengths: {error}");
            let ours = fit_consequents(&antecedents, x.view(), y.view(), case.ridge, None);
            let error = largest_difference(&ours, &array(&case.consequents));
            assert!(error < 1e-8, "consequents with penalty {}: {error}", case.ridge);
        }
    }

    #[test]
    fn a_system_of_two_rules_is_reproduced() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let x = Array2::from_shape_simple_fn((200, 2), || standard_normal(&mut rng));
        let antecedents = Antecedents::new(ndarray::array![[-1.0, 0.5], [1.0, -0.5]], 1.0);
        let membership = |x: f64, y: f64, a: f64, b: f64| (-0.5 * ((x - a).powi(2) + (y - b).powi(2))).exp();
        let truth = Array2::from_shape_fn((200, 1), |(s, _)| {
            let (a, b) = (x[[s, 0]], x[[s, 1]]);
            let (first, second) = (membership(a, b, -1.0, 0.5), membership(a, b, 1.0, -0.5));
            (first * (0.3 * a - 0.7 * b + 0.1) + second * (-0.2 * a + 0.4)) / (first + second)
        });
        let consequents = fit_consequents(&antecedents, x.view(), truth.view(), 1e-12, None);
        let expected = ndarray::array![[0.3], [-0.7], [0.1], [-0.2], [0.0], [0.4]];
        let error = largest_difference(&consequents, &expected);
        assert!(error < 1e-8, "{error}");
    }

    #[test]
    fn one_rule_is_the_affine_least_squares_map() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let x = Array2::from_shape_simple_fn((5000, 4), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((5000, 2), |(s, t)| (x[[s, t]] + 0.3 * x[[s, 3]]).exp());
        let ours = fit_consequents(&Antecedents::everywhere(), x.view(), y.view(), 1e-12, None);
        let dense = Mat::from_fn(5000, 5, |s, k| if k < 4 { x[[s, k]] } else { 1.0 });
        let least_squares = dense.qr().solve_lstsq(matrix(y.view()));
        let expected = Array2::from_shape_fn((5, 2), |(k, t)| least_squares[(k, t)]);
        let error = largest_difference(&ours, &expected);
        assert!(error < 1e-9, "{error}");
    }
}
