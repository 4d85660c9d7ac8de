use std::ops::Range;

use faer::{
    Accum, Mat, Par, Side,
    linalg::{
        matmul::triangular::{self, BlockStructure},
        solvers::Solve,
    },
};
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};

use super::selection::Antecedents;
use crate::{decoupling::units::Units, network::ScalingError};

/// Normal equations of the consequents on some samples: AᵀA and AᵀT of the regressors A and the targets T.
#[derive(Clone)]
pub(super) struct NormalEquations {
    /// The lower triangle.
    gram: Mat<f64>,
    right: Mat<f64>,
}

/// Number of samples whose regressors are held in memory at once.
const BLOCK: usize = 2048;

impl NormalEquations {
    /// Sums over `samples` of the regressors and the targets.
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

    /// Sums over all units, whose targets are `y`, without holding all regressors at once.
    pub fn in_blocks(antecedents: &Antecedents, units: &Units, y: ArrayView2<'_, f64>) -> Self {
        let (count, inputs) = units.x.dim();
        let blocks = (0..count).step_by(BLOCK).map(|start| {
            let samples = start..count.min(start + BLOCK);
            let block = Slice::from(samples.clone());
            let weights = &units.weights[samples];
            let regressors = regressors(antecedents, units.x.slice_axis(Axis(0), block), weights);
            let targets = weighted(y.slice_axis(Axis(0), block), weights);
            let samples = 0..regressors.nrows();
            Self::of(&regressors, &targets, samples)
        });
        let order = antecedents.rules() * (inputs + 1);
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

    /// Consequents (regressors × outputs) that minimise the expected squared error when the inputs have additional
    /// noise of these variances, with a penalty of `ridge`, relative to the mean of the diagonal of AᵀA. A penalty
    /// too small for the rounding of AᵀA is raised; `None` if none is large enough, because sums overflow.
    pub fn consequents(&self, ridge: f64, noise: Option<&[f64]>) -> Option<Mat<f64>> {
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
                    return Some(solution);
                }
            }
            ridge *= 100.0;
        }
        None
    }

    /// Adds the effect of input noise with these variances to the lower triangle of AᵀA, with the firing strengths
    /// unchanged: variance · Σ φᵣφₛ for each input and pair of rules.
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

/// Regressors (samples × rules·(inputs + 1)) of the inputs `x`: the firing strength of each rule times [x, 1], times
/// the square root of the sample's weight.
pub(super) fn regressors(antecedents: &Antecedents, x: ArrayView2<'_, f64>, weights: &[f64]) -> Mat<f64> {
    let mut strengths = antecedents.firing_strengths(x);
    for (mut row, weight) in strengths.rows_mut().into_iter().zip(weights) {
        row *= weight.sqrt();
    }
    let inputs = x.ncols();
    Mat::from_fn(x.nrows(), antecedents.rules() * (inputs + 1), |sample, column| {
        let (rule, input) = (column / (inputs + 1), column % (inputs + 1));
        let value = if input < inputs { x[[sample, input]] } else { 1.0 };
        strengths[[sample, rule]] * value
    })
}

/// The targets `y` (samples × outputs) times the square roots of the sample weights.
pub(super) fn weighted(y: ArrayView2<'_, f64>, weights: &[f64]) -> Mat<f64> {
    Mat::from_fn(y.nrows(), y.ncols(), |i, j| weights[i].sqrt() * y[[i, j]])
}

/// Weighted mean of the targets of all units; `None` without samples.
pub(super) fn mean_target(units: &Units) -> Option<Array1<f64>> {
    let column = ArrayView2::from_shape((units.weights.len(), 1), &units.weights).ok()?;
    let total: f64 = units.weights.iter().sum();
    (total > 0.0).then(|| (&units.y * &column).sum_axis(Axis(0)) / total)
}

/// Penalty on the consequents of one output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Penalty {
    /// Relative to the mean of the diagonal of AᵀA.
    pub ridge: f64,
    /// True if the expected effect of input noise is included.
    pub is_noisy: bool,
}

