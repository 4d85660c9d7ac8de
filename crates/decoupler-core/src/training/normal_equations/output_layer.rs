//! The least-squares output layer.

use faer::{Accum, Mat, Par, linalg::matmul::matmul};

use super::cholesky::{Cholesky, substitute};
use crate::{
    network::{Mlp, Shape},
    training::{Examples, activations::KeptActivations},
};

/// The linear least-squares problem of the output layer: G V = H̃ᵀT, G = H̃ᵀH̃.
///
/// It is solved as a correction of the current V, G δV = −H̃ᵀE, so that rounding errors in G are corrected at the next
/// solution instead of repeated.
pub(super) struct OutputLayer {
    /// One for each part of the samples; once gathered, the first has the sums of all.
    parts: Vec<Sums>,
    cholesky: Cholesky,
}

struct Sums {
    /// H̃ᵀH̃.
    g: Mat<f64>,
    /// H̃ᵀE.
    right: Mat<f64>,
}

impl OutputLayer {
    /// Allocates for samples in this many `parts`.
    pub(super) fn new(shape: Shape, parts: usize) -> Self {
        let h1 = shape.hidden + 1;
        let sums = || Sums {
            g: Mat::zeros(h1, h1),
            right: Mat::zeros(h1, shape.outputs),
        };
        Self {
            parts: (0..parts).map(|_| sums()).collect(),
            cholesky: Cholesky::new(h1),
        }
    }

    /// Replaces the output layer of `mlp`; `None` if there is no solution in the arithmetic.
    pub(super) fn solve(&mut self, mlp: &mut Mlp, examples: &Examples, kept: &mut KeptActivations) -> Option<()> {
        kept.evaluate(mlp, examples);
        for sums in &mut self.parts {
            sums.g.fill(0.0);
            sums.right.fill(0.0);
        }
        kept.for_each_block(mlp, examples, &mut self.parts, |sums, now| {
            let (hidden, errors) = (now.hidden(), now.errors());
            let (add, alone) = (Accum::Add, Par::Seq);
            matmul(sums.g.as_mut(), add, hidden.transpose(), hidden, 1.0, alone);
            matmul(sums.right.as_mut(), add, hidden.transpose(), errors, 1.0, alone);
        });
        let (first, others) = self.parts.split_at_mut(1);
        let Sums { g, right } = &mut first[0];
        for other in others {
            *g += &other.g;
            *right += &other.right;
        }
        let ridge = ridge(g);
        for node in 0..g.nrows() {
            g[(node, node)] += ridge;
        }
        self.cholesky.factor(g.as_mut())?;
        substitute(g.as_ref(), right.as_mut());
        let Shape { outputs, .. } = mlp.shape();
        let hidden_weights = mlp.shape().hidden_weights();
        let (_, v) = mlp.weights_mut().split_at_mut(hidden_weights);
        for (index, weight) in v.iter_mut().enumerate() {
            *weight -= right[(index / outputs, index % outputs)];
        }
        v.iter().all(|weight| weight.is_finite()).then_some(())
    }
}

/// Ridge on the diagonal of G = H̃ᵀH̃ that keeps it positive definite: 1e-13 of its largest entry, which is the last,
/// that of the ones.
pub(super) fn ridge(g: &Mat<f64>) -> f64 {
    let last = g.nrows() - 1;
    1e-13 * g[(last, last)]
}
