//! The choice of the solver for a network.

use super::{conjugate::ConjugateGradient, hidden_solver::HiddenSolver, schur::SchurComplement};
use crate::network::Shape;

/// Speed of the large products of the factored solver relative to the small ones of conjugate gradients.
const SPEED: f64 = 2.0;

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
