use faer::{Accum, Mat, Par, linalg::matmul::matmul};

use super::cholesky::{Cholesky, substitute};
use crate::{
    network::{Mlp, Shape},
    training::{Examples, activations::KeptActivations},
};

/// The linear least-squares problem of the output layer: G V = H̃ᵀT, G = H̃ᵀH̃.
///
/// Solved as a correction of the present V from its errors, G δV = −H̃ᵀE, so that rounding in G is corrected and not
/// repeated.
pub(super) struct OutputLayer {
    g: Mat<f64>,
    right: Mat<f64>,
    cholesky: Cholesky,
}

impl OutputLayer {
    pub(super) fn new(shape: Shape) -> Self {
        let h1 = shape.hidden + 1;
        Self {
            g: Mat::zeros(h1, h1),
            right: Mat::zeros(h1, shape.outputs),
            cholesky: Cholesky::new(h1),
        }
    }

    pub(super) fn solve(&mut self, mlp: &mut Mlp, examples: &Examples, kept: &mut KeptActivations) -> bool {
        kept.evaluate(mlp, examples);
        self.g.fill(0.0);
        self.right.fill(0.0);
        for (index, block) in examples.blocks().iter().enumerate() {
            let activations = kept.of(index, mlp, block);
            let hidden = activations.hidden.as_ref().subrows(0, block.samples());
            let errors = activations.errors.as_ref().subrows(0, block.samples());
            matmul(self.g.as_mut(), Accum::Add, hidden.transpose(), hidden, 1.0, Par::Seq);
            matmul(
                self.right.as_mut(),
                Accum::Add,
                hidden.transpose(),
                errors,
                1.0,
                Par::Seq,
            );
        }
        let ridge = ridge(&self.g);
        for node in 0..self.g.nrows() {
            self.g[(node, node)] += ridge;
        }
        if !self.cholesky.factor(self.g.as_mut()) {
            return false;
        }
        substitute(self.g.as_ref(), self.right.as_mut());
        let Shape { outputs, .. } = mlp.shape();
        let hidden_weights = mlp.shape().hidden_weights();
        let (_, v) = mlp.weights_mut().split_at_mut(hidden_weights);
        for (index, weight) in v.iter_mut().enumerate() {
            *weight -= self.right[(index / outputs, index % outputs)];
        }
        v.iter().all(|weight| weight.is_finite())
    }
}

/// What is added to the diagonal of G = H̃ᵀH̃ to keep it positive definite: 1e-13 of its largest entry, which is that of
/// the ones.
pub(super) fn ridge(g: &Mat<f64>) -> f64 {
    let last = g.nrows() - 1;
    1e-13 * g[(last, last)]
}
