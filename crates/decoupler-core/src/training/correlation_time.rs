//! Correlation of the errors of neighbouring samples.

use super::{Examples, activations::Activations, examples::column};
use crate::network::Mlp;

/// Number of consecutive samples whose errors tell as much as one independent error: the integrated autocorrelation time
/// 1 + 2 Σ ρ(k) of the errors of `mlp`, over all outputs together, up to the first lag without positive correlation, at most
/// `lags` (Sokal 1997, doi:10.1007/978-1-4899-0319-8_6). 1 for independent errors.
pub(super) fn correlation_time(mlp: &Mlp, examples: &Examples, lags: usize) -> f64 {
    let mut outputs = vec![Vec::new(); examples.outputs()];
    let mut activations = Activations::new(mlp.shape());
    // Samples that are drawn again are independent, and their errors need not be held either.
    for block in examples.held() {
        activations.forward(mlp, block);
        for (index, errors) in outputs.iter_mut().enumerate() {
            errors.extend_from_slice(&column(activations.errors.as_ref(), index)[..block.samples()]);
        }
    }
    let products = |lag: usize| -> f64 {
        let of_output = |errors: &Vec<f64>| {
            let pairs = errors.iter().zip(errors.get(lag..).unwrap_or_default());
            pairs.map(|(one, other)| one * other).sum::<f64>()
        };
        outputs.iter().map(of_output).sum()
    };
    let squares = products(0);
    let correlations = (1..=lags).map(|lag| products(lag) / squares);
    // False for NaN, as where there are no errors.
    1.0 + 2.0 * correlations.take_while(|correlation| *correlation > 0.0).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::network::Shape;

    /// A network that answers 0, and targets that follow an autoregression of the first order.
    fn time(memory: f64, lags: usize) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut value = [0.0; 2];
        let targets = Array2::from_shape_fn((20_000, 2), |(_, output)| {
            value[output] = memory * value[output] + rng.random_range(-1.0..1.0);
            value[output]
        });
        let shape = Shape {
            inputs: 1,
            hidden: 1,
            outputs: 2,
        };
        let mlp = Mlp::from_weights(shape, vec![0.0; shape.weights()]);
        let examples = Examples::new(Array2::zeros((20_000, 1)).view(), targets.view());
        correlation_time(&mlp, &examples, lags)
    }

    /// The integrated autocorrelation time of an autoregression of memory ρ is (1 + ρ)/(1 − ρ).
    #[test]
    fn it_is_that_of_the_theory() {
        for memory in [0.0, 0.5, 0.8_f64] {
            let expected = (1.0 + memory) / (1.0 - memory);
            let found = time(memory, 100);
            assert!((found / expected - 1.0).abs() < 0.1, "{memory}: {found}, {expected}");
        }
        assert_eq!(time(0.8, 0), 1.0);
        assert!(time(0.8, 1) < 2.7);
    }
}
