//! Classes of weights, which differ in their damping and decay.

use std::ops::Range;

use crate::network::{Mlp, Shape};

/// One value for each class of weights, in the order of [`Mlp::weights`]: weights and biases of the hidden layer, weights
/// and biases of the output layer.
pub(in crate::training) type Classes<T = f64> = [T; 4];

/// Weights from inputs to hidden nodes.
pub(in crate::training) const HIDDEN_WEIGHTS: usize = 0;
/// Biases of hidden nodes.
pub(in crate::training) const HIDDEN_BIASES: usize = 1;
/// Weights from hidden nodes to outputs.
pub(in crate::training) const OUTPUT_WEIGHTS: usize = 2;
/// Biases of outputs.
pub(in crate::training) const OUTPUT_BIASES: usize = 3;

/// Returns the number of weights in each class.
pub(in crate::training) fn class_sizes(shape: Shape) -> Classes<usize> {
    let weights = shape.hidden * shape.inputs;
    [weights, shape.hidden, shape.hidden * shape.outputs, shape.outputs]
}

/// Returns the weights of each class, less the values towards which they decay: zero, or `biases` for those of the
/// outputs if they are given.
fn by_class<'a>(mlp: &'a Mlp, biases: &'a [f64]) -> Classes<impl Iterator<Item = f64> + 'a> {
    let mut first = 0;
    class_sizes(mlp.shape()).map(|size| {
        let class: Range<usize> = first..first + size;
        first = class.end;
        let is_last = first == mlp.weights().len();
        let towards = if is_last { biases } else { &[] };
        let weights = mlp.weights()[class].iter().enumerate();
        weights.map(|(index, weight)| towards.get(index).map_or(*weight, |towards| weight - towards))
    })
}

/// Returns Σw² of each class; for output biases, the squared distances from `biases`, or from zero if that is empty.
pub(in crate::training) fn class_squares(mlp: &Mlp, biases: &[f64]) -> Classes {
    by_class(mlp, biases).map(|weights| weights.map(|weight| weight * weight).sum())
}

/// Returns half the derivatives of the penalty `rate`·Σw² of each class, in the order of [`Mlp::weights`]; for output
/// biases, w is the distance from `biases`, or from zero if that is empty.
pub(in crate::training) fn decay_slopes(mlp: &Mlp, rates: Classes, biases: &[f64]) -> Vec<f64> {
    let classes = rates.into_iter().zip(by_class(mlp, biases));
    classes
        .flat_map(|(rate, weights)| weights.map(move |weight| rate * weight))
        .collect()
}
