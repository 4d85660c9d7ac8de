//! Interface of solvers for the hidden layer's equations, and the solver by preconditioned conjugate gradients.

use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    linalg::matmul::{
        matmul,
        triangular::{self, BlockStructure},
    },
};

use super::{
    Cost,
    cholesky::{Cholesky, Elimination, output_weights, substitute},
    equations::Sums,
    schur::PerClass,
};
use crate::{
    network::{Mlp, Shape},
    training::{
        Examples,
        activations::{BlockNow, KeptActivations, add_scaled, multiply_by_tanh_slopes, multiply_into, scale},
        examples::{BLOCK, PairsBuffer, column, column_mut},
        parallel::{LARGE, Work, for_each_part},
    },
};

/// Assumed number of iterations per step: 30 to 70 were observed in training, more at its end.
const ITERATIONS: f64 = 100.0;
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
pub(in crate::training) struct ConjugateGradient {
    shape: Shape,
    /// V̄V̄ᵀ.
    mixing: Mat<f64>,
    /// Cholesky factors of the diagonal blocks of S: n1 × h·n1.
    blocks: Mat<f64>,
    /// F, with the entries of each node contiguous: n1 × h·(h+1).
    f: Mat<f64>,
    cholesky: Cholesky,
    max_iterations: usize,
    /// Buffers for each part of the samples; the first receives the sum.
    parts: Vec<PartBuffers>,
    /// FᵀP, and FᵀP V̄V̄ᵀ: (h+1) × h.
    eliminated: [Mat<f64>; 2],
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
}

/// Buffers for one part of the samples.
struct PartBuffers {
    /// n1 × h.
    sum: Mat<f64>,
    /// D ∘ AP, and (D ∘ AP) V̄V̄ᵀ: block × h.
    hidden: [Mat<f64>; 2],
}

impl HiddenSolver for ConjugateGradient {
    fn new(shape: Shape, examples: &Examples) -> Self {
        let (h, n1, order) = (shape.hidden, shape.inputs + 1, shape.hidden_weights());
        let part = |_| PartBuffers {
            sum: Mat::zeros(n1, h),
            hidden: [const { BLOCK }; 2].map(|block| Mat::zeros(block, h)),
        };
        let parts = parts(shape, examples.blocks().len());
        Self {
            shape,
            mixing: Mat::zeros(h, h),
            blocks: Mat::zeros(n1, order),
            f: Mat::zeros(n1, h * (h + 1)),
            cholesky: Cholesky::new(n1),
            max_iterations: MAX_ITERATIONS,
            parts: (0..parts).map(part).collect(),
            eliminated: [h + 1; 2].map(|h1| Mat::zeros(h1, h)),
            residual: vec![0.0; order],
            preconditioned: vec![0.0; order],
            direction: vec![0.0; order],
        }
    }

    /// Gathering BᵀB takes n1²/2 · h multiplications per sample; solving, with order = h·n1, S samples and k
    /// iterations, k (S (2 n1 h + h²) + order (2 (h+1) + n1)).
    fn cost(shape: Shape, samples: usize) -> Cost {
        let (n1, h) = (shape.inputs + 1, shape.hidden);
        let order = shape.hidden_weights();
        let [n1_, h_, order_] = [n1, h, order].map(|size| size as f64);
        let iteration = samples as f64 * iteration_per_sample(shape) as f64 + order_ * (2.0 * (h_ + 1.0) + n1_);
        Cost {
            shape,
            samples,
            gram_per_sample: n1_ * n1_ * h_ / 2.0,
            solving: ITERATIONS * iteration,
            entries: order.saturating_mul(2 * (h + 1) + n1),
            gram: (n1, order),
            pairs: 0,
        }
    }

    fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Adds AᵀDᵢ²A to the blocks.
    fn add_gram(
        &self,
        gram: &mut Mat<f64>,
        now: &BlockNow<'_>,
        slopes: MatRef<'_, f64>,
        columns: MatMut<'_, f64>,
        _: &mut PairsBuffer,
    ) {
        let inputs = now.block.inputs.as_ref();
        let n1 = inputs.ncols();
        let mut weighted = columns.subcols_mut(0, n1);
        for i in 0..slopes.ncols() {
            for a in 0..n1 {
                multiply_into(column_mut(weighted.as_mut(), a), column(slopes, i), column(inputs, a));
            }
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            let sum = gram.as_mut().subcols_mut(i * n1, n1);
            let (left, right) = (weighted.as_ref().transpose(), weighted.as_ref());
            triangular::matmul(sum, lower, Accum::Add, left, full, right, full, 1.0, Par::Seq);
        }
    }

