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
//! Two implementations of [`HiddenSolver`](conjugate::HiddenSolver) solve with S. For most networks S is formed and
//! factored. Its order is h·n1, so for wide networks conjugate gradients, which never form S, are cheaper. The choice
//! depends on the number of multiplications, which follows from sizes alone, so that it is the same on every machine
//! and for a resumed training.
//!
//! Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.

mod cholesky;
mod conjugate;
mod equations;
mod products;
mod schur;

pub(super) use equations::{FactoredEquations, NormalEquations};
pub(super) use schur::{Decay, OutputTraces, PerClass, Traces, class_sizes, class_squares};

use conjugate::{ConjugateGradient, HiddenSolver};
use schur::SchurComplement;

use crate::{
    network::Shape,
    training::{
        activations::KeptActivations,
        examples::{BLOCK, InputPairs},
        parallel::{LARGE, Work},
    },
};

/// Speed of the large products of the factored solver relative to the small ones of conjugate gradients.
const SPEED: f64 = 2.0;

/// Returns `true` if factoring is cheaper than conjugate gradients.
pub(super) fn factoring_is_cheaper(shape: Shape, samples: usize) -> bool {
    let factored = SchurComplement::cost(shape, samples);
    let iterated = ConjugateGradient::cost(shape, samples);
    factored.total() <= SPEED * iterated.total()
}

/// Cost of a solver for one network and number of samples.
#[derive(Clone, Copy, Debug)]
pub(in crate::training) struct Cost {
    pub(super) shape: Shape,
    pub(super) samples: usize,
    /// Multiplications per sample to gather BᵀB.
    pub(super) gram_per_sample: f64,
    /// Multiplications to solve once.
    pub(super) solving: f64,
    /// Entries of the solver's matrices.
    pub(super) entries: usize,
    /// Rows and columns of the entries of BᵀB that are gathered.
    pub(super) gram: (usize, usize),
    /// Entries per sample of the buffer for pairs of inputs.
    pub(super) pairs: usize,
}

/// Number of columns filled at a time, so that they stay in the cache.
pub(super) const CHUNK: usize = 512;

impl Cost {
    /// Multiplications per sample to gather all products.
    fn gathering_per_sample(&self) -> f64 {
        let (n1, h) = (self.shape.inputs as f64 + 1.0, self.shape.hidden as f64);
        self.gram_per_sample + n1 * h * (h + 1.0)
    }

    /// Multiplications to gather and to solve once.
    pub(super) fn total(&self) -> f64 {
        self.samples as f64 * self.gathering_per_sample() + self.solving
    }

    /// Number of parts of the samples in which the products are gathered.
    pub(super) fn gathering_parts(&self, blocks: usize) -> usize {
        let work = Work {
            blocks,
            multiplications: BLOCK * self.gathering_per_sample() as usize,
            bytes: self.part_bytes(),
        };
        work.parts(LARGE)
    }

    /// Approximate memory in bytes of the equations, without the samples.
    pub(super) fn bytes(&self) -> usize {
        let matrices = self.entries.saturating_mul(size_of::<f64>());
        let kept = KeptActivations::bytes(self.shape, self.samples)
            + match self.pairs {
                0 => 0,
                _ => InputPairs::kept_bytes(self.shape.inputs, self.samples),
            };
        matrices.saturating_add(self.part_bytes()).saturating_add(kept)
    }

    /// Approximate memory in bytes of the products for each part of the samples.
    fn part_bytes(&self) -> usize {
        let (h, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let (rows, columns) = self.gram;
        let buffers = BLOCK * (CHUNK.min(h * h) + 3 * h + n1 + self.pairs);
        size_of::<f64>() * (rows * columns + self.shape.hidden_weights() * (h + 1) + buffers)
    }
}

#[cfg(test)]
pub(super) mod dense;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typical_networks_are_factored_and_wide_ones_iterated() {
        let is_factored = |inputs, hidden, outputs, samples| {
            let shape = Shape {
                inputs,
                hidden,
                outputs,
            };
            factoring_is_cheaper(shape, samples)
        };
        for samples in [100, 1000, 100_000] {
            assert!(is_factored(30, 12, 20, samples), "{samples} samples");
        }
        assert!(!is_factored(96, 64, 64, 2000));
        assert!(!is_factored(1536, 512, 1024, 10_000));
    }
}
