//! Solver by preconditioned conjugate gradients.

use faer::{Mat, MatMut, MatRef};

use super::{
    Classes, HIDDEN_BIASES, HIDDEN_WEIGHTS,
    elimination::{Elimination, output_weights},
    products::Sums,
};
use crate::{
    network::{Mlp, Shape},
    training::{
        Examples,
        activations::{KeptActivations, change_each, multiply_by_tanh_slopes},
        examples::{BLOCK, Block, column, column_mut},
        parallel::{
            LARGE, accumulate, accumulate_lower, cholesky, for_each_part, number_of_parts, product, substitute,
        },
    },
};

/// Relative residual at convergence, in the norm of the preconditioner's inverse. The relative error of the step, in
/// the norm of S, is at most this times the square root of the condition number of the preconditioned matrix; this does
/// not bound the error of single weights when the damping is small.
const TOLERANCE: f64 = 1e-8;
/// Ridge on the diagonals of the preconditioner, relative to their largest entry, against rounding.
const RIDGE: f64 = 1e-13;
/// Maximum number of iterations; the step is then accepted if its residual is below [`MAX_RESIDUAL`].
const MAX_ITERATIONS: usize = 500;
/// Maximum relative residual of an inexact Gauss-Newton step (Dembo, Eisenstat and Steihaug 1982). Above it the
/// solution is rejected and the damping has to grow.
const MAX_RESIDUAL: f64 = 1e-3;

/// Solves S δ = r on W by preconditioned conjugate gradients (Hestenes and Stiefel 1952), never forming S. With P the
/// vector as n1 × h,
///
/// ```text
/// S P = μP + Aᵀ(D ∘ ((D ∘ AP) V̄V̄ᵀ)) − F (FᵀP V̄V̄ᵀ)        F node by node
/// ```
///
/// so a product costs two products with the samples and needs memory only for vectors. The preconditioner consists of
/// the factored diagonal blocks of S, one for each hidden node: the coupling between nodes has low rank, so a few tens
/// of iterations are enough.
pub(super) struct ConjugateGradient {
    shape: Shape,
    damping: Classes,
    /// V̄V̄ᵀ.
    mixing: Mat<f64>,
    /// Cholesky factors of the diagonal blocks of S: n1 × h·n1.
    blocks: Mat<f64>,
    /// F, with the entries of each node contiguous: n1 × h·(h+1).
    f: Mat<f64>,
    max_iterations: usize,
    /// Buffers for each part of the samples that is processed in parallel; the first receives the sum.
    pub(super) parts: Vec<PartBuffers>,
}

/// Buffers for one part of the samples.
pub(super) struct PartBuffers {
    /// n1 × h.
    sum: Mat<f64>,
    /// D ∘ AP, and (D ∘ AP) V̄V̄ᵀ: block × h.
    hidden: [Mat<f64>; 2],
}

/// Number of multiplications of one iteration per sample.
pub(super) fn multiplications_per_sample(shape: Shape) -> usize {
    2 * shape.hidden_weights() + shape.hidden * shape.hidden
}

impl ConjugateGradient {
    /// Allocates for a network of this shape and this many blocks of samples.
    pub(super) fn new(shape: Shape, blocks: usize) -> Self {
        let (h, n1, order) = (shape.hidden, shape.inputs + 1, shape.hidden_weights());
        // Iterations follow each other so quickly that threads stay awake, so that it is worth dividing less work than
        // elsewhere.
        let bytes = size_of::<f64>() * (order + 2 * BLOCK * h);
        let parts = number_of_parts(blocks, BLOCK * multiplications_per_sample(shape), LARGE / 8, bytes);
        let part = |_| PartBuffers {
            sum: Mat::zeros(n1, h),
            hidden: [BLOCK; 2].map(|block| Mat::zeros(block, h)),
        };
        Self {
            shape,
            damping: [0.0; 4],
            mixing: Mat::zeros(h, h),
            blocks: Mat::zeros(n1, order),
            f: Mat::zeros(n1, h * (h + 1)),
            max_iterations: MAX_ITERATIONS,
            parts: (0..parts).map(part).collect(),
        }
    }

