//! Invariances of a training step.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::{Array2, Axis};
use proptest::prelude::*;

use crate::cases;

/// Inputs, targets and weights of a 3-4-2 network, and another order of the samples.
#[derive(Clone, Debug)]
struct Drawn {
    inputs: Array2<f64>,
    targets: Array2<f64>,
    weights: Vec<f64>,
    order: Vec<usize>,
}

const SHAPE: Shape = Shape {
    inputs: 3,
    hidden: 4,
    outputs: 2,
};

fn drawn() -> impl Strategy<Value = Drawn> {
    (40..80_usize).prop_flat_map(|samples| {
        let table = |columns: usize| {
            let values = prop::collection::vec(-1.0..1.0_f64, samples * columns);
            values.prop_map(move |values| Array2::from_shape_vec((samples, columns), values).unwrap())
        };
        let weights = prop::collection::vec(-1.0..1.0_f64, SHAPE.weights());
        let order = Just(Vec::from_iter(0..samples)).prop_shuffle();
        let drawn = (table(SHAPE.inputs), table(SHAPE.outputs), weights, order);
        drawn.prop_map(|(inputs, targets, weights, order)| Drawn {
            inputs,
            targets,
            weights,
            order,
        })
    })
}

/// Weights after one epoch, and the error there.
fn after_an_epoch(method: Method, drawn: &Drawn) -> (Vec<f64>, f64) {
    let problem = ExampleSets {
        training: Examples::new(drawn.inputs.view(), drawn.targets.view()),
        validation: None,
        test: None,
    };
    let start = Mlp::from_weights(SHAPE, drawn.weights.clone());
    let stopping = StoppingRules::default();
    let mut trainer = Trainer::new(start, problem, TrainingSettings { method, stopping }).unwrap();
    trainer.step();
    (trainer.present().weights().to_vec(), trainer.latest().training_mse)
}

proptest! {
    #![proptest_config(cases(16))]

    #[test]
    fn the_order_of_the_samples_does_not_matter(drawn in drawn()) {
        let mut other = drawn.clone();
        other.inputs = drawn.inputs.select(Axis(0), &drawn.order);
        other.targets = drawn.targets.select(Axis(0), &drawn.order);
        for method in Method::all() {
            let ((weights, mse), (others, other_mse)) = (after_an_epoch(method, &drawn), after_an_epoch(method, &other));
            let name = method.name();
            prop_assert!((mse - other_mse).abs() < 1e-9 * mse, "{name}: {mse} and {other_mse}");
            let off = weights.iter().zip(&others).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            prop_assert!(off < 1e-7, "{name}: {off:e}");
        }
    }
}
