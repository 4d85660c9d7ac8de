use super::portable::{Portable, PortableNetwork};
use crate::network::Quantity;

/// Digits of a floating-point number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Digits {
    Single,
    Double,
}

/// Digits in which a bundle of floating-point numbers decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Arithmetic {
    /// Of the changes of the readings and the sums of the hidden nodes.
    pub(super) hidden: Digits,
    /// Of the readings, and of everything after the hidden sums.
    pub(super) rest: Digits,
}

/// Rounded weights, as a bundle has them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights {
    pub(super) quantity: Quantity,
    pub(super) arithmetic: Arithmetic,
    pub(super) networks: Vec<RoundedNetwork>,
}

/// The weights of one network, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoundedNetwork {
    pub(super) centre: Vec<f64>,
    /// Channels × hidden nodes.
    pub(super) hidden_weights: Vec<f64>,
    pub(super) hidden_biases: Vec<f64>,
    /// Hidden nodes × outputs.
    pub(super) output_weights: Vec<f64>,
    pub(super) output_biases: Vec<f64>,
}

impl Digits {
    /// Rounds to these digits. A sum, product, quotient or root of singles, computed in double and then rounded, is the
    /// one of single precision (S. A. Figueroa, SIGNUM Newsletter 30 (1995), 21-26).
    pub(super) fn round(self, value: f64) -> f64 {
        match self {
            Self::Single => f64::from(value as f32),
            Self::Double => value,
        }
    }

    /// Half the spacing of numbers at 1.
    pub(super) fn unit_roundoff(self) -> f64 {
        0.5 * match self {
            Self::Single => f64::from(f32::EPSILON),
            Self::Double => f64::EPSILON,
        }
    }
}

impl Arithmetic {
    pub(super) const DOUBLE: Self = Self {
        hidden: Digits::Double,
        rest: Digits::Double,
    };
    pub(super) const SINGLE: Self = Self {
        hidden: Digits::Single,
        rest: Digits::Single,
    };
    /// Single precision, with the hidden sums in double.
    pub(super) const MIXED: Self = Self {
        hidden: Digits::Double,
        rest: Digits::Single,
    };
}

impl Weights {
    /// Rounds the weights of `portable`.
    pub(super) fn of(portable: &Portable, arithmetic: Arithmetic) -> Self {
        let Arithmetic { hidden, rest } = arithmetic;
        let network = |network: &PortableNetwork| RoundedNetwork {
            centre: network.centre.clone(),
            hidden_weights: network
                .hidden_weights
                .iter()
                .map(|w| hidden.round(w.to_f64()))
                .collect(),
            hidden_biases: network.hidden_biases.iter().map(|w| hidden.round(w.to_f64())).collect(),
            output_weights: network.output_weights.iter().map(|w| rest.round(w.to_f64())).collect(),
            output_biases: network.output_biases.iter().map(|w| rest.round(w.to_f64())).collect(),
        };
        Self {
            quantity: portable.quantity,
            arithmetic,
            networks: portable.networks.iter().map(network).collect(),
        }
    }

    /// Decodes a row in the arithmetic of the bundle.
    pub(super) fn decode(&self, network: usize, readings: &[f64]) -> Vec<f64> {
        let Arithmetic { hidden: digits, rest } = self.arithmetic;
        let network = &self.networks[network];
        let readings = readings.iter().zip(&network.centre);
        let changes: Vec<_> = readings
            .map(|(&ohm, &centre)| change(self.quantity, digits, rest.round(ohm), centre))
            .collect();
        let sums = affine(digits, &changes, &network.hidden_weights, &network.hidden_biases);
        let activations: Vec<_> = sums
            .iter()
            .map(|&sum| rest.round(libm::tanh(rest.round(sum))))
            .collect();
        affine(rest, &activations, &network.output_weights, &network.output_biases)
    }
}

fn change(quantity: Quantity, digits: Digits, ohm: f64, centre: f64) -> f64 {
    let difference = digits.round(ohm - centre);
    match quantity {
        Quantity::Resistance | Quantity::Raw => difference,
        Quantity::Conductance => digits.round(-difference / ohm),
        Quantity::LogResistance => digits.round(libm::log1p(digits.round(difference / centre))),
    }
}

/// values · weights + biases, where the weights are stored row by row.
fn affine(digits: Digits, values: &[f64], weights: &[f64], biases: &[f64]) -> Vec<f64> {
    let mut sums = biases.to_vec();
    // Without biases there are no weights either.
    for (value, row) in values.iter().zip(weights.chunks_exact(biases.len().max(1))) {
        for (sum, weight) in sums.iter_mut().zip(row) {
            *sum = digits.round(*sum + digits.round(value * weight));
        }
    }
    sums
}
