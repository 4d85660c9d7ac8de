//! Which way of solving the equations is cheaper: decided from sizes alone, so that it is the same on every machine and
//! after every pause.

use super::{
    conjugate::ConjugateGradient,
    products::{GramPart, Products},
};
use crate::{
    network::Shape,
    training::{
        examples::BLOCK,
        parallel::{LARGE, Work},
    },
};

/// How the equations of the hidden layer are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::training) enum Way {
    /// The matrix is formed and factored.
    Factored,
    /// Conjugate gradients, the matrix never being formed.
    Iterated,
}

/// Iterations that a step is taken to need: 30 to 70 were seen in training, more at the end of it.
const ITERATIONS: f64 = 100.0;
/// How much faster the large products of the factored way run than the small ones of the iterated way.
const SPEED: f64 = 2.0;

impl Way {
    /// The cheaper way for a network of this shape and so many samples.
    pub(in crate::training) fn cheaper(shape: Shape, samples: usize) -> Self {
        let [factored, iterated] = [Self::Factored, Self::Iterated].map(|way| {
            let gathering = samples as f64 * way.gathering_per_sample(shape);
            gathering + way.solving(shape, samples)
        });
        if factored <= SPEED * iterated {
            Self::Factored
        } else {
            Self::Iterated
        }
    }

    /// Multiplications to gather the products, for each sample: with h1 = h+1,
    ///
    /// ```text
    /// factored   n1²/2 · h²/2 + n1 h h1
    /// iterated   n1²/2 · h    + n1 h h1
    /// ```
    fn gathering_per_sample(self, shape: Shape) -> f64 {
        let (n1, h) = (shape.inputs as f64 + 1.0, shape.hidden as f64);
        let gram = match self {
            Self::Factored => n1 * n1 * h * h / 4.0,
            Self::Iterated => n1 * n1 * h / 2.0,
        };
        gram + n1 * h * (h + 1.0)
    }

    /// Multiplications to solve once: with order = h·n1, S samples and k iterations,
    ///
    /// ```text
    /// factored   order² h1/2 + order³/6
    /// iterated   k (S (2 n1 h + h²) + order (2 h1 + n1))
    /// ```
    fn solving(self, shape: Shape, samples: usize) -> f64 {
        let (n1, h1, order) = (
            shape.inputs as f64 + 1.0,
            shape.hidden as f64 + 1.0,
            shape.hidden_weights() as f64,
        );
        match self {
            Self::Factored => order * order * (h1 / 2.0 + order / 6.0),
            Self::Iterated => {
                ITERATIONS * (samples as f64 * pushing_per_sample(shape) as f64 + order * (2.0 * h1 + n1))
            }
        }
    }

    /// Into how many parts the samples are divided to gather the products.
    pub(super) fn gathering_parts(self, shape: Shape, blocks: usize) -> usize {
        let work = Work {
            blocks,
            multiplications: BLOCK * self.gathering_per_sample(shape) as usize,
            bytes: Products::bytes(shape, self.gram_part()),
        };
        work.parts(LARGE)
    }

    /// About how many bytes it takes, beside what the samples take.
    pub(in crate::training) fn bytes(self, shape: Shape) -> usize {
        let (order, n1, h1) = (shape.hidden_weights(), shape.inputs + 1, shape.hidden + 1);
        let matrices = match self {
            Self::Factored => order.saturating_mul(order + h1 + n1),
            Self::Iterated => order.saturating_mul(2 * h1 + n1),
        };
        let sums = Products::bytes(shape, self.gram_part());
        matrices.saturating_mul(size_of::<f64>()).saturating_add(sums)
    }

    pub(super) fn gram_part(self) -> GramPart {
        match self {
            Self::Factored => GramPart::All,
            Self::Iterated => GramPart::NodeBlocks,
        }
    }
}

/// Into how many parts the samples are divided for each iteration. They follow upon each other so quickly that threads
/// stay awake, and less is worth dividing.
pub(super) fn pushing_parts(shape: Shape, blocks: usize) -> usize {
    let work = Work {
        blocks,
        multiplications: BLOCK * pushing_per_sample(shape),
        bytes: ConjugateGradient::bytes(shape),
    };
    work.parts(LARGE / 8)
}

fn pushing_per_sample(shape: Shape) -> usize {
    2 * shape.hidden_weights() + shape.hidden * shape.hidden
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_networks_are_factored_and_wide_ones_iterated() {
        let way = |inputs, hidden, outputs, samples| {
            let shape = Shape {
                inputs,
                hidden,
                outputs,
            };
            Way::cheaper(shape, samples)
        };
        for samples in [100, 1000, 100_000] {
            assert_eq!(way(30, 12, 20, samples), Way::Factored, "{samples} samples");
        }
        assert_eq!(way(96, 64, 64, 2000), Way::Iterated);
        assert_eq!(way(1536, 512, 1024, 10_000), Way::Iterated);
    }
}
