//! Numbers that differ between the classes of weights.

use crate::network::{Mlp, Shape};

/// A number for each class of weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::training) struct PerClass<T = f64> {
    /// From inputs to hidden nodes.
    pub(in crate::training) hidden_weights: T,
    /// Of hidden nodes.
    pub(in crate::training) hidden_biases: T,
    /// From hidden nodes to outputs.
    pub(in crate::training) output_weights: T,
    /// Of outputs.
    pub(in crate::training) output_biases: T,
}

impl<T: Copy> PerClass<T> {
    /// The same for every weight.
    pub(in crate::training) fn all(value: T) -> Self {
        Self {
            hidden_weights: value,
            hidden_biases: value,
            output_weights: value,
            output_biases: value,
        }
    }

    /// As `of` makes them of these.
    pub(in crate::training) fn map<U>(self, of: impl Fn(T) -> U) -> PerClass<U> {
        PerClass {
            hidden_weights: of(self.hidden_weights),
            hidden_biases: of(self.hidden_biases),
            output_weights: of(self.output_weights),
            output_biases: of(self.output_biases),
        }
    }

    /// Of a weight of the hidden layer: that of this input, or after the last one the bias.
    pub(super) fn of_input(&self, input: usize, inputs: usize) -> T {
        if input == inputs {
            self.hidden_biases
        } else {
            self.hidden_weights
        }
    }

    /// Of a weight of the output layer: that of this hidden node, or after the last one the bias.
    pub(super) fn of_node(&self, node: usize, hidden: usize) -> T {
        if node == hidden {
            self.output_biases
        } else {
            self.output_weights
        }
    }

    /// Class by class.
    pub(in crate::training) fn values(self) -> [T; 4] {
        [
            self.hidden_weights,
            self.hidden_biases,
            self.output_weights,
            self.output_biases,
        ]
    }
}

impl PerClass {
    /// Class by class the product.
    pub(in crate::training) fn times(self, other: Self) -> Self {
        Self {
            hidden_weights: self.hidden_weights * other.hidden_weights,
            hidden_biases: self.hidden_biases * other.hidden_biases,
            output_weights: self.output_weights * other.output_weights,
            output_biases: self.output_biases * other.output_biases,
        }
    }
}

/// Decay of the weights towards zero, of output biases towards values of their own.
#[derive(Clone, Copy, Debug)]
pub(in crate::training) struct Decay<'a> {
    rates: PerClass,
    /// Output by output; empty for zeros.
    biases: &'a [f64],
}

impl<'a> Decay<'a> {
    pub(in crate::training) const NONE: Self = Self {
        rates: PerClass {
            hidden_weights: 0.0,
            hidden_biases: 0.0,
            output_weights: 0.0,
            output_biases: 0.0,
        },
        biases: &[],
    };

    /// At these rates, of output biases towards `biases`, or zero if that is empty.
    pub(in crate::training) fn new(rates: PerClass, biases: &'a [f64]) -> Self {
        Self { rates, biases }
    }

    /// Half the gradient of the decay by a weight of the hidden layer.
    pub(super) fn pull_in_hidden(&self, (input, inputs): (usize, usize), weight: f64) -> f64 {
        self.rates.of_input(input, inputs) * weight
    }

    /// Half the gradient of the decay by a weight of the output layer.
    pub(super) fn pull_in_output(&self, (node, hidden): (usize, usize), output: usize, weight: f64) -> f64 {
        let bias = self.biases.get(output).filter(|_| node == hidden);
        self.rates.of_node(node, hidden) * bias.map_or(weight, |bias| weight - bias)
    }
}

/// Number of weights of each class.
pub(in crate::training) fn class_sizes(shape: Shape) -> PerClass<usize> {
    let Shape {
        inputs,
        hidden,
        outputs,
    } = shape;
    PerClass {
        hidden_weights: inputs * hidden,
        hidden_biases: hidden,
        output_weights: hidden * outputs,
        output_biases: outputs,
    }
}

/// Σw² of each class; of output biases their squared distances from `biases`, or zero if that is empty.
pub(in crate::training) fn class_squares(mlp: &Mlp, biases: &[f64]) -> PerClass {
    let mut rest = mlp.weights();
    let sizes = class_sizes(mlp.shape());
    let mut next = |size: usize| {
        let (class, others) = rest.split_at(size);
        rest = others;
        class.iter().map(|weight| weight * weight).sum()
    };
    let mut squares = PerClass {
        hidden_weights: next(sizes.hidden_weights),
        hidden_biases: next(sizes.hidden_biases),
        output_weights: next(sizes.output_weights),
        output_biases: next(sizes.output_biases),
    };
    if !biases.is_empty() {
        let ours = &mlp.weights()[mlp.weights().len() - biases.len()..];
        squares.output_biases = ours.iter().zip(biases).map(|(ours, bias)| (ours - bias).powi(2)).sum();
    }
    squares
}
