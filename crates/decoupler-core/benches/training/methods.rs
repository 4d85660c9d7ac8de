//! Accuracy of each method on the paper's main experiment, with the same sets, split and start for all.

use std::time::Duration;

use decoupler_core::{
    dataset::Seed,
    evaluation::{Run, RunSettings},
    training::{Method, StopReason, StoppingRules, TrainingSettings},
};

use crate::timing::median;

const SEEDS: [u64; 5] = [0, 1, 2, 3, 4];
/// Time limit of each method: several times what Levenberg-Marquardt needs.
const MAX_TIME: Duration = Duration::from_secs(5);

/// Result of a training.
struct Outcome {
    epochs: f64,
    seconds: f64,
    z_percent: f64,
    x_percent: f64,
    timed_out: bool,
}

fn train(method: Method, seed: u64) -> Outcome {
    let settings = RunSettings {
        training: TrainingSettings {
            method,
            stopping: StoppingRules {
                epochs: StoppingRules::MAX_EPOCHS,
                ..StoppingRules::default()
            },
        },
        seed: Seed(seed),
        ..RunSettings::default()
    };
    let mut run = Run::prepare(settings).expect("the paper's experiment is possible");
    while run.step().is_none() {
        if run.leader().elapsed() >= MAX_TIME {
            run.stop();
        }
    }
    let errors = *run.errors().nodes().expect("the run is simulated");
    Outcome {
        epochs: run.leader().latest().epoch as f64,
        seconds: run.leader().elapsed().as_secs_f64(),
        z_percent: errors.z_percent.expect("z is never 0"),
        x_percent: errors.x_percent.expect("x is never 0"),
        timed_out: run.stop_reason() == Some(StopReason::Stopped),
    }
}

pub(crate) fn print() {
    println!("\n## Methods: 10×10_5×30, 12 hidden nodes, 1000 samples, 200 for validation, 100 for testing\n");
    println!(
        "Same samples, split and start for all; medians of {} seeds. Each stops by its own rules (the validation error",
        SEEDS.len()
    );
    println!(
        "reached no new best for 6 epochs, the gradient vanished, mu grew too large) or after {} seconds.\n",
        MAX_TIME.as_secs()
    );
    println!("| method | epochs | seconds | Z % | X % | timed out |\n|---|---:|---:|---:|---:|---:|");
    for method in Method::all() {
        let outcomes = SEEDS.map(|seed| train(method, seed));
        let of = |value: fn(&Outcome) -> f64| median(&mut outcomes.iter().map(value).collect::<Vec<_>>());
        let timed_out = outcomes.iter().filter(|outcome| outcome.timed_out).count();
        println!(
            "| {method} | {:.0} | {:.2} | {:.2} | {:.2} | {timed_out} of {} |",
            of(|outcome| outcome.epochs),
            of(|outcome| outcome.seconds),
            of(|outcome| outcome.z_percent),
            of(|outcome| outcome.x_percent),
            SEEDS.len()
        );
    }
}
