use rand::{Rng, RngExt};

use super::{Mlp, Shape};

/// Returns a network with a random initialisation by Nguyen and Widrow (1990), which spreads the active regions of the
/// hidden nodes over inputs in [−1, 1].
///
/// Each hidden node gets a random direction of length 2 · 0.7 · h^(1/n), and the biases are spaced evenly over ± that
/// length, so that the slopes of the nodes (net input within ±2) cover the input range. The weights of the output layer
/// are uniform in [−1, 1].
pub fn nguyen_widrow(shape: Shape, rng: &mut impl Rng) -> Mlp {
    /// Half-width of the net input over which tanh is not yet flat.
    const ACTIVE: f64 = 2.0;
    let Shape { inputs, hidden, .. } = shape;
    let mut mlp = Mlp::zeros(shape);
    let (w, v) = mlp.weights_mut().split_at_mut(shape.hidden_weights());
    let length = if inputs == 0 {
        0.0
    } else {
        ACTIVE * 0.7 * (hidden as f64).powf(1.0 / inputs as f64)
    };
    for node in 0..hidden {
        let direction: Vec<f64> = (0..inputs).map(|_| rng.random_range(-1.0..1.0)).collect();
        // A vector of length 0 has no direction; it is as improbable as 53 zero bits for every input.
        let norm = direction
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt()
            .max(f64::MIN_POSITIVE);
        for (input, x) in direction.iter().enumerate() {
            w[input * hidden + node] = length * x / norm;
        }
        let place = if hidden == 1 {
            0.0
        } else {
            2.0 * node as f64 / (hidden - 1) as f64 - 1.0
        };
        let sign = direction.first().map_or(1.0, |x| x.signum());
        w[inputs * hidden + node] = length * place * sign;
    }
    for weight in v {
        *weight = rng.random_range(-1.0..1.0);
    }
    mlp
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};

    #[test]
    fn directions_have_the_documented_length_and_biases_span_it() {
        let shape = Shape {
            inputs: 30,
            hidden: 12,
            outputs: 20,
        };
        let mlp = nguyen_widrow(shape, &mut Seed(0).rng(Stream::Start));
        let length = 1.4 * 12.0_f64.powf(1.0 / 30.0);
        let w = mlp.hidden_layer();
        for node in 0..12 {
            let norm = (0..30).map(|i| w[[i, node]].powi(2)).sum::<f64>().sqrt();
            assert!((norm - length).abs() < 1e-12);
            assert!(w[[30, node]].abs() <= length * (1.0 + 1e-12));
        }
        assert!((w[[30, 0]].abs() - length).abs() < 1e-12 && (w[[30, 11]].abs() - length).abs() < 1e-12);
        assert!(mlp.output_layer().iter().all(|v| v.abs() <= 1.0));
    }

    #[test]
    fn the_smallest_networks_start_too() {
        for (inputs, hidden, outputs) in [(1, 1, 1), (0, 1, 1), (1, 200, 1)] {
            let mlp = nguyen_widrow(
                Shape {
                    inputs,
                    hidden,
                    outputs,
                },
                &mut Seed(1).rng(Stream::Start),
            );
            assert!(mlp.weights().iter().all(|weight| weight.is_finite()));
        }
    }
}
