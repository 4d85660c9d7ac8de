use super::{
    portable::{Portable, PortableNetwork},
    twofold::Twofold,
};
use crate::network::Quantity;

/// Answer of a network to a reading, and how much rounding can change it.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// Coordinates in mm, exact but for their own last digits.
    pub(super) coordinates_mm: Vec<f64>,
    /// Sums of magnitudes by which rounding errors grow, in mm.
    pub(super) growth: Growth,
}

/// Largest changes of a coordinate in mm, to first order, per relative error of each number that is added up.
///
/// An error bound of a sum is a multiple of its magnitudes (N. J. Higham, Accuracy and Stability of Numerical Algorithms,
/// section 3.1), here carried through the tangent to the coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Growth {
    /// By the sums of the hidden nodes.
    pub(super) hidden_mm: f64,
    /// By everything after them.
    pub(super) rest_mm: f64,
}

impl Growth {
    pub(super) fn largest(self, other: Self) -> Self {
        Self {
            hidden_mm: self.hidden_mm.max(other.hidden_mm),
            rest_mm: self.rest_mm.max(other.rest_mm),
        }
    }
}

/// Answers `readings_ohm` with twice the digits of double precision.
pub(super) fn decode_exactly(portable: &Portable, network: &PortableNetwork, readings_ohm: &[f64]) -> Exact {
    let readings = readings_ohm.iter().zip(&network.centre_ohm);
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
        let slope = (1.0 - activation.to_f64()) * (1.0 + activation.to_f64());
        let own = activation.to_f64().abs() + slope * sum.to_f64().abs();
        hidden.push((activation, slope * magnitude, own));
    }
    let mut growth = Growth::default();
    let mut coordinates_mm = Vec::new();
    for coordinate in 0..portable.outputs {
        let bias = network.output_biases[coordinate];
        let (mut sum, mut of_hidden, mut of_rest) = (bias, 0.0, bias.to_f64().abs());
        for (&(activation, magnitude, own), &weight) in hidden.iter().zip(network.output_weights.column(coordinate)) {
            sum = sum + activation * weight;
            of_hidden += magnitude * weight.to_f64().abs();
            of_rest += own * weight.to_f64().abs();
        }
        growth = growth.largest(Growth {
            hidden_mm: of_hidden,
            rest_mm: of_rest,
        });
        coordinates_mm.push(sum.to_f64());
    }
    Exact { coordinates_mm, growth }
}

fn change(quantity: Quantity, ohm: f64, centre_ohm: f64) -> Twofold {
    let (ohm, centre) = (Twofold::from(ohm), Twofold::from(centre_ohm));
    match quantity {
        Quantity::Resistance | Quantity::Raw => ohm - centre,
        Quantity::Conductance => (centre - ohm) / ohm,
        Quantity::LogResistance => (ohm / centre).ln(),
    }
}
