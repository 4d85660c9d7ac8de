//! A small problem shared by the tests of training: two smooth functions of three inputs.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;

/// Numbers in [−1, 1] without repetition.
pub(crate) fn wave(row: usize, column: usize) -> f64 {
    (1.0 + 12.9898 * row as f64 + 78.233 * column as f64 + 0.71 * (row * column) as f64).sin()
}

/// Inputs and targets of the training set.
pub(crate) fn training() -> (Array2<f64>, Array2<f64>) {
    samples(120, 0)
}

fn samples(samples: usize, first: usize) -> (Array2<f64>, Array2<f64>) {
    let inputs = Array2::from_shape_fn((samples, 3), |(row, column)| wave(first + row, column));
    let targets = Array2::from_shape_fn((samples, 2), |(row, output)| {
        let (x, y, z) = (inputs[[row, 0]], inputs[[row, 1]], inputs[[row, 2]]);
        if output == 0 { (2.0 * x + y).sin() } else { x * y - z }
    });
    (inputs, targets)
}

fn examples(count: usize, first: usize) -> Examples {
    let (inputs, targets) = samples(count, first);
    Examples::new(inputs.view(), targets.view())
}

pub(crate) fn problem() -> ExampleSets {
    ExampleSets {
        training: examples(120, 0),
        validation: Some(examples(40, 1000)),
        test: Some(examples(30, 2000)),
    }
}

pub(crate) fn start() -> Mlp {
    let shape = Shape {
        inputs: 3,
        hidden: 6,
        outputs: 2,
    };
    Mlp::from_weights(shape, (0..shape.weights()).map(|index| wave(index, 7)).collect())
}

/// Only the number of epochs stops it.
pub(crate) fn trainer(method: Method) -> Trainer {
    let stopping = StoppingRules {
        epochs: 100_000,
        goal_mse: 0.0,
        min_gradient: 0.0,
        max_fail: 100_000,
    };
    Trainer::new(start(), problem(), TrainingSettings { method, stopping }).expect("the problem can be trained on")
}
