//! Each method on problems with a known answer, and at the extremes, where it must stop with a reason and never answer
//! NaN.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{Examples, Method, Problem, StopReason, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;

use crate::problems::{start, trainer, wave};

fn named(name: &str) -> Method {
    let method = Method::all().into_iter().find(|method| method.short_name() == name);
    method.expect("it is offered")
}

fn alone(training: Examples) -> Problem {
    Problem {
        training,
        validation: None,
        test: None,
    }
}

#[test]
fn every_method_learns_two_smooth_functions() {
    // (method, epochs, the training error to reach from 1.5)
    let table = [
        ("lm", 60, 1e-4),
        ("br", 100, 1e-3),
        ("varpro", 60, 1e-4),
        ("scg", 500, 2e-3),
        ("rp", 500, 1e-2),
        ("gdx", 1000, 3e-2),
        ("gdms", 1000, 0.15),
        ("gdm", 1000, 0.15),
        ("gd", 1000, 0.15),
    ];
    for (name, epochs, goal) in table {
        let mut trainer = trainer(named(name));
        for _ in 0..epochs {
            trainer.step();
        }
        let reached = trainer
            .history()
            .iter()
            .fold(f64::INFINITY, |least, epoch| least.min(epoch.training_mse));
        assert!(reached < goal, "{name} reached {reached:e}");
    }
}

/// Without inputs and with a hidden node fixed by its bias, only constants can be learned: the best is the mean of the
/// targets.
#[test]
fn second_order_methods_find_the_mean_when_there_is_nothing_else() {
    let targets = Array2::from_shape_fn((50, 2), |(row, output)| wave(row, output) + output as f64);
    let mean = targets.mean_axis(ndarray::Axis(0)).expect("there are samples");
    let least = (&targets - &mean)
        .mapv(|value| value * value)
        .mean()
        .expect("there are samples");
    let shape = Shape {
        inputs: 0,
        hidden: 2,
        outputs: 2,
    };
    for name in ["lm", "varpro", "scg"] {
        let examples = Examples::new(Array2::zeros((50, 0)).view(), targets.view());
        let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| wave(index, 1)).collect());
        let settings = TrainingSettings {
            method: named(name),
            stopping: StoppingRules::default(),
        };
        let mut trainer = Trainer::new(start, alone(examples), settings).expect("it can be trained");
        while trainer.step().is_none() {}
        let found = trainer.latest().training_mse;
        assert!(
            (found - least).abs() < 1e-9,
            "{name}: {found} {least}, {:?}",
            trainer.stop_reason()
        );
    }
}

/// One epoch of variable projection is the linear least-squares solution: targets that some output layer reaches exactly
/// are reached.
#[test]
fn variable_projection_solves_a_linear_output_layer_in_one_epoch() {
    let inputs = Array2::from_shape_fn((80, 3), |(row, column)| wave(row, column));
    let shape = Shape {
        inputs: 3,
        hidden: 5,
        outputs: 2,
    };
    let weights = |scale: f64| -> Vec<f64> {
        let hidden = shape.hidden_weights();
        let scaled = |index: usize| {
            if index < hidden {
                wave(index, 2)
            } else {
                scale * wave(index, 3)
            }
        };
        (0..shape.weights()).map(scaled).collect()
    };
    let targets = Mlp::from_weights(shape, weights(2.0)).forward(inputs.view());
    let settings = TrainingSettings {
        method: named("varpro"),
        stopping: StoppingRules::default(),
    };
    let start = Mlp::from_weights(shape, weights(-1.0));
    let examples = Examples::new(inputs.view(), targets.view());
    let mut trainer = Trainer::new(start, alone(examples), settings).expect("it can be trained");
    trainer.step();
    assert!(
        trainer.latest().training_mse < 1e-18,
        "{:e}",
        trainer.latest().training_mse
    );
}

