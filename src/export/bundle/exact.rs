use ndarray::ArrayView1;

use super::{
    portable::{Portable, PortableNetwork},
    twofold::Twofold,
};
use crate::network::Quantity;

/// Answer of a network to a reading, and how much rounding can change it.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// Outputs, exact but for their own last digits.
    pub(super) answers: Vec<f64>,
    /// Sums of magnitudes by which rounding errors grow.
    pub(super) growth: Growth,
    /// Slope of each hidden node's activation with respect to its sum.
    slopes: Vec<f64>,
}

/// Largest changes of an output relative to its scale, to first order, per relative error of each number that is added up.
///
/// An error bound of a sum is a multiple of its magnitudes (N. J. Higham, Accuracy and Stability of Numerical Algorithms,
/// section 3.1), here carried through the tangent to the outputs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Growth {
    /// By the sums of the hidden nodes.
    pub(super) hidden: f64,
    /// By everything after them.
    pub(super) rest: f64,
}

impl Growth {
    pub(super) fn largest(self, other: Self) -> Self {
        Self {
            hidden: self.hidden.max(other.hidden),
            rest: self.rest.max(other.rest),
        }
    }
}

/// Answers `readings` with twice the digits of double precision.
pub(super) fn decode_exactly(portable: &Portable, network: &PortableNetwork, readings: &[f64]) -> Exact {
    let readings = readings.iter().zip(&network.centre);
    let changes: Vec<_> = readings
        .map(|(&ohm, &centre)| change(portable.quantity, ohm, centre))
        .collect();
    let mut hidden = Vec::new();
    for node in 0..portable.hidden {
        let bias = network.hidden_biases[node];
        let (mut sum, mut magnitude) = (bias, bias.to_f64().abs());
        for (&change, &weight) in changes.iter().zip(network.hidden_weights.column(node)) {
            let product = change * weight;
            sum = sum + product;
            magnitude += product.to_f64().abs();
        }
        let activation = sum.tanh();
        let slope = slope(activation);
        let own = activation.to_f64().abs() + slope * sum.to_f64().abs();
        hidden.push((activation, slope * magnitude, own));
    }
    let mut growth = Growth::default();
    let mut answers = Vec::new();
    for output in 0..portable.outputs {
        let bias = network.output_biases[output];
        let (mut sum, mut of_hidden, mut of_rest) = (bias, 0.0, bias.to_f64().abs());
        for (&(activation, magnitude, own), &weight) in hidden.iter().zip(network.output_weights.column(output)) {
            sum = sum + activation * weight;
            of_hidden += magnitude * weight.to_f64().abs();
            of_rest += own * weight.to_f64().abs();
        }
        growth = growth.largest(Growth {
            hidden: of_hidden / portable.scales[output],
            rest: of_rest / portable.scales[output],
        });
        answers.push(sum.to_f64());
    }
    Exact {
        answers,
        growth,
        slopes: hidden.iter().map(|&(activation, ..)| slope(activation)).collect(),
    }
}

/// Slope of the hyperbolic tangent where it has this value.
fn slope(activation: Twofold) -> f64 {
    (1.0 - activation.to_f64()) * (1.0 + activation.to_f64())
}

impl Exact {
    /// Bound on the change of an output relative to its scale, to first order, when each of the `readings` answered may be
    /// wrong by up to `errors`.
    pub(super) fn change_by(
        &self,
        portable: &Portable,
        network: &PortableNetwork,
        readings: &[f64],
        errors: &[f64],
    ) -> f64 {
        let steps = readings.iter().zip(errors).zip(&network.centre);
        let steps: Vec<f64> = steps
            .map(|((&ohm, &error), &centre)| slope_of_change(portable.quantity, ohm, centre) * error)
            .collect();
        let mut largest = 0.0_f64;
        for output in 0..portable.outputs {
            let of_nodes = network.output_weights.column(output);
            let of_nodes: Vec<f64> = of_nodes
                .iter()
                .zip(&self.slopes)
                .map(|(v, slope)| v.to_f64() * slope)
                .collect();
            let of_reading = |(step, weights): (&f64, ArrayView1<'_, Twofold>)| {
                let sum: f64 = weights.iter().zip(&of_nodes).map(|(w, v)| w.to_f64() * v).sum();
                (sum * step).abs()
            };
            let sum: f64 = steps.iter().zip(network.hidden_weights.rows()).map(of_reading).sum();
            largest = largest.max(sum / portable.scales[output]);
        }
        largest
    }
}

/// Derivative of the change of a reading with respect to the reading.
fn slope_of_change(quantity: Quantity, ohm: f64, centre: f64) -> f64 {
    match quantity {
        Quantity::Resistance | Quantity::Raw => 1.0,
        Quantity::Conductance => -centre / ohm / ohm,
        Quantity::LogResistance => 1.0 / ohm,
    }
}

fn change(quantity: Quantity, ohm: f64, centre: f64) -> Twofold {
    let (ohm, centre) = (Twofold::from(ohm), Twofold::from(centre));
    match quantity {
        Quantity::Resistance | Quantity::Raw => ohm - centre,
        Quantity::Conductance => (centre - ohm) / ohm,
        Quantity::LogResistance => (ohm / centre).ln(),
    }
}
