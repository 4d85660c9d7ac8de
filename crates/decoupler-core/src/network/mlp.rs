use ndarray::ArrayView2;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Number of channels in each layer, not counting biases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shape {
    /// Number of inputs, n.
    pub inputs: usize,
    /// Number of hidden nodes, h.
    pub hidden: usize,
    /// Number of outputs, m.
    pub outputs: usize,
}

impl Shape {
    /// Number of weights and biases in the hidden layer.
    pub fn hidden_weights(self) -> usize {
        (self.inputs + 1) * self.hidden
    }

    /// Number of weights and biases in the output layer.
    pub fn output_weights(self) -> usize {
        (self.hidden + 1) * self.outputs
    }

    /// Number of weights and biases in both layers.
    pub fn weights(self) -> usize {
        self.hidden_weights() + self.output_weights()
    }
}

/// A multilayer perceptron: `y = [tanh([x, 1] W), 1] V` with W (n+1 × h) and V (h+1 × m); the biases are in their last
/// rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    shape: Shape,
    /// W followed by V, each row by row.
    weights: Vec<f64>,
}

impl Mlp {
    /// Creates a network with all weights zero.
    pub fn zeros(shape: Shape) -> Self {
        Self::from_weights(shape, vec![0.0; shape.weights()])
    }

    /// Creates a network from its weights: W row by row, then V row by row.
    ///
    /// # Panics
    /// If `weights` does not have `shape.weights()` entries.
    pub fn from_weights(shape: Shape, weights: Vec<f64>) -> Self {
        assert_eq!(weights.len(), shape.weights());
        Self { shape, weights }
    }

    /// Returns the network whose outputs are the mean of the outputs of `networks`, exact except for rounding: their hidden
    /// nodes side by side, with output weights divided by the number of networks.
    ///
    /// # Panics
    /// If there are none, or their numbers of inputs or outputs differ.
    pub fn mean(networks: &[&Self]) -> Self {
        let Shape { inputs, outputs, .. } = networks[0].shape;
        let is_alike = |network: &&Self| (network.shape.inputs, network.shape.outputs) == (inputs, outputs);
        assert!(networks.iter().all(is_alike), "the networks share inputs and outputs");
        let count = networks.len() as f64;
        let shape = Shape {
            hidden: networks.iter().map(|network| network.shape.hidden).sum(),
            ..networks[0].shape
        };
        let mut weights = Vec::with_capacity(shape.weights());
        for input in 0..=inputs {
            for network in networks {
                weights.extend(network.hidden_layer().row(input));
            }
        }
        for network in networks {
            let of_nodes = &network.layers().1[..network.shape.hidden * outputs];
            weights.extend(of_nodes.iter().map(|weight| weight / count));
        }
        for output in 0..outputs {
            let bias = |network: &&Self| network.output_layer()[[network.shape.hidden, output]];
            weights.push(networks.iter().map(bias).sum::<f64>() / count);
        }
        Self::from_weights(shape, weights)
    }

    /// Number of channels in each layer.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Returns all weights: W row by row, then V row by row.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns all weights mutably, in the order of [`Self::weights`].
    pub fn weights_mut(&mut self) -> &mut [f64] {
        &mut self.weights
    }

    /// Returns W and V, each row by row.
    pub fn layers(&self) -> (&[f64], &[f64]) {
        self.weights.split_at(self.shape.hidden_weights())
    }

    /// Weights of the hidden layer, W (n+1 × h), with the biases in the last row.
    pub fn hidden_layer(&self) -> ArrayView2<'_, f64> {
        let shape = (self.shape.inputs + 1, self.shape.hidden);
        ArrayView2::from_shape(shape, self.layers().0).expect("checked when built")
    }

    /// Weights of the output layer, V (h+1 × m), with the biases in the last row.
    pub fn output_layer(&self) -> ArrayView2<'_, f64> {
        let shape = (self.shape.hidden + 1, self.shape.outputs);
        ArrayView2::from_shape(shape, self.layers().1).expect("checked when built")
    }
}

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
    let length = match inputs {
        0 => 0.0,
        _ => ACTIVE * 0.7 * (hidden as f64).powf(1.0 / inputs as f64),
    };
    for node in 0..hidden {
        let direction: Vec<f64> = (0..inputs).map(|_| rng.random_range(-1.0..1.0)).collect();
        // A vector of length 0 has no direction; it is as improbable as 53 zero bits for every input.
        let squares: f64 = direction.iter().map(|x| x * x).sum();
        let norm = squares.sqrt().max(f64::MIN_POSITIVE);
        for (input, x) in direction.iter().enumerate() {
            w[input * hidden + node] = length * x / norm;
        }
        let place = match hidden {
            1 => 0.0,
            _ => 2.0 * node as f64 / (hidden - 1) as f64 - 1.0,
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
    use ndarray::{Array2, array};

    use super::*;
    use crate::dataset::{Seed, Stream};

    #[test]
    fn two_layers_by_hand() {
        let shape = Shape {
            inputs: 2,
            hidden: 2,
            outputs: 1,
        };
        let mlp = Mlp::from_weights(shape, vec![0.1, -0.4, 0.2, 0.5, 0.3, -0.6, 2.0, -3.0, 0.7]);
        let y = mlp.forward(array![[1.0, -2.0]].view());
        let (first, second) = ((0.1 - 0.4 + 0.3_f64).tanh(), (-0.4 - 1.0 - 0.6_f64).tanh());
        assert!((y[[0, 0]] - (2.0 * first - 3.0 * second + 0.7)).abs() < 1e-15);
    }

    #[test]
    fn the_mean_of_networks_answers_with_the_mean_of_their_answers() {
        let network = |hidden, seed| {
            let shape = Shape {
                inputs: 5,
                hidden,
                outputs: 3,
            };
            nguyen_widrow(shape, &mut Seed(seed).rng(Stream::Start))
        };
        let networks = [network(4, 0), network(4, 1), network(7, 2)];
        let inputs = Array2::from_shape_fn((20, 5), |(sample, input)| ((3 * sample + 7 * input) as f64).sin());
        let answers = networks.each_ref().map(|network| network.forward(inputs.view()));
        let mean = (&answers[0] + &answers[1] + &answers[2]) / 3.0;
        let merged = Mlp::mean(&networks.each_ref());
        assert_eq!(merged.shape().hidden, 15);
        let difference = &merged.forward(inputs.view()) - &mean;
        assert!(difference.iter().all(|value| value.abs() < 1e-13), "{difference}");
        assert_eq!(Mlp::mean(&[&networks[0]]), networks[0]);
    }

    #[test]
    fn without_inputs_the_output_is_constant() {
        let shape = Shape {
            inputs: 0,
            hidden: 1,
            outputs: 2,
        };
        let mlp = Mlp::from_weights(shape, vec![0.0, 5.0, 6.0, 1.0, 2.0]);
        assert_eq!(
            mlp.forward(Array2::zeros((3, 0)).view()),
            array![[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]]
        );
    }

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
    fn the_smallest_networks_can_be_initialised() {
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