    /// Gathers F by nodes, and factors the diagonal blocks of S; `None` if one of them is not numerically positive
    /// definite.
    pub(super) fn factor(&mut self, elimination: &Elimination, sums: &Sums, mlp: &Mlp, damping: Classes) -> Option<()> {
        let (h1, n1) = (self.shape.hidden + 1, self.shape.inputs + 1);
        let v = output_weights(mlp);
        product(self.mixing.as_mut(), v, v.transpose());
        self.damping = damping;
        self.blocks.copy_from(&sums.gram);
        for node in 0..self.shape.hidden {
            let mut block = self.blocks.as_mut().subcols_mut(node * n1, n1);
            let weight = self.mixing[(node, node)];
            let largest = (0..n1).fold(0.0, |largest: f64, index| largest.max(block[(index, index)]));
            let mut f = self.f.as_mut().subcols_mut(node * h1, h1);
            f.copy_from(elimination.f.as_ref().subrows(node * n1, n1));
            accumulate_lower(block.as_mut(), f.as_ref(), f.as_ref().transpose(), -1.0);
            for index in 0..n1 {
                let lower = &mut column_mut(block.as_mut(), index)[index..];
                lower.iter_mut().for_each(|value| *value *= weight);
                let class = if index + 1 == n1 { HIDDEN_BIASES } else { HIDDEN_WEIGHTS };
                block[(index, index)] += damping[class] + RIDGE * weight * largest;
            }
            cholesky(block)?;
        }
        Some(())
    }

    /// Replaces the right-hand side of the hidden layer by its solution. Returns `None`, with `solution` unspecified, if
    /// it is not accurate enough: a larger damping is needed.
    pub(super) fn solve(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        kept: &mut KeptActivations,
        solution: &mut [f64],
    ) -> Option<()> {
        // A rejected candidate may have been evaluated since.
        kept.evaluate(mlp, examples);
        let mut residual = solution.to_vec();
        solution.fill(0.0);
        let mut preconditioned = residual.clone();
        let mut length = self.precondition(&residual, &mut preconditioned);
        let mut direction = preconditioned.clone();
        let goal = TOLERANCE * TOLERANCE * length;
        for _ in 0..self.max_iterations {
            if length <= goal {
                return Some(());
            }
            self.apply(&direction, mlp, examples, kept);
            let product = self.parts[0].sum.as_ref();
            let product = || product.col_iter().flat_map(|column| column.iter());
            let curvature: f64 = product().zip(&direction).map(|(a, b)| a * b).sum();
            // Otherwise rounding errors dominate. False for NaN.
            let is_convex = curvature > 0.0;
            if !is_convex {
                return None;
            }
            let distance = length / curvature;
            change_each(solution, &direction, |value, direction| *value += distance * direction);
            for (residual, product) in residual.iter_mut().zip(product()) {
                *residual -= distance * product;
            }
            let before = length;
            length = self.precondition(&residual, &mut preconditioned);
            change_each(&mut direction, &preconditioned, |direction, value| {
                *direction = value + length / before * *direction;
            });
        }
        let worst = MAX_RESIDUAL / TOLERANCE;
        (length <= worst * worst * goal).then_some(())
    }

