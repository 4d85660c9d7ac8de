//! The cost of solving the equations, from sizes alone, so that the choice of the solver is the same on every machine and
//! after every pause.

use crate::{
    network::Shape,
    training::{
        activations::KeptActivations,
        examples::BLOCK,
        input_pairs::InputPairs,
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

/// Number of columns that are filled at a time, so that they stay in the cache.
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

    /// Number of parts of the samples that the products are gathered in.
    pub(super) fn gathering_parts(&self, blocks: usize) -> usize {
        let work = Work {
            blocks,
            multiplications: BLOCK * self.gathering_per_sample() as usize,
            bytes: self.part_bytes(),
        };
        work.parts(LARGE)
    }

    /// About how many bytes the equations take, next to the samples.
    pub(super) fn bytes(&self) -> usize {
        let matrices = self.entries.saturating_mul(size_of::<f64>());
        let kept = KeptActivations::bytes(self.shape, self.samples)
            + match self.pairs {
                0 => 0,
                _ => InputPairs::kept_bytes(self.shape.inputs, self.samples),
            };
        matrices.saturating_add(self.part_bytes()).saturating_add(kept)
    }

    /// About how many bytes the products take for each part of the samples.
    fn part_bytes(&self) -> usize {
        let (h, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let (rows, columns) = self.gram;
        let buffers = BLOCK * (CHUNK.min(h * h) + 3 * h + n1 + self.pairs);
        size_of::<f64>() * (rows * columns + self.shape.hidden_weights() * (h + 1) + buffers)
    }
}
