//! The gradient of the mean squared error.

use faer::{Accum, Mat, MatMut, MatRef, Par, linalg::matmul::matmul};

use super::{
    Evaluation, Examples,
    activations::Activations,
    examples::{BLOCK, column, column_mut},
};
use crate::network::Mlp;

/// Computes the gradient of the mean squared error by back-propagation (section 3.1 of the paper).
#[derive(Clone, Debug)]
pub(super) struct Backpropagation {
    activations: Activations,
    /// Error at the hidden nodes' net input: block × hidden.
    delta: Mat<f64>,
    /// ∂mse/∂weights, in the order of [`Mlp::weights`].
    pub(super) gradient: Vec<f64>,
}

impl Backpropagation {
    pub(super) fn new(mlp: &Mlp) -> Self {
        Self {
            activations: Activations::new(mlp.shape()),
            delta: Mat::zeros(BLOCK, mlp.shape().hidden),
            gradient: vec![0.0; mlp.shape().weights()],
        }
    }

    /// Returns the error at the weights of `mlp` and computes its gradient.
    pub(super) fn evaluate(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        let shape = mlp.shape();
        self.gradient.fill(0.0);
        let (gradient_w, gradient_v) = self.gradient.split_at_mut(shape.hidden_weights());
        let mut gradient_w = MatMut::from_row_major_slice_mut(gradient_w, shape.inputs + 1, shape.hidden);
        let mut gradient_v = MatMut::from_row_major_slice_mut(gradient_v, shape.hidden + 1, shape.outputs);
        let v = MatRef::from_row_major_slice(mlp.layers().1, shape.hidden + 1, shape.outputs);
        let per_error = 2.0 / examples.errors();
        let mut squares = 0.0;
        for block in examples.blocks() {
            let samples = block.samples();
            squares += self.activations.forward(mlp, &block);
            let hidden = self.activations.hidden.as_ref().subrows(0, samples);
            let errors = self.activations.errors.as_ref().subrows(0, samples);
            matmul(
                gradient_v.as_mut(),
                Accum::Add,
                hidden.transpose(),
                errors,
                per_error,
                Par::Seq,
            );
            let mut delta = self.delta.as_mut().subrows_mut(0, samples);
            let v_without_bias = v.subrows(0, shape.hidden);
            matmul(
                delta.as_mut(),
                Accum::Replace,
                errors,
                v_without_bias.transpose(),
                1.0,
                Par::Seq,
            );
            for node in 0..shape.hidden {
                let outputs = column(hidden, node);
                for (delta, h) in column_mut(delta.as_mut(), node).iter_mut().zip(outputs) {
                    *delta *= 1.0 - h * h;
                }
            }
            matmul(
                gradient_w.as_mut(),
                Accum::Add,
                block.inputs.transpose(),
                delta.as_ref(),
                per_error,
                Par::Seq,
            );
        }
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: self.gradient.iter().map(|g| g * g).sum::<f64>().sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    #[test]
    fn the_gradient_agrees_with_central_differences() {
        let mlp = random_mlp(4, 3, 2, 5);
        // More than one block, the last one partly filled.
        let examples = random_examples(BLOCK + 44, 4, 2, 6);
        let mut backpropagation = Backpropagation::new(&mlp);
        backpropagation.evaluate(&mlp, &examples);
        let step = 1e-5;
        for (index, ours) in backpropagation.gradient.iter().enumerate() {
            let mse = |by: f64| {
                let mut moved = mlp.clone();
                moved.weights_mut()[index] += by;
                Activations::new(moved.shape()).mse(&moved, &examples)
            };
            let difference = (mse(step) - mse(-step)) / (2.0 * step);
            assert!((ours - difference).abs() < 1e-8, "weight {index}: {ours} {difference}");
        }
    }
}