/// Consequents (regressors × outputs) of `units`, each output with its penalty, which shrinks them towards the mean
/// of the targets, not to 0; `noise` are the variances of the input noise.
///
/// If the equations have no finite solution.
/// If the equations have no finite solution.
pub(super) fn fit_consequents(
    antecedents: &Antecedents,
    units: &Units,
    penalties: &[Penalty],
    noise: &[f64],
) -> Result<Array2<f64>, ScalingError> {
    let (inputs, outputs) = (units.x.ncols(), units.y.ncols());
    let order = antecedents.rules() * (inputs + 1);
    let mean = mean_target(units).ok_or(ScalingError::Empty)?;
    let equations = NormalEquations::in_blocks(antecedents, units, (&units.y - &mean).view());
    // Each penalty is solved for once.
    let mut solutions: Vec<(Penalty, Mat<f64>)> = Vec::new();
    let mut consequents = Array2::zeros((order, outputs));
    for (output, &penalty) in penalties.iter().enumerate() {
        let place = match solutions.iter().position(|(solved, _)| *solved == penalty) {
            Some(place) => place,
            None => {
                let solution = equations.consequents(penalty.ridge, penalty.is_noisy.then_some(noise));
                solutions.push((penalty, solution.ok_or(ScalingError::NotConverged)?));
                solutions.len() - 1
            }
        };
        for row in 0..order {
            // Firing strengths add up to 1, so the constants of all rules together are one constant.
            let constant = if row % (inputs + 1) == inputs {
                mean[output]
            } else {
                0.0
            };
            consequents[[row, output]] = solutions[place].1[(row, output)] + constant;
        }
    }
    Ok(consequents)
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::linalg::solvers::SolveLstsq;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use serde::Deserialize;

    use crate::scene::standard_normal;

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

    fn units(x: &Array2<f64>, y: &Array2<f64>) -> Units {
        Units {
            x: x.clone(),
            y: y.clone(),
            weights: vec![1.0; x.nrows()],
        }
    }

    /// Consequents with one penalty for all outputs.
    fn fit(antecedents: &Antecedents, units: &Units, ridge: f64) -> Array2<f64> {
        let penalty = Penalty { ridge, is_noisy: false };
        fit_consequents(antecedents, units, &vec![penalty; units.y.ncols()], &[]).unwrap()
    }

    fn array(rows: &[Vec<f64>]) -> Array2<f64> {
        Array2::from_shape_fn((rows.len(), rows[0].len()), |(i, j)| rows[i][j])
    }

    fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
        assert_eq!(a.dim(), b.dim());
        a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    /// Compares with consequents of many copies of the samples with drawn noise, and the firing strengths of the
    /// samples without noise.
    #[test]
    fn input_noise_is_equivalent_to_many_noisy_copies() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let x = Array2::from_shape_simple_fn((30, 2), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((30, 1), |(s, _)| (x[[s, 0]] - 0.4 * x[[s, 1]]).sin());
        let y = &y - y.mean().unwrap();
        let antecedents = Antecedents::new(ndarray::array![[-1.0, 0.5], [1.0, -0.5]], 1.0);
        let variances = [0.09, 0.2];
        let clean = NormalEquations::in_blocks(&antecedents, &units(&x, &y), y.view());
        let ours = clean.consequents(1e-9, Some(&variances)).unwrap();
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
    fn firing_strengths_and_consequents_match_numpy() {
        let cases = include_str!("../../../tests/fixtures/takagi_sugeno.json");
        let cases: Vec<Case> = serde_json::from_str(cases).unwrap();
        assert_eq!(cases.len(), 4);
        for case in cases {
            let (x, y) = (array(&case.x), array(&case.y));
            let antecedents = Antecedents::new(array(&case.centres), case.width);
            let strengths = antecedents.firing_strengths(x.view());
            let error = largest_difference(&strengths, &array(&case.firing_strengths));
            assert!(error < 1e-12, "firing strengths: {error}");
            let ours = fit(&antecedents, &units(&x, &y), case.ridge);
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
        let consequents = fit(&antecedents, &units(&x, &truth), 1e-12);
        let expected = ndarray::array![[0.3], [-0.7], [0.1], [-0.2], [0.0], [0.4]];
        let error = largest_difference(&consequents, &expected);
        assert!(error < 1e-8, "{error}");
    }

    #[test]
    fn one_rule_is_the_affine_least_squares_map() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let x = Array2::from_shape_simple_fn((5000, 4), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((5000, 2), |(s, t)| (x[[s, t]] + 0.3 * x[[s, 3]]).exp());
        let ours = fit(&Antecedents::everywhere(), &units(&x, &y), 1e-12);
        let dense = Mat::from_fn(5000, 5, |s, k| if k < 4 { x[[s, k]] } else { 1.0 });
        let least_squares = dense.qr().solve_lstsq(weighted(y.view(), &[1.0; 5000]));
        let expected = Array2::from_shape_fn((5, 2), |(k, t)| least_squares[(k, t)]);
        let error = largest_difference(&ours, &expected);
        assert!(error < 1e-9, "{error}");
    }

    /// Compares with fits to that many copies, and to each output alone.
    #[test]
    fn weights_equal_copies_and_each_output_has_its_penalty() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let x = Array2::from_shape_simple_fn((12, 2), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((12, 2), |(s, t)| (x[[s, t]] - 0.4 * x[[s, 1]]).sin());
        let weights: Vec<f64> = (0..12).map(|s| 1.0 + (s % 4) as f64).collect();
        let copies: Vec<usize> = (0..12).flat_map(|s| vec![s; weights[s] as usize]).collect();
        let antecedents = Antecedents::new(ndarray::array![[-1.0, 0.5], [1.0, -0.5]], 1.0);
        let gathered = Units {
            weights,
            ..units(&x, &y)
        };
        let all = units(&x.select(Axis(0), &copies), &y.select(Axis(0), &copies));
        let ridges = [1e-2, 1e-4];
        let penalties = ridges.map(|ridge| Penalty { ridge, is_noisy: false });
        let ours = fit_consequents(&antecedents, &gathered, &penalties, &[]).unwrap();
        for (t, ridge) in ridges.into_iter().enumerate() {
            let truth = fit(&antecedents, &all, ridge);
            let error = (&ours.column(t) - &truth.column(t)).mapv(f64::abs).sum();
            assert!(error < 1e-10, "{error}");
        }
    }

    #[test]
    fn overflowing_equations_are_an_error() {
        let x = Array2::from_shape_fn((20, 1), |(s, _)| 1e200 * s as f64);
        let y = Array2::from_shape_fn((20, 1), |(s, _)| s as f64);
        let penalty = Penalty {
            ridge: 1e-6,
            is_noisy: false,
        };
        let fitted = fit_consequents(&Antecedents::everywhere(), &units(&x, &y), &[penalty], &[]);
        assert_eq!(fitted, Err(ScalingError::NotConverged));
    }
}