    fn solve(&mut self, system: System<'_>, kept: &mut KeptActivations, right: &mut [f64]) -> Option<()> {
        let v = output_weights(system.mlp);
        matmul(self.mixing.as_mut(), Accum::Replace, v, v.transpose(), 1.0, Par::Seq);
        // A rejected candidate may have been evaluated since.
        kept.evaluate(system.mlp, system.examples);
        self.factor_blocks(system)?;
        let solution = right;
        self.residual.copy_from_slice(solution);
        solution.fill(0.0);
        let mut length = self.precondition();
        self.direction.copy_from_slice(&self.preconditioned);
        let goal = TOLERANCE * TOLERANCE * length;
        for _ in 0..self.max_iterations {
            if length <= goal {
                return Some(());
            }
            self.apply(system, kept);
            let product = self.parts[0].sum.as_ref();
            let product = || product.col_iter().flat_map(|column| column.iter());
            let curvature: f64 = product().zip(&self.direction).map(|(a, b)| a * b).sum();
            // Otherwise rounding errors dominate. False for NaN.
            let is_convex = curvature > 0.0;
            if !is_convex {
                return None;
            }
            let distance = length / curvature;
            for (value, direction) in solution.iter_mut().zip(&self.direction) {
                *value += distance * direction;
            }
            for (residual, product) in self.residual.iter_mut().zip(product()) {
                *residual -= distance * product;
            }
            let before = length;
            length = self.precondition();
            for (direction, value) in self.direction.iter_mut().zip(&self.preconditioned) {
                *direction = value + length / before * *direction;
            }
        }
        let worst = MAX_RESIDUAL / TOLERANCE;
        (length <= worst * worst * goal).then_some(())
    }
}

/// Number of parts into which the samples are divided for each iteration. Iterations follow each other so quickly that
/// threads stay awake, so it is worth dividing less work than elsewhere.
fn parts(shape: Shape, blocks: usize) -> usize {
    let work = Work {
        blocks,
        multiplications: BLOCK * iteration_per_sample(shape),
        bytes: size_of::<f64>() * (shape.hidden_weights() + 2 * BLOCK * shape.hidden),
    };
    work.parts(LARGE / 8)
}

/// Number of multiplications of one iteration per sample.
fn iteration_per_sample(shape: Shape) -> usize {
    2 * shape.hidden_weights() + shape.hidden * shape.hidden
}

impl ConjugateGradient {
    /// Writes S·direction to the first part's sum.
    fn apply(&mut self, system: System<'_>, kept: &mut KeptActivations) {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let direction = MatRef::from_column_major_slice(&self.direction, n1, h);
        let mixing = self.mixing.as_ref();
        for_each_part(&mut self.parts, |part| part.sum.fill(0.0));
        kept.for_each_block(system.mlp, system.examples, &mut self.parts, |part, now| {
            part.add(now, direction, mixing);
        });
        let (first, others) = self.parts.split_at_mut(1);
        let sum = &mut first[0].sum;
        others.iter().for_each(|other| *sum += &other.sum);
        let f = |node: usize| self.f.as_ref().subcols(node * h1, h1);
        let [reduced, mixed] = &mut self.eliminated;
        for node in 0..h {
            let (f, p) = (f(node), direction.subcols(node, 1));
            let reduced = reduced.as_mut().subcols_mut(node, 1);
            matmul(reduced, Accum::Replace, f.transpose(), p, 1.0, Par::Seq);
        }
        matmul(mixed.as_mut(), Accum::Replace, reduced.as_ref(), mixing, 1.0, Par::Seq);
        for node in 0..h {
            let mut sum = sum.as_mut().subcols_mut(node, 1);
            let (f, mixed) = (f(node), mixed.as_ref().subcols(node, 1));
            matmul(sum.as_mut(), Accum::Add, f, mixed, -1.0, Par::Seq);
            let (sum, direction) = (column_mut(sum, 0), column(direction, node));
            let PerClass {
                hidden_weights,
                hidden_biases,
                ..
            } = system.damping;
            let bias = direction.len() - 1;
            add_scaled(&mut sum[..bias], hidden_weights, &direction[..bias]);
            add_scaled(&mut sum[bias..], hidden_biases, &direction[bias..]);
        }
    }

    /// Gathers F by nodes, and factors the diagonal blocks of S; `None` if one of them is not numerically positive
    /// definite.
    fn factor_blocks(&mut self, system: System<'_>) -> Option<()> {
        let (h1, n1) = (self.shape.hidden + 1, self.shape.inputs + 1);
        self.blocks.copy_from(&system.sums.gram);
        for node in 0..self.shape.hidden {
            let mut block = self.blocks.as_mut().subcols_mut(node * n1, n1);
            let weight = self.mixing[(node, node)];
            let largest = (0..n1).fold(0.0, |largest: f64, index| largest.max(block[(index, index)]));
            let mut f = self.f.as_mut().subcols_mut(node * h1, h1);
            f.copy_from(system.elimination.f.as_ref().subrows(node * n1, n1));
            let f = f.as_ref();
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            triangular::matmul(
                block.as_mut(),
                lower,
                Accum::Add,
                f,
                full,
                f.transpose(),
                full,
                -1.0,
                Par::Seq,
            );
            for index in 0..n1 {
                scale(&mut column_mut(block.as_mut(), index)[index..], weight);
                block[(index, index)] += system.damping.of_input(index, n1 - 1) + RIDGE * weight * largest;
            }
            self.cholesky.factor(block)?;
        }
        Some(())
    }

