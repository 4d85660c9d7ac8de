//! The cost of solving the equations, from sizes alone, so that the choice of the solver is the same on every machine and
//! after every pause.

use super::{conjugate::ConjugateGradient, hidden_solver::HiddenSolver, products::Products, schur::SchurComplement};
use crate::{
    network::Shape,
    training::{
        examples::BLOCK,
        parallel::{LARGE, Work},
    },
};

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

/// Speed of the large products of the factored solver relative to the small ones of conjugate gradients.
const SPEED: f64 = 2.0;

impl Cost {
    /// Multiplications per sample to gather all products.
    fn gathering_per_sample(&self) -> f64 {
        let (n1, h) = (self.shape.inputs as f64 + 1.0, self.shape.hidden as f64);
        self.gram_per_sample + n1 * h * (h + 1.0)
    }

    /// Multiplications to gather and to solve once.
    fn total(&self) -> f64 {
        self.samples as f64 * self.gathering_per_sample() + self.solving
    }

    /// Number of parts of the samples that the products are gathered in.
    pub(super) fn gathering_parts(&self, blocks: usize) -> usize {
        let work = Work {
            blocks,
            multiplications: BLOCK * self.gathering_per_sample() as usize,
            bytes: Products::bytes(self),
        };
        work.parts(LARGE)
    }

    /// About how many bytes the equations take, beside the samples.
    pub(super) fn bytes(&self) -> usize {
        let matrices = self.entries.saturating_mul(size_of::<f64>());
        matrices.saturating_add(Products::bytes(self))
    }
}

/// Tells whether factoring is cheaper than conjugate gradients.
pub(super) fn factoring_is_cheaper(shape: Shape, samples: usize) -> bool {
    let factored = SchurComplement::cost(shape, samples);
    let iterated = ConjugateGradient::cost(shape, samples);
    factored.total() <= SPEED * iterated.total()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_networks_are_factored_and_wide_ones_iterated() {
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
