//! The interface of a solver for the hidden layer's equations.

use faer::{Mat, MatMut, MatRef};

use super::{cost::Cost, elimination::Elimination, sums::Sums, weight_classes::PerClass};
use crate::{
    network::{Mlp, Shape},
    training::{
        Examples,
        activations::{BlockNow, KeptActivations},
        input_pairs::PairsBuffer,
    },
};

/// Solves S δ = r, and gathers what it needs of BᵀB.
pub(in crate::training) trait HiddenSolver: Send + Sync {
    /// Allocates for a network of this shape and these examples.
    fn new(shape: Shape, examples: &Examples) -> Self
    where
        Self: Sized;

    /// Cost for a network of this shape and this many samples.
    fn cost(shape: Shape, samples: usize) -> Cost
    where
        Self: Sized;

    /// Number of parts of the samples that are worked on at once while solving.
    fn parts(&self) -> usize {
        1
    }

    /// Allocates the buffer for [`Self::add_gram`].
    fn pairs_buffer(&self) -> PairsBuffer {
        PairsBuffer::default()
    }

    /// Adds one block of samples to the entries of BᵀB that the solver needs; `gram` has the size [`Cost::gram`].
    /// `slopes` is D of the block, samples × h; `columns` and `pairs` are buffers with as many rows and no contents.
    fn add_gram(
        &self,
        gram: &mut Mat<f64>,
        now: &BlockNow<'_>,
        slopes: MatRef<'_, f64>,
        columns: MatMut<'_, f64>,
        pairs: &mut PairsBuffer,
    );

    /// Replaces the right-hand side r by the solution δ. `None`, with `right` unspecified, if S is not positive definite
    /// in the arithmetic or the solution is not accurate enough: a larger damping is needed.
    fn solve(&mut self, system: System<'_>, kept: &mut KeptActivations, right: &mut [f64]) -> Option<()>;
}

/// The matrix S = damping on the diagonal + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ), by the parts it is made of.
#[derive(Clone, Copy)]
pub(in crate::training) struct System<'a> {
    pub(super) mlp: &'a Mlp,
    pub(super) examples: &'a Examples,
    pub(super) sums: &'a Sums,
    pub(super) elimination: &'a Elimination,
    pub(super) damping: PerClass,
}
