//! The normal equations `(JᵀJ + μI) δ = −Jᵀe` of the network's squared errors, without ever forming J.
//!
//! With A = [inputs, 1], H̃ = [H, 1], D = 1 − H∘H, V̄ = V without its biases, and B the row-wise Kronecker product of D
//! and A (samples × h·n1), the Jacobian of output t is `[B diag(V̄ₜ ⊗ 1), H̃]`, hence
//!
//! ```text
//! JwᵀJw = (V̄V̄ᵀ ⊗ 1) ∘ BᵀB       block t of JwᵀJv = diag(V̄ₜ ⊗ 1) C,  C = BᵀH̃       JvᵀJv = I ⊗ H̃ᵀH̃
//! S = μI + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − C G⁻¹ Cᵀ),   G = H̃ᵀH̃ + μI       (Schur complement on W)
//! ```
//!
//! `products` sums BᵀB, C, H̃ᵀH̃ and Jᵀe over blocks of samples, `elimination` eliminates V, and forms and factors S to find
//! the step of W. The order of S is h·n1, so for wide networks `conjugate`, which never forms S, is cheaper. The choice depends on the number of multiplications, which follows from sizes alone, so that it
//! is the same on every machine and for a resumed training.
//!
//! Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.

mod conjugate;
mod elimination;
mod plan;
mod products;
#[cfg(test)]
pub(super) mod tests;

use faer::{Mat, MatMut};

use conjugate::ConjugateGradient;
use elimination::{Elimination, Traces};
pub(super) use plan::Plan;
use plan::Solution;
use products::Sums;

use super::{
    Evaluation, Examples,
    activations::KeptActivations,
    parallel::{for_each_part, substitute},
};
use crate::network::{Mlp, Shape};

/// Normal equations of a network and its examples: evaluated, gathered, and solved for any damping.
pub(super) struct NormalEquations {
    pub(super) activations: KeptActivations,
    /// Sums for each part of the samples; once gathered, the first contains the total.
    parts: Vec<Sums>,
    elimination: Elimination,
    solver: Solver,
}

/// Solver of S δ = r on W.
enum Solver {
    /// S, then its Cholesky factor: the lower triangle.
    Factored(Mat<f64>),
    Iterated(Box<ConjugateGradient>),
}

impl NormalEquations {
    /// Allocates for these examples.
    pub(super) fn new(plan: &Plan, examples: &Examples) -> Self {
        let (shape, blocks) = (plan.shape, examples.blocks().len());
        let (gathering, order) = (plan.gathering_parts(blocks), shape.hidden_weights());
        let (solver, solving) = match plan.solution {
            Solution::Factored => (Solver::Factored(Mat::zeros(order, order)), 1),
            Solution::Iterated => {
                let solver = ConjugateGradient::new(shape, blocks);
                let parts = solver.parts.len();
                (Solver::Iterated(Box::new(solver)), parts)
            }
        };
        Self {
            activations: KeptActivations::new(shape, examples, gathering.max(solving)),
            parts: (0..gathering).map(|_| Sums::new(plan)).collect(),
            elimination: Elimination::new(shape),
            solver,
        }
    }

    /// Returns the mean squared error at the weights of `mlp`. Gathering at the same weights next does not run the
    /// network a second time.
    pub(super) fn mse(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        self.activations.evaluate(mlp, examples) / examples.errors()
    }

