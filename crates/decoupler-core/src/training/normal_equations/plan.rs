//! Cost of the equations for the sizes of a network and its samples, and the choice of the solver.

use super::conjugate;
use crate::{
    network::Shape,
    training::{
        activations::KeptActivations,
        examples::{BLOCK, pairs},
        parallel::{LARGE, number_of_parts},
    },
};

/// Speed of the large products of the factored solver relative to the small ones of conjugate gradients.
const SPEED: f64 = 2.0;
/// Assumed number of iterations of conjugate gradients per step: 30 to 70 were observed in training, more at its end.
const ITERATIONS: f64 = 100.0;
/// Number of columns filled at a time, so that they stay in the cache.
pub(super) const CHUNK: usize = 512;

/// Solver of the equations of the hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Solution {
    /// The Schur complement is formed and factored.
    Factored,
    /// Conjugate gradients.
    Iterated,
}

/// Sizes of a network and its samples, and the solver of its equations.
#[derive(Clone, Copy, Debug)]
pub(in crate::training) struct Plan {
    pub(super) shape: Shape,
    pub(super) samples: usize,
    pub(super) solution: Solution,
}

impl Plan {
    fn new(shape: Shape, samples: usize, solution: Solution) -> Self {
        Self {
            shape,
            samples,
            solution,
        }
    }

    /// Equations that are always factored.
    pub(in crate::training) fn factored(shape: Shape, samples: usize) -> Self {
        Self::new(shape, samples, Solution::Factored)
    }

    /// Equations that are solved by conjugate gradients.
    pub(super) fn iterated(shape: Shape, samples: usize) -> Self {
        Self::new(shape, samples, Solution::Iterated)
    }

    /// Equations with the cheaper solver.
    pub(in crate::training) fn cheapest(shape: Shape, samples: usize) -> Self {
        let (factored, iterated) = (Self::factored(shape, samples), Self::iterated(shape, samples));
        let is_factored = factored.multiplications() <= SPEED * iterated.multiplications();
        if is_factored { factored } else { iterated }
    }

    /// Approximate number of multiplications to gather and to solve once.
    pub(in crate::training) fn multiplications(&self) -> f64 {
        let (h1, order) = (self.shape.hidden as f64 + 1.0, self.shape.hidden_weights() as f64);
        let solving = match self.solution {
            Solution::Factored => order * order * (h1 / 2.0 + order / 6.0),
            Solution::Iterated => {
                let of_samples = self.samples as f64 * conjugate::multiplications_per_sample(self.shape) as f64;
                ITERATIONS * (of_samples + order * (2.0 * h1 + self.shape.inputs as f64 + 1.0))
            }
        };
        self.samples as f64 * self.gathering_per_sample() + solving
    }

    /// Multiplications per sample to gather all products: BᵀB takes n1²/2 · h²/2, or n1²/2 · h for its diagonal blocks,
    /// and C takes n1·h·(h+1).
    fn gathering_per_sample(&self) -> f64 {
        let (n1, h) = (self.shape.inputs as f64 + 1.0, self.shape.hidden as f64);
        let gram = match self.solution {
            Solution::Factored => n1 * n1 * h * h / 4.0,
            Solution::Iterated => n1 * n1 * h / 2.0,
        };
        gram + n1 * h * (h + 1.0)
    }

    /// Number of parts of the samples in which the products are gathered.
    pub(super) fn gathering_parts(&self, blocks: usize) -> usize {
        let multiplications = BLOCK * self.gathering_per_sample() as usize;
        number_of_parts(blocks, multiplications, LARGE, self.part_bytes())
    }

    /// Rows and columns of the entries of BᵀB that are gathered: all of them, packed as pairs of inputs × pairs of
    /// hidden nodes, pair (i, j ≤ i) at i(i+1)/2 + j; or the diagonal blocks, n1 × h·n1.
    pub(super) fn gram(&self) -> (usize, usize) {
        let (n1, h) = (self.shape.inputs + 1, self.shape.hidden);
        match self.solution {
            Solution::Factored => (pairs(n1), pairs(h)),
            Solution::Iterated => (n1, h * n1),
        }
    }

    /// Approximate memory in bytes of the equations, without the samples.
    pub(in crate::training) fn bytes(&self) -> usize {
        let (order, h, n1) = (self.shape.hidden_weights(), self.shape.hidden, self.shape.inputs + 1);
        let entries = match self.solution {
            Solution::Factored => order + h + 1 + n1,
            Solution::Iterated => 2 * (h + 1) + n1,
        };
        let matrices = order.saturating_mul(entries).saturating_mul(size_of::<f64>());
        let kept = KeptActivations::bytes(self.shape, self.samples);
        matrices.saturating_add(self.part_bytes()).saturating_add(kept)
    }

    /// Approximate memory in bytes of the products for each part of the samples.
    fn part_bytes(&self) -> usize {
        let (h, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let (rows, columns) = self.gram();
        let pairs = match self.solution {
            Solution::Factored => pairs(n1),
            Solution::Iterated => 0,
        };
        let buffers = BLOCK * (CHUNK.min(h * h) + 3 * h + n1 + pairs);
        size_of::<f64>() * (rows * columns + self.shape.hidden_weights() * (h + 1) + buffers)
    }

    /// Additional memory in bytes of the traces of the inverse.
    pub(in crate::training) fn inverse_bytes(&self) -> usize {
        let (order, h1) = (self.shape.hidden_weights(), self.shape.hidden + 1);
        let entries = order.saturating_mul(order + h1).saturating_add(h1 * h1);
        entries.saturating_mul(size_of::<f64>())
    }

    /// Approximate number of multiplications of the traces of the inverse: factor and inverse of S, and a triangular
    /// system of h + 1 columns for each output.
    pub(in crate::training) fn trace_multiplications(&self) -> f64 {
        let (order, h1) = (self.shape.hidden_weights() as f64, self.shape.hidden as f64 + 1.0);
        order * order * (order / 3.0 + h1 / 2.0 + self.shape.outputs as f64 * h1 / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typical_networks_are_factored_and_wide_ones_iterated() {
        let solution = |inputs, hidden, outputs, samples| {
            let shape = Shape {
                inputs,
                hidden,
                outputs,
            };
            Plan::cheapest(shape, samples).solution
        };
        for samples in [100, 1000, 100_000] {
            assert_eq!(solution(30, 12, 20, samples), Solution::Factored, "{samples} samples");
        }
        assert_eq!(solution(96, 64, 64, 2000), Solution::Iterated);
        assert_eq!(solution(1536, 512, 1024, 10_000), Solution::Iterated);
    }
}
