use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::*;
use crate::{
    network::nguyen_widrow,
    training::{Method, Problem, StoppingRules, Trainer, TrainingSettings},
};

/// Weights that the data determine after 60 epochs on a curve with noise that follows an autoregression.
fn effective_parameters(memory: f64, correlation_epoch: f64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let inputs = Array2::from_shape_fn((300, 1), |(sample, _)| (sample as f64 / 150.0) - 1.0);
    let mut noise = 0.0;
    let targets = inputs.mapv(|x: f64| {
        noise = memory * noise + (1.0_f64 - memory * memory).sqrt() * rng.random_range(-0.5..0.5);
        (3.0 * x).sin() + noise
    });
    let shape = Shape {
        inputs: 1,
        hidden: 10,
        outputs: 1,
    };
    let problem = Problem {
        training: Examples::new(inputs.view(), targets.view()),
        validation: None,
        test: None,
    };
    let settings = TrainingSettings {
        method: Method::BayesianRegularization(RegularizationSettings {
            correlation_epoch,
            ..RegularizationSettings::default()
        }),
        stopping: StoppingRules {
            epochs: 60,
            ..StoppingRules::default()
        },
    };
    let mut trainer = Trainer::new(nguyen_widrow(shape, &mut rng), problem, settings).unwrap();
    while trainer.step().is_none() {}
    trainer.latest().effective_parameters.unwrap()
}

#[test]
fn correlated_errors_determine_fewer_weights_once_that_is_measured() {
    let (never, measured) = (effective_parameters(0.9, 0.0), effective_parameters(0.9, 20.0));
    assert!(measured < 0.9 * never, "{measured} {never}");
    let (never, measured) = (effective_parameters(0.0, 0.0), effective_parameters(0.0, 20.0));
    assert!((measured / never - 1.0).abs() < 0.15, "{measured} {never}");
}

/// The training error is least where the weights fit the noise; the regularised error falls on.
#[test]
fn where_nothing_is_held_out_the_latest_weights_are_the_best() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let inputs = Array2::from_shape_fn((20, 3), |_| rng.random_range(-1.0..1.0));
    let targets = Array2::from_shape_fn((20, 2), |_| rng.random_range(-0.3..0.9));
    let shape = Shape {
        inputs: 3,
        hidden: 6,
        outputs: 2,
    };
    for groups in [1.0, 2.0, 3.0, 4.0] {
        let settings = TrainingSettings {
            method: Method::BayesianRegularization(RegularizationSettings {
                groups,
                ..RegularizationSettings::default()
            }),
            stopping: StoppingRules {
                epochs: 100,
                ..StoppingRules::default()
            },
        };
        let problem = Problem {
            training: Examples::new(inputs.view(), targets.view()),
            validation: None,
            test: None,
        };
        let start = nguyen_widrow(shape, &mut ChaCha8Rng::seed_from_u64(1));
        let mut trainer = Trainer::new(start, problem, settings).unwrap();
        while trainer.step().is_none() {}
        assert_eq!(trainer.best().weights(), trainer.present().weights(), "{groups}");
    }
}