    /// Applies the inverse of the preconditioner to the residual; returns the product of the residual with the result.
    fn precondition(&mut self) -> f64 {
        let n1 = self.shape.inputs + 1;
        self.preconditioned.copy_from_slice(&self.residual);
        for (node, part) in self.preconditioned.chunks_exact_mut(n1).enumerate() {
            let factor = self.blocks.as_ref().subcols(node * n1, n1);
            substitute(factor, MatMut::from_column_major_slice_mut(part, n1, 1));
        }
        let pairs = self.residual.iter().zip(&self.preconditioned);
        pairs.map(|(a, b)| a * b).sum()
    }
}

impl PartBuffers {
    /// Adds Aᵀ(D ∘ ((D ∘ AP) V̄V̄ᵀ)) of one block.
    fn add(&mut self, now: &BlockNow<'_>, p: MatRef<'_, f64>, mixing: MatRef<'_, f64>) {
        let (inputs, samples) = (now.block.inputs.as_ref(), now.block.samples());
        let [pushed, mixed] = &mut self.hidden;
        let mut pushed = pushed.as_mut().subrows_mut(0, samples);
        let mut mixed = mixed.as_mut().subrows_mut(0, samples);
        let slope = |mut values: MatMut<'_, f64>| {
            for node in 0..mixing.ncols() {
                multiply_by_tanh_slopes(column_mut(values.as_mut(), node), column(now.hidden(), node));
            }
        };
        matmul(pushed.as_mut(), Accum::Replace, inputs, p, 1.0, Par::Seq);
        slope(pushed.as_mut());
        matmul(mixed.as_mut(), Accum::Replace, pushed.as_ref(), mixing, 1.0, Par::Seq);
        slope(mixed.as_mut());
        matmul(
            self.sum.as_mut(),
            Accum::Add,
            inputs.transpose(),
            mixed.as_ref(),
            1.0,
            Par::Seq,
        );
    }
}

/// Solver of S δ = r, which also gathers the entries of BᵀB that it needs.
pub(in crate::training) trait HiddenSolver: Send + Sync {
    /// Allocates for a network of this shape and these examples.
    fn new(shape: Shape, examples: &Examples) -> Self
    where
        Self: Sized;

    /// Cost for a network of this shape and this many samples.
    fn cost(shape: Shape, samples: usize) -> Cost
    where
        Self: Sized;

    /// Number of parts of the samples that are processed in parallel while solving.
    fn parts(&self) -> usize {
        1
    }

    /// Allocates the buffer for [`Self::add_gram`].
    fn pairs_buffer(&self) -> PairsBuffer {
        PairsBuffer::default()
    }

    /// Adds one block of samples to the entries of BᵀB that the solver needs; `gram` has the size [`Cost::gram`].
    /// `slopes` is D of the block, samples × h; `columns` and `pairs` are buffers with the same number of rows, whose
    /// contents are unspecified.
    fn add_gram(
        &self,
        gram: &mut Mat<f64>,
        now: &BlockNow<'_>,
        slopes: MatRef<'_, f64>,
        columns: MatMut<'_, f64>,
        pairs: &mut PairsBuffer,
    );

    /// Replaces the right-hand side r by the solution δ. Returns `None`, with `right` unspecified, if S is not
    /// numerically positive definite or the solution is not accurate enough: a larger damping is needed.
    fn solve(&mut self, system: System<'_>, kept: &mut KeptActivations, right: &mut [f64]) -> Option<()>;
}

/// Terms of the matrix S = damping on the diagonal + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ).
#[derive(Clone, Copy)]
pub(in crate::training) struct System<'a> {
    pub(super) mlp: &'a Mlp,
    pub(super) examples: &'a Examples,
    pub(super) sums: &'a Sums,
    pub(super) elimination: &'a Elimination,
    pub(super) damping: PerClass,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::{
        examples::tests::{random_examples, random_mlp},
        normal_equations::{Decay, cholesky::Elimination, products::Products},
    };

    /// Solves at damping 1e-3 within this many iterations.
    fn solve(max_iterations: usize) -> Option<()> {
        let (mlp, examples) = (random_mlp(8, 12, 2, 1), random_examples(40, 8, 2, 2));
        let shape = mlp.shape();
        let mut solver = ConjugateGradient::new(shape, &examples);
        solver.max_iterations = max_iterations;
        let mut products = Products::new(&solver, &ConjugateGradient::cost(shape, 40), 1);
        let mut kept = KeptActivations::new(shape, &examples, 1);
        products.gather(&solver, &mlp, &[], &examples, &mut kept);
        let (mut elimination, mut right) = (Elimination::new(shape), vec![0.0; shape.hidden_weights()]);
        elimination.factor(products.sums(), PerClass::all(1e-3))?;
        elimination.reduce(products.sums(), &mlp, Decay::NONE, &mut right);
        let system = System {
            mlp: &mlp,
            examples: &examples,
            sums: products.sums(),
            elimination: &elimination,
            damping: PerClass::all(1e-3),
        };
        solver.solve(system, &mut kept, &mut right)
    }

    #[test]
    fn a_step_that_is_far_from_converged_is_rejected() {
        assert_eq!(solve(MAX_ITERATIONS), Some(()));
        assert_eq!(solve(3), None);
    }
}
