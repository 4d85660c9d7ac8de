//! The explicit Jacobian, the reference for the structured products and steps.

use faer::{Mat, prelude::SolveLstsq};
use ndarray::Array2;

use crate::{network::Mlp, training::Examples};

/// Returns the errors of [`Mlp::forward`] in the order of the Jacobian's rows.
pub(in crate::training) fn errors(mlp: &Mlp, examples: &Examples) -> Mat<f64> {
    let mut errors = Vec::new();
    for block in examples.blocks() {
        let inputs = Array2::from_shape_fn((block.samples(), examples.inputs()), |(s, a)| block.inputs[(s, a)]);
        let outputs = mlp.forward(inputs.view());
        errors.extend(outputs.indexed_iter().map(|((s, t), y)| y - block.targets[(s, t)]));
    }
    Mat::from_fn(errors.len(), 1, |row, _| errors[row])
}

/// Returns J: one row per sample and output, one column per weight in the order of [`Mlp::weights`].
pub(in crate::training) fn jacobian(mlp: &Mlp, examples: &Examples) -> Mat<f64> {
    let shape = mlp.shape();
    let (inputs, hidden, outputs) = (shape.inputs, shape.hidden, shape.outputs);
    let (w, v) = (mlp.hidden_layer(), mlp.output_layer());
    let mut jacobian = Mat::zeros(examples.samples() * outputs, shape.weights());
    let samples = examples.blocks().iter();
    let samples = samples.flat_map(|block| (0..block.samples()).map(move |s| (block, s)));
    for (sample, (block, s)) in samples.enumerate() {
        let net = |i: usize| (0..=inputs).map(|a| block.inputs[(s, a)] * w[[a, i]]).sum::<f64>();
        let mut h: Vec<f64> = (0..hidden).map(|i| net(i).tanh()).collect();
        h.push(1.0);
        for t in 0..outputs {
            let row = sample * outputs + t;
            for i in 0..hidden {
                for a in 0..=inputs {
                    jacobian[(row, a * hidden + i)] = v[[i, t]] * (1.0 - h[i] * h[i]) * block.inputs[(s, a)];
                }
            }
            for (q, value) in h.iter().enumerate() {
                jacobian[(row, shape.hidden_weights() + q * outputs + t)] = *value;
            }
        }
    }
    jacobian
}

/// Damped least-squares problem min ‖[J; √mu I] δ + [e; 0]‖. QR decomposition gives the step without squaring the
/// condition number, as the normal equations do.
pub(super) struct DampedLeastSquares {
    matrix: Mat<f64>,
    right: Mat<f64>,
}

impl DampedLeastSquares {
    pub(super) fn new(mlp: &Mlp, examples: &Examples, mu: f64) -> Self {
        let (jacobian, errors) = (jacobian(mlp, examples), errors(mlp, examples));
        let (rows, weights) = (jacobian.nrows(), jacobian.ncols());
        Self {
            matrix: Mat::from_fn(rows + weights, weights, |row, column| {
                if row < rows {
                    jacobian[(row, column)]
                } else if row - rows == column {
                    mu.sqrt()
                } else {
                    0.0
                }
            }),
            right: Mat::from_fn(
                rows + weights,
                1,
                |row, _| if row < rows { -errors[(row, 0)] } else { 0.0 },
            ),
        }
    }

    pub(super) fn step(&self) -> Vec<f64> {
        let step = self.matrix.qr().solve_lstsq(&self.right);
        (0..step.nrows()).map(|k| step[(k, 0)]).collect()
    }

    /// Returns the fraction of the possible decrease of ‖[J; √mu I] δ + [e; 0]‖² that `step` misses, given the best
    /// step.
    pub(super) fn missed(&self, step: &[f64], best: &[f64]) -> f64 {
        let column = |step: &[f64]| Mat::from_fn(step.len(), 1, |row, _| step[row]);
        let apart = &self.matrix * (column(step) - column(best));
        apart.squared_norm_l2() / (&self.matrix * column(best)).squared_norm_l2()
    }

    /// Condition number of the damped normal equations: the square of the condition number of the matrix.
    pub(super) fn normal_condition(&self) -> f64 {
        let values = self.matrix.singular_values().unwrap();
        (values[0] / values[values.len() - 1]).powi(2)
    }
}

/// Returns the largest difference between two steps, relative to the largest entry of the second.
pub(super) fn distance(ours: &[f64], reference: &[f64]) -> f64 {
    let largest = reference
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let differences = ours.iter().zip(reference).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    #[test]
    fn the_jacobian_agrees_with_central_differences_of_the_network() {
        let (mlp, examples) = (random_mlp(4, 3, 2, 5), random_examples(20, 4, 2, 6));
        let (jacobian, step) = (jacobian(&mlp, &examples), 1e-5);
        for column in 0..jacobian.ncols() {
            let moved = |by: f64| {
                let mut moved = mlp.clone();
                moved.weights_mut()[column] += by;
                errors(&moved, &examples)
            };
            let (above, below) = (moved(step), moved(-step));
            for row in 0..jacobian.nrows() {
                let difference = (above[(row, 0)] - below[(row, 0)]) / (2.0 * step);
                let ours = jacobian[(row, column)];
                assert!(
                    (ours - difference).abs() < 1e-9,
                    "({row}, {column}): {ours} {difference}"
                );
            }
        }
    }
}
