//! What every method must do: follow the slopes of the error, reach a low error, and give the same bits on any number of
//! threads and after being interrupted. That its iterates are right is tested in `traces`.

use decoupler_core::{
    network::{Mlp, Shape},
    settings::Value,
    training::{
        ExampleSets, Examples, Method, RegularizationSettings, StoppingRules, Trainer, TrainerState, TrainingSettings,
    },
};
use ndarray::{Array2, Axis};

use crate::problems::{start, trainer, training, wave};

/// The method of this short name with a setting of its own.
fn with(short_name: &str, name: &str, value: f64) -> Method {
    let mut method = Method::named(short_name).expect("it is offered");
    let setting = method.settings().find(|setting| setting.name == name);
    let setting = setting.expect("the method has it");
    setting.set(&mut method, &Value::Number(value)).expect("it is a number");
    method
}

/// Every method with its defaults, and with the settings that change its equations.
fn methods() -> Vec<Method> {
    let further = [
        Method::BayesianRegularization(RegularizationSettings::recorded()),
        with("br", "groups of weights", 2.0),
        with("scg", "weight decay", 0.3),
    ];
    Method::all().into_iter().chain(further).collect()
}

/// Central differences of the mean squared error that the network itself has on the small problem.
fn slopes(mlp: &Mlp) -> Vec<f64> {
    let (inputs, targets) = training();
    let mse = |index: usize, by: f64| {
        let mut weights = mlp.weights().to_vec();
        weights[index] += by;
        let errors = Mlp::from_weights(mlp.shape(), weights).forward(inputs.view()) - &targets;
        errors.mapv(|error| error * error).mean().expect("there are samples")
    };
    let slope = |index| (mse(index, 1e-5) - mse(index, -1e-5)) / 2e-5;
    (0..mlp.weights().len()).map(slope).collect()
}

/// Regularised methods record the slope of their own objective.
#[test]
fn the_recorded_gradient_agrees_with_central_differences() {
    let expected = slopes(&start()).iter().map(|slope| slope * slope).sum::<f64>().sqrt();
    for method in Method::all() {
        let trainer = trainer(method);
        let found = trainer.latest().gradient_norm;
        if method.needs_validation() {
            assert!((found / expected - 1.0).abs() < 1e-7, "{method}: {found} {expected}");
        }
    }
}

/// A step of conventional back-propagation is the learning rate times the negative gradient, weight by weight.
#[test]
fn the_gradient_agrees_with_central_differences_of_every_weight() {
    let mut trainer = trainer(with("gd", "learning rate", 0.5));
    trainer.step();
    let steps = trainer.present().weights().iter().zip(start().weights().to_vec());
    for ((now, before), slope) in steps.zip(slopes(&start())) {
        let found = (before - now) / 0.5;
        assert!((found - slope).abs() < 1e-8, "{found} {slope}");
    }
}

#[test]
fn the_order_of_the_samples_does_not_matter() {
    let (inputs, targets) = training();
    let backwards = Vec::from_iter((0..inputs.nrows()).rev());
    for method in Method::all() {
        let [(weights, mse), (others, other_mse)] = [false, true].map(|is_reversed| {
            let mut problem = crate::problems::problem();
            if is_reversed {
                let [inputs, targets] = [&inputs, &targets].map(|values| values.select(Axis(0), &backwards));
                problem.training = Examples::new(inputs.view(), targets.view());
            }
            let stopping = StoppingRules::default();
            let mut trainer = Trainer::new(start(), problem, TrainingSettings { method, stopping }).unwrap();
            trainer.step();
            (trainer.present().weights().to_vec(), trainer.latest().training_mse)
        });
        assert!((mse - other_mse).abs() < 1e-9 * mse, "{method}: {mse} and {other_mse}");
        let off = weights
            .iter()
            .zip(&others)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-7, "{method}: {off:e}");
    }
}

#[test]
fn every_method_learns_two_smooth_functions() {
    // (method, epochs, training error to reach from 1.5)
    let table = [
        ("lm", 60, 1e-4),
        ("br", 100, 1e-3),
        ("scg", 500, 2e-3),
        ("rp", 500, 1e-2),
        ("gdx", 1000, 3e-2),
        ("gdms", 1000, 0.15),
        ("gdm", 1000, 0.15),
        ("gd", 1000, 0.15),
    ];
    assert_eq!(
        table.map(|(name, ..)| name),
        Method::all().map(|method| method.short_name())
    );
    for (name, epochs, goal) in table {
        let mut trainer = trainer(Method::named(name).expect("it is offered"));
        for _ in 0..epochs {
            trainer.step();
        }
        let errors = trainer.history().iter().map(|epoch| epoch.training_mse);
        let reached = errors.fold(f64::INFINITY, f64::min);
        assert!(reached < goal, "{name} reached {reached:e}");
    }
}

/// A problem that is large enough to be divided among threads.
fn large(method: Method, samples: usize) -> (Mlp, ExampleSets, TrainingSettings) {
    let shape = Shape {
        inputs: 40,
        hidden: 34,
        outputs: 5,
    };
    let columns = |count, first| Array2::from_shape_fn((samples, count), |(row, column)| wave(row, first + column));
    let (inputs, targets) = (columns(shape.inputs, 0), columns(shape.outputs, 100));
    let problem = ExampleSets {
        training: Examples::new(inputs.view(), targets.view()),
        validation: None,
        test: None,
    };
    let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 9)).collect());
    let settings = TrainingSettings {
        method,
        stopping: StoppingRules::default(),
    };
    (start, problem, settings)
}

/// With few samples for this many weights conjugate gradients are faster, with many the factorised equations.
#[test]
fn one_and_four_threads_are_bit_identical() {
    for method in methods() {
        for samples in [2100, 7000] {
            let train = |threads: usize| {
                let (start, problem, settings) = large(method, samples);
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                pool.expect("the thread pool can be built").install(|| {
                    let mut trainer = Trainer::new(start, problem, settings).expect("it can be trained");
                    trainer.step();
                    trainer.step();
                    trainer.present().clone()
                })
            };
            assert!(train(1) == train(4), "{method} with {samples} samples");
        }
    }
}

fn run(trainer: &mut Trainer, epochs: usize) {
    (0..epochs).for_each(|_| {
        trainer.step();
    });
}

fn through_a_file(trainer: &Trainer) -> TrainerState {
    let text = serde_json::to_string(&trainer.state()).expect("a state can be written");
    serde_json::from_str(&text).expect("a written state can be read")
}

#[test]
fn interrupted_trainings_are_bit_identical() {
    for method in methods() {
        let (mut whole, mut first) = (trainer(method), trainer(method));
        run(&mut whole, 20);
        run(&mut first, 10);
        let mut second =
            Trainer::resume(through_a_file(&first), crate::problems::problem()).expect("it can be resumed");
        run(&mut second, 10);
        assert_eq!(second.history(), whole.history(), "{method}");
        assert_eq!(second.history().len(), 21, "{method}");
        assert_eq!(second.best(), whole.best(), "{method}");
        assert_eq!(
            (second.best_epoch(), second.stop_reason()),
            (whole.best_epoch(), whole.stop_reason())
        );
    }
    // Equations that are not factorised.
    let (start, problem, settings) = large(Method::default(), 700);
    let mut whole = Trainer::new(start, problem.clone(), settings).expect("it can be trained");
    run(&mut whole, 2);
    let mut second = Trainer::resume(through_a_file(&whole), problem).expect("it can be resumed");
    run(&mut whole, 2);
    run(&mut second, 2);
    assert_eq!(whole.present(), second.present());
}
