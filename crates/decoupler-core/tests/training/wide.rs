//! Networks too wide for their equations to be factorised.

use decoupler_core::{
    machine::MemoryBudget,
    network::{Mlp, Shape},
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingError, TrainingSettings, check_width},
};
use ndarray::Array2;

use crate::problems::wave;

fn samples(shape: Shape, count: usize) -> (Array2<f64>, Array2<f64>) {
    let inputs = Array2::from_shape_fn((count, shape.inputs), |(row, column)| wave(row, column));
    let targets = Array2::from_shape_fn((count, shape.outputs), |(row, output)| {
        (inputs[[row, output]] + 0.5 * inputs[[row, output + 1]]).sin()
    });
    (inputs, targets)
}

fn problem(shape: Shape, count: usize) -> ExampleSets {
    let (inputs, targets) = samples(shape, count);
    ExampleSets {
        training: Examples::new(inputs.view(), targets.view()),
        validation: None,
        test: None,
    }
}

fn begin(method: &str, shape: Shape, samples: usize) -> Result<Trainer, TrainingError> {
    let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 9)).collect());
    let settings = TrainingSettings {
        method: Method::named(method).unwrap(),
        stopping: StoppingRules::default(),
    };
    Trainer::new(start, problem(shape, samples), settings)
}

const WIDE: Shape = Shape {
    inputs: 40,
    hidden: 60,
    outputs: 6,
};

#[test]
fn a_wide_network_learns() {
    let mut trainer = begin("lm", WIDE, 700).unwrap();
    let start = trainer.latest().training_mse;
    for _ in 0..6 {
        trainer.step();
    }
    let reached = trainer.latest().training_mse;
    // The recorded error is that of the network itself.
    let (inputs, targets) = samples(WIDE, 700);
    let errors = trainer.present().forward(inputs.view()) - targets;
    let found = errors.mapv(|error| error * error).mean().expect("there are samples");
    assert!((reached - found).abs() < 1e-12 * found, "{reached:e} {found:e}");
    assert!(reached < 1e-2 * start, "{start:e} {reached:e}");
}

/// Its equations would have 2 million rows: 32 TB, and their inverse as much.
#[test]
fn only_methods_that_factorise_refuse_a_very_wide_network() {
    let shape = Shape {
        inputs: 2000,
        hidden: 1000,
        outputs: 3,
    };
    let memory = MemoryBudget::System(16_000_000_000);
    let refused = check_width(&Method::named("br").unwrap(), shape, 8, 1, memory).unwrap_err();
    assert!(
        matches!(refused, TrainingError::TooWide { trainings: 1, memory: of, .. } if of == memory),
        "{refused:?}"
    );
    for words in ["the machine has 16.0 GB", "scg"] {
        assert!(refused.to_string().contains(words), "{refused}");
    }
    // 23 205 rows would take 4 GB.
    let shape = Shape {
        inputs: 220,
        hidden: 105,
        outputs: 3,
    };
    check_width(&Method::named("lm").unwrap(), shape, 8, 1, memory).unwrap();
    let mut trainer = begin("lm", shape, 8).unwrap();
    let start = trainer.latest().training_mse;
    trainer.step();
    assert!(trainer.latest().training_mse < 0.5 * start);
}
