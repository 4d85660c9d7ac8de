//! Every method reproduces the iterates of an independent program from the same start
//! (tests/fixtures/training_traces.py).

use std::collections::BTreeMap;

use decoupler_core::{
    network::{Mlp, Shape},
    settings::Value,
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;
use serde::Deserialize;

#[derive(Deserialize)]
struct Traces {
    hidden: usize,
    inputs: Vec<Vec<f64>>,
    targets: Vec<Vec<f64>>,
    start: Vec<f64>,
    weights_by_epoch: BTreeMap<String, Vec<Vec<f64>>>,
    effective_parameters: Vec<f64>,
    rejecting: BTreeMap<String, Rejecting>,
}

/// A trace in which some steps are rejected.
#[derive(Deserialize)]
struct Rejecting {
    first_setting: f64,
    start: Vec<f64>,
    weights: Vec<Vec<f64>>,
    rejected: Vec<bool>,
}

fn traces() -> Traces {
    serde_json::from_str(include_str!("../fixtures/training_traces.json")).expect("the fixture is valid")
}

impl Traces {
    fn trainer(&self, method: Method, start: &[f64]) -> Trainer {
        let array =
            |rows: &[Vec<f64>]| Array2::from_shape_fn((rows.len(), rows[0].len()), |(row, column)| rows[row][column]);
        let training = Examples::new(array(&self.inputs).view(), array(&self.targets).view());
        let shape = Shape {
            inputs: training.inputs(),
            hidden: self.hidden,
            outputs: training.outputs(),
        };
        let problem = ExampleSets {
            training,
            validation: None,
            test: None,
        };
        let settings = TrainingSettings {
            method,
            stopping: StoppingRules::default(),
        };
        Trainer::new(Mlp::from_weights(shape, start.to_vec()), problem, settings).expect("it can be trained")
    }
}

/// Changes the first setting of the method.
fn set_first(method: &mut Method, value: f64) {
    let setting = method.settings().next().unwrap();
    setting.set(method, &Value::Number(value)).unwrap();
}

/// The fixture's learning rate, if it differs from the default.
fn with_the_fixtures_settings(mut method: Method) -> Method {
    if ["gd", "gdms", "gdx"].contains(&method.short_name()) {
        set_first(&mut method, 0.1);
    }
    method
}

/// Maximum relative difference from the fixture's weights: rounding, amplified if the problem is stiff or if two gradients 5e-5 apart are subtracted (`scg`).
fn tolerance(method: &str) -> f64 {
    match method {
        "scg" => 1e-5,
        "lm" | "br" => 1e-7,
        _ => 1e-12,
    }
}

/// The largest difference between two lists of weights, relative to the largest weight.
fn apart(ours: &[f64], expected: &[f64]) -> f64 {
    let largest = expected
        .iter()
        .fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
    let pairs = ours.iter().zip(expected);
    pairs.map(|(ours, theirs)| (ours - theirs).abs()).fold(0.0, f64::max) / largest
}

#[test]
fn iterates_agree_with_independent_programs() {
    let traces = traces();
    for method in Method::all() {
        let name = method.short_name();
        // Eq. (11) is specific to the paper: no package implements it, and a separate test checks its formula.
        let Some(expected) = traces.weights_by_epoch.get(name) else {
            assert_eq!(name, "gdm");
            continue;
        };
        let mut trainer = traces.trainer(with_the_fixtures_settings(method), &traces.start);
        for (epoch, expected) in (1..).zip(expected) {
            assert_eq!(trainer.step(), None, "{name}, epoch {epoch}");
            let apart = apart(trainer.present().weights(), expected);
            assert!(apart <= tolerance(name), "{name}, epoch {epoch}: {apart:e}");
        }
    }
}

/// The steps that the independent program rejects are rejected, and the steps after them agree.
#[test]
fn iterates_with_rejected_steps_agree_with_independent_programs() {
    let traces = traces();
    assert_eq!(traces.rejecting.len(), 2);
    for (name, case) in &traces.rejecting {
        let method = Method::all().into_iter().find(|method| method.short_name() == name);
        let mut method = method.expect("it is offered");
        set_first(&mut method, case.first_setting);
        let mut trainer = traces.trainer(method, &case.start);
        assert!(case.rejected.contains(&true), "{name}");
        for (epoch, (expected, rejected)) in (1..).zip(case.weights.iter().zip(&case.rejected)) {
            let before = trainer.present().clone();
            assert_eq!(trainer.step(), None, "{name}, epoch {epoch}");
            assert_eq!(trainer.present() == &before, *rejected, "{name}, epoch {epoch}");
            let apart = apart(trainer.present().weights(), expected);
            assert!(apart <= tolerance(name), "{name}, epoch {epoch}: {apart:e}");
        }
    }
}

#[test]
fn the_effective_number_of_parameters_matches_the_dense_hessian() {
    let traces = traces();
    let bayesian = Method::all().into_iter().find(|method| method.short_name() == "br");
    let mut trainer = traces.trainer(bayesian.expect("it is offered"), &traces.start);
    for expected in &traces.effective_parameters {
        trainer.step();
        let ours = trainer.latest().effective_parameters.expect("it is estimated");
        assert!((ours - expected).abs() < 1e-6, "{ours} {expected}");
    }
}
