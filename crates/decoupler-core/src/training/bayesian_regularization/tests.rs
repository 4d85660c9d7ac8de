use faer::linalg::solvers::Llt;
use ndarray::{Array2, ArrayView2, Axis};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::*;
use crate::{
    network::{Shape, nguyen_widrow},
    training::{ExampleSets, Method, StoppingRules, Trainer, TrainingSettings, normal_equations::tests::dense},
};

/// The training error has its minimum where the weights fit the noise; the regularised error continues to fall.
#[test]
fn without_validation_the_latest_weights_are_the_best() {
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
        let problem = ExampleSets {
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

/// Samples × 3 inputs, and targets: two smooth functions with noise of 1 %, then two constants with a jitter of the
/// size of their rounding, then white noise, each scaled to [−1, 1].
fn good_and_bad_targets(samples: usize, seed: u64) -> (Array2<f64>, Array2<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let inputs = Array2::from_shape_simple_fn((samples, 3), || rng.random_range(-1.0..1.0));
    let targets = Array2::from_shape_fn((samples, 5), |(sample, target)| {
        let (x, y, z): (f64, f64, f64) = (inputs[[sample, 0]], inputs[[sample, 1]], inputs[[sample, 2]]);
        let noise: f64 = rng.random_range(-1.0..1.0);
        match target {
            0 => 0.6 * (2.0 * x + y).sin() + 0.3 * z + 0.01 * noise,
            1 => 0.7 * (1.5 * y * z).tanh() - 0.2 * x + 0.01 * noise,
            2 | 3 => (1.5 * noise).round(),
            _ => noise,
        }
    });
    (inputs, targets)
}

fn problem(inputs: &Array2<f64>, targets: ArrayView2<'_, f64>) -> ExampleSets {
    ExampleSets {
        training: Examples::new(inputs.view(), targets),
        validation: None,
        test: None,
    }
}

fn trained(problem: ExampleSets, hidden: usize, settings: RegularizationSettings, epochs: usize) -> Trainer {
    let shape = Shape {
        inputs: problem.training.inputs(),
        hidden,
        outputs: problem.training.outputs(),
    };
    let settings = TrainingSettings {
        method: Method::BayesianRegularization(settings),
        stopping: StoppingRules {
            epochs,
            ..StoppingRules::default()
        },
    };
    let start = nguyen_widrow(shape, &mut ChaCha8Rng::seed_from_u64(1));
    let mut trainer = Trainer::new(start, problem, settings).unwrap();
    while trainer.step().is_none() {}
    trainer
}

/// Root mean square of the errors of the first two targets on samples that were not used for training.
fn error_of_good_targets(targets: usize, own_noise: f64) -> f64 {
    let (inputs, all) = good_and_bad_targets(300, 8);
    let settings = RegularizationSettings {
        own_noise,
        ..RegularizationSettings::recorded()
    };
    let trainer = trained(
        problem(&inputs, all.select(Axis(1), &Vec::from_iter(0..targets)).view()),
        8,
        settings,
        150,
    );
    let (inputs, all) = good_and_bad_targets(1000, 9);
    let good = |values: &Array2<f64>| values.select(Axis(1), &[0, 1]);
    let errors = good(&trainer.best().forward(inputs.view())) - good(&all);
    (errors.mapv(|error| error * error).mean().unwrap()).sqrt()
}

#[test]
fn targets_without_information_leave_the_others_as_they_are() {
    let alone = error_of_good_targets(2, 1.0);
    assert!(alone < 0.02, "{alone}");
    let together = error_of_good_targets(5, 1.0);
    assert!(together < 1.1 * alone, "{together} {alone}");
    let coupled = error_of_good_targets(5, 0.0);
    assert!(coupled > 2.0 * alone, "{coupled} {alone}");
}

/// Half the logarithm of the determinant of a positive definite matrix.
fn half_log_determinant(matrix: &faer::Mat<f64>) -> f64 {
    let factor = Llt::new(matrix.as_ref(), faer::Side::Lower).unwrap();
    (0..matrix.nrows()).map(|index| factor.L()[(index, index)].ln()).sum()
}

/// Compares α and each βₜ with the maximum of the evidence, whose Hessian is formed from the dense Jacobian
/// (MacKay 1992): `ln p = −Σₜ βₜ Σeₜ² − Σ αw² − ½ ln det A + ½ Σ samples ln βₜ + ½ N ln α`, with
/// A = Σₜ βₜ JₜᵀJₜ + α ρₜ at the weights of target t, and α at those of the hidden layer.
#[test]
fn noise_levels_and_decay_maximise_the_evidence() {
    let (inputs, all) = good_and_bad_targets(200, 3);
    let targets = all.select(Axis(1), &[0, 1, 4]);
    let settings = RegularizationSettings {
        own_noise: 1.0,
        ..RegularizationSettings::default()
    };
    let trainer = trained(problem(&inputs, targets.view()), 4, settings, 400);
    let MethodState::BayesianRegularization(state) = trainer.algorithm.state() else {
        panic!("another method");
    };
    let mlp = trainer.present();
    let examples = Examples::new(inputs.view(), targets.view());
    let (jacobian, errors) = (dense::jacobian(mlp, &examples), dense::errors(mlp, &examples));
    let (weights, hidden_weights, outputs) = (mlp.weights().len(), mlp.shape().hidden_weights(), 3);
    // The prior remains that of the trained precisions while a noise level is varied.
    let precision = |index: usize| {
        if index < hidden_weights {
            1.0
        } else {
            state.targets[(index - hidden_weights) % outputs].precision
        }
    };
    let evidence = |alpha: f64, betas: [f64; 3]| {
        let a = faer::Mat::from_fn(weights, weights, |row, column| {
            let products = (0..jacobian.nrows())
                .map(|error| betas[error % outputs] * jacobian[(error, row)] * jacobian[(error, column)]);
            let decay = if row == column { alpha * precision(row) } else { 0.0 };
            products.sum::<f64>() + decay
        });
        let fit: f64 = (0..errors.nrows())
            .map(|row| betas[row % outputs] * errors[(row, 0)].powi(2))
            .sum();
        let size: f64 = mlp
            .weights()
            .iter()
            .enumerate()
            .map(|(index, weight)| precision(index) * weight * weight)
            .sum();
        let logs = betas.iter().map(|beta| beta.ln()).sum::<f64>() * 200.0 + weights as f64 * alpha.ln();
        -fit - alpha * size - half_log_determinant(&a) + 0.5 * logs
    };
    let betas = [0, 1, 2].map(|target: usize| state.beta * state.targets[target].precision);
    let slope = |change: &dyn Fn(f64) -> f64| (change(1e-4) - change(-1e-4)) / 2e-4;
    let of_alpha = slope(&|step| evidence(state.alpha * (1.0 + step), betas));
    // The slope without the term of the logarithms is half the number of weights.
    assert!(of_alpha.abs() < 0.01 * weights as f64, "{of_alpha}");
    for target in 0..outputs {
        let of_beta = slope(&|step| {
            let mut betas = betas;
            betas[target] *= 1.0 + step;
            evidence(state.alpha, betas)
        });
        // γ of the hidden layer is shared out approximately.
        assert!(of_beta.abs() < 0.02 * 200.0, "{target}: {of_beta}");
    }
    let shares: f64 = state.targets.iter().map(|target| target.effective_parameters).sum();
    assert!((shares / state.effective_parameters - 1.0).abs() < 1e-9, "{shares}");
}