/// Targets that are noise determine few weights; targets that a network of this size makes determine most.
#[test]
fn bayesian_regularisation_tells_noise_from_structure() {
    let shape = Shape {
        inputs: 2,
        hidden: 6,
        outputs: 1,
    };
    let inputs = Array2::from_shape_fn((200, 2), |(row, column)| wave(row, column));
    let effective = |targets: Array2<f64>| {
        let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| wave(index, 5)).collect());
        let settings = TrainingSettings {
            method: named("br"),
            stopping: StoppingRules {
                epochs: 200,
                ..StoppingRules::default()
            },
        };
        let mut trainer = Trainer::new(start, alone(Examples::new(inputs.view(), targets.view())), settings)
            .expect("it can be trained");
        while trainer.step().is_none() {}
        trainer.latest().effective_parameters.expect("it is estimated")
    };
    let structure = effective(Array2::from_shape_fn((200, 1), |(row, _)| {
        (3.0 * inputs[[row, 0]]).sin() * inputs[[row, 1]]
    }));
    let noise = effective(Array2::from_shape_fn((200, 1), |(row, _)| wave(7 * row + 1, 911)));
    assert!(structure > 15.0 && structure <= 25.0, "{structure}");
    assert!(noise < 10.0, "{noise}");
}

#[test]
fn a_network_too_wide_for_the_normal_equations_is_refused_with_a_way_out() {
    let shape = Shape {
        inputs: 96,
        hidden: 512,
        outputs: 1,
    };
    let zeros = |columns| Array2::<f64>::zeros((5, columns));
    let train = |name: &str| {
        let examples = Examples::new(zeros(96).view(), zeros(1).view());
        let settings = TrainingSettings {
            method: named(name),
            stopping: StoppingRules::default(),
        };
        Trainer::new(Mlp::zeros(shape), alone(examples), settings)
    };
    let refusal = train("br").err().expect("20 GB are refused").to_string();
    assert!(refusal.contains("scg"), "{refusal}");
    assert!(train("scg").is_ok());
    assert!(train("lm").is_ok());
}

#[test]
fn extremes_end_with_a_reason_and_without_nan() {
    let constant = |value: f64, samples: usize| {
        let targets = Array2::from_shape_fn((samples, 2), |(row, output)| wave(row, output));
        Examples::new(Array2::from_elem((samples, 3), value).view(), targets.view())
    };
    let usual = Array2::from_shape_fn((30, 3), |(row, column)| wave(row, column));
    let targets = Array2::from_shape_fn((30, 2), |(row, output)| wave(row, output + 5));
    // (what, examples, factor on the start's weights)
    let table = [
        ("one sample", constant(0.3, 1), 1.0),
        ("constant inputs", constant(0.3, 30), 1.0),
        ("inputs all zero", constant(0.0, 30), 1.0),
        ("saturated nodes", Examples::new(usual.view(), targets.view()), 1e3),
        ("dead network", Examples::new(usual.view(), targets.view()), 0.0),
        ("absurd weights", Examples::new(usual.view(), targets.view()), 1e100),
        (
            "tiny targets",
            Examples::new(usual.view(), (&targets * 1e-150).view()),
            1.0,
        ),
        (
            "huge targets",
            Examples::new(usual.view(), (&targets * 1e60).view()),
            1.0,
        ),
    ];
    for (what, examples, scale) in table {
        for method in Method::all() {
            for first in [None, Some(1e-300), Some(1e12), Some(1e300)] {
                let mut method = method;
                let mut settings = method.settings();
                let setting = &mut settings[0];
                let value = first.map_or(setting.default, |value| {
                    f64::clamp(value, *setting.range.start(), *setting.range.end())
                });
                *setting.value = value;
                // A first value above its own limit is refused.
                for limit in settings
                    .iter_mut()
                    .filter(|limit| ["largest mu", "largest step length"].contains(&limit.name))
                {
                    *limit.value = limit.value.max(value);
                }
                let weights = start().weights().iter().map(|weight| scale * weight).collect();
                let start = Mlp::from_weights(start().shape(), weights);
                let stopping = StoppingRules {
                    epochs: 60,
                    ..StoppingRules::default()
                };
                let mut trainer = Trainer::new(start, alone(examples.clone()), TrainingSettings { method, stopping })
                    .expect("it can be tried");
                while trainer.step().is_none() {}
                let case = format!("{what}, {method}, first setting {first:?}: {:?}", trainer.stop_reason());
                assert_ne!(trainer.stop_reason(), Some(StopReason::Stopped), "{case}");
                for epoch in trainer.history() {
                    let numbers = [epoch.training_mse, epoch.gradient_norm, epoch.parameter];
                    assert!(numbers.iter().all(|number| number.is_finite()), "{case}: {epoch:?}");
                }
                assert!(
                    trainer.best().weights().iter().all(|weight| weight.is_finite()),
                    "{case}"
                );
            }
        }
    }
}