    /// Writes S times `direction` to the first part's sum.
    fn apply(&mut self, direction: &[f64], mlp: &Mlp, examples: &Examples, kept: &mut KeptActivations) {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let direction = MatRef::from_column_major_slice(direction, n1, h);
        let mixing = self.mixing.as_ref();
        for_each_part(&mut self.parts, |part| part.sum.fill(0.0));
        kept.for_each_block(mlp, examples, &mut self.parts, |part, block, now| {
            part.add(block, now.hidden(block), direction, mixing);
        });
        let (first, others) = self.parts.split_at_mut(1);
        let sum = &mut first[0].sum;
        others.iter().for_each(|other| *sum += &other.sum);
        let f = |node: usize| self.f.as_ref().subcols(node * h1, h1);
        // FᵀP, and FᵀP V̄V̄ᵀ.
        let (mut reduced, mut mixed) = (Mat::zeros(h1, h), Mat::zeros(h1, h));
        for node in 0..h {
            let p = direction.subcols(node, 1);
            product(reduced.as_mut().subcols_mut(node, 1), f(node).transpose(), p);
        }
        product(mixed.as_mut(), reduced.as_ref(), mixing);
        for node in 0..h {
            let mut sum = sum.as_mut().subcols_mut(node, 1);
            accumulate(sum.as_mut(), f(node), mixed.as_ref().subcols(node, 1), -1.0);
            let (weights, biases) = column_mut(sum, 0).split_at_mut(n1 - 1);
            let (p, p_biases) = column(direction, node).split_at(n1 - 1);
            for (sum, p, class) in [(weights, p, HIDDEN_WEIGHTS), (biases, p_biases, HIDDEN_BIASES)] {
                change_each(sum, p, |sum, p| *sum += self.damping[class] * p);
            }
        }
    }

    /// Writes the inverse of the preconditioner times the residual; returns the product of the residual with the result.
    fn precondition(&self, residual: &[f64], preconditioned: &mut [f64]) -> f64 {
        let n1 = self.shape.inputs + 1;
        preconditioned.copy_from_slice(residual);
        for (node, part) in preconditioned.chunks_exact_mut(n1).enumerate() {
            let factor = self.blocks.as_ref().subcols(node * n1, n1);
            substitute(factor, MatMut::from_column_major_slice_mut(part, n1, 1));
        }
        residual.iter().zip(&*preconditioned).map(|(a, b)| a * b).sum()
    }
}

impl PartBuffers {
    /// Adds Aᵀ(D ∘ ((D ∘ AP) V̄V̄ᵀ)) of one block.
    fn add(&mut self, block: &Block, h: MatRef<'_, f64>, p: MatRef<'_, f64>, mixing: MatRef<'_, f64>) {
        let (inputs, samples) = (block.inputs.as_ref(), block.samples());
        let [pushed, mixed] = &mut self.hidden;
        let mut pushed = pushed.as_mut().subrows_mut(0, samples);
        let mut mixed = mixed.as_mut().subrows_mut(0, samples);
        product(pushed.as_mut(), inputs, p);
        multiply_by_tanh_slopes(pushed.as_mut(), h);
        product(mixed.as_mut(), pushed.as_ref(), mixing);
        multiply_by_tanh_slopes(mixed.as_mut(), h);
        accumulate(self.sum.as_mut(), inputs.transpose(), mixed.as_ref(), 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{NormalEquations, Plan, Solver},
        *,
    };
    use crate::training::examples::tests::{random_examples, random_mlp};

    /// Solves at damping 1e-3 within this many iterations.
    fn solve(max_iterations: usize) -> Option<()> {
        let (mlp, examples) = (random_mlp(8, 12, 2, 1), random_examples(40, 8, 2, 2));
        let mut equations = NormalEquations::new(&Plan::iterated(mlp.shape(), 40), &examples);
        if let Solver::Iterated(solver) = &mut equations.solver {
            solver.max_iterations = max_iterations;
        }
        equations.gather(&mlp, &[], &examples);
        let mut step = vec![0.0; mlp.weights().len()];
        let right = equations.gradient().to_vec();
        equations.solve(&mlp, &examples, [1e-3; 4], &right, &mut step)
    }

    #[test]
    fn a_step_that_is_far_from_converged_is_rejected() {
        assert_eq!(solve(MAX_ITERATIONS), Some(()));
        assert_eq!(solve(3), None);
    }
}