    /// Gathers all products at the weights of `mlp`. If `precisions` ρ of the targets are given, they are the products
    /// of the equations in which errors and output weights of target t are multiplied by √ρₜ: to solve them, pass a
    /// network whose output weights are multiplied, too.
    pub(super) fn gather(&mut self, mlp: &Mlp, precisions: &[f64], examples: &Examples) -> Evaluation {
        let squares = self.activations.evaluate(mlp, examples);
        // Of all products, only Jᵀe depends on the precisions.
        let mut v = mlp.layers().1.to_vec();
        for (weight, precision) in v.iter_mut().zip(precisions.iter().cycle()) {
            *weight *= precision;
        }
        for_each_part(&mut self.parts, Sums::clear);
        self.activations
            .for_each_block(mlp, examples, &mut self.parts, |sums, block, now| {
                sums.add_block(&v, block, now);
            });
        let (sums, others) = self.parts.split_first_mut().expect("there is at least one part");
        others.iter().for_each(|other| sums.add(other));
        let of_outputs = sums.gradient[mlp.shape().hidden_weights()..].iter_mut();
        for (slope, precision) in of_outputs.zip(precisions.iter().cycle()) {
            *slope *= precision.sqrt();
        }
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: 2.0 * length(&sums.gradient) / examples.errors(),
        }
    }

    /// Returns Jᵀe in the order of [`Mlp::weights`] from the products last gathered.
    pub(super) fn gradient(&self) -> &[f64] {
        &self.parts[0].gradient
    }

    /// Solves `(JᵀJ + damping·I) δ = −right` from the products last gathered, at the same `mlp`, and writes the step δ.
    /// `right` and `step` are in the order of [`Mlp::weights`]. Returns `None`, with `step` unspecified, if the damped
    /// equations are numerically singular: a larger damping is needed.
    pub(super) fn solve(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        damping: Classes,
        right: &[f64],
        step: &mut [f64],
    ) -> Option<()> {
        let (sums, elimination) = (&self.parts[0], &mut self.elimination);
        elimination.factor(sums, damping)?;
        let mut reduced = elimination.reduce(sums, mlp, right);
        match &mut self.solver {
            Solver::Factored(s) => {
                elimination.factor_schur(s, sums, mlp, damping)?;
                let column = MatMut::from_column_major_slice_mut(&mut reduced, s.nrows(), 1);
                substitute(s.as_ref(), column);
            }
            Solver::Iterated(conjugate) => {
                conjugate.factor(elimination, sums, mlp, damping)?;
                conjugate.solve(mlp, examples, &mut self.activations, &mut reduced)?;
            }
        }
        elimination.complete(sums, mlp, right, &reduced, step);
        step.iter().all(|value| value.is_finite()).then_some(())
    }

    /// Returns the contributions of weights to tr (JᵀJ + damping·I)⁻¹ from the products last gathered. Returns `None` if
    /// the matrix is not numerically positive definite, or if it is not factored.
    pub(super) fn traces_of_inverse(&mut self, mlp: &Mlp, damping: Classes) -> Option<Traces> {
        let (sums, elimination) = (&self.parts[0], &mut self.elimination);
        let Solver::Factored(s) = &mut self.solver else {
            return None;
        };
        elimination.factor(sums, damping)?;
        elimination.factor_schur(s, sums, mlp, damping)?;
        let traces = elimination.traces_of_inverse(s.as_ref(), mlp);
        let is_finite = traces.classes().iter().all(|trace| trace.is_finite());
        is_finite.then_some(traces)
    }
}

/// Returns the Euclidean norm; the squares of its values may overflow.
pub(super) fn length(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::hypot)
}

/// One value for each class of weights, in the order of [`Mlp::weights`]: weights and biases of the hidden layer, weights
/// and biases of the output layer.
pub(super) type Classes<T = f64> = [T; 4];

/// Weights from inputs to hidden nodes.
pub(super) const HIDDEN_WEIGHTS: usize = 0;
/// Biases of hidden nodes.
pub(super) const HIDDEN_BIASES: usize = 1;
/// Weights from hidden nodes to outputs.
pub(super) const OUTPUT_WEIGHTS: usize = 2;
/// Biases of outputs.
pub(super) const OUTPUT_BIASES: usize = 3;

/// Returns the number of weights in each class.
pub(super) fn class_sizes(shape: Shape) -> Classes<usize> {
    let weights = shape.hidden * shape.inputs;
    [weights, shape.hidden, shape.hidden * shape.outputs, shape.outputs]
}

/// Returns the weights of each class, less the values towards which they decay: zero, or `biases` for those of the
/// outputs if they are given.
fn by_class<'a>(mlp: &'a Mlp, biases: &'a [f64]) -> Classes<impl Iterator<Item = f64> + 'a> {
    let mut first = 0;
    class_sizes(mlp.shape()).map(|size| {
        let class = first..first + size;
        first = class.end;
        let is_last = first == mlp.weights().len();
        let towards = if is_last { biases } else { &[] };
        let weights = mlp.weights()[class].iter().enumerate();
        weights.map(|(index, weight)| towards.get(index).map_or(*weight, |towards| weight - towards))
    })
}

/// Returns Σw² of each class; for output biases, the squared distances from `biases`, or from zero if that is empty.
pub(super) fn class_squares(mlp: &Mlp, biases: &[f64]) -> Classes {
    by_class(mlp, biases).map(|weights| weights.map(|weight| weight * weight).sum())
}

/// Returns half the derivatives of the penalty `rate`·Σw² of each class, in the order of [`Mlp::weights`]; for output
/// biases, w is the distance from `biases`, or from zero if that is empty.
pub(super) fn decay_slopes(mlp: &Mlp, rates: Classes, biases: &[f64]) -> Vec<f64> {
    let classes = rates.into_iter().zip(by_class(mlp, biases));
    classes
        .flat_map(|(rate, weights)| weights.map(move |weight| rate * weight))
        .collect()
}
