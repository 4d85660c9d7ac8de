//! Time per epoch of Levenberg-Marquardt relative to its largest matrix product.

use std::hint::black_box;

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Run, RunSettings},
    training::{StoppingRules, TrainingSettings},
};
use faer::{Accum, Mat, Par, linalg::matmul::matmul};

use crate::timing::{median, time_ms};

const TURNS: usize = 300;

pub(crate) fn print() {
    // The paper's main experiment: 30 resistances, 12 hidden nodes, 1000 samples.
    let stopping = StoppingRules {
        epochs: StoppingRules::MAX_EPOCHS,
        ..StoppingRules::default()
    };
    let settings = RunSettings {
        source: Simulation {
            validation_samples: 0,
            ..Simulation::default()
        }
        .into(),
        training: TrainingSettings {
            stopping,
            ..TrainingSettings::default()
        },
        ..RunSettings::default()
    };
    let mut run = Run::prepare(settings).expect("the paper's experiment is possible");
    let (slopes, inputs) = (Mat::from_fn(1000, 78, wave), Mat::from_fn(1000, 496, wave));
    let mut gram = Mat::<f64>::zeros(496, 78);
    let (mut epochs, mut products) = ([const { Vec::new() }; 3], Vec::new());
    for _ in 0..TURNS {
        let mu = run.leader().latest().parameter;
        let epoch_ms = time_ms(|| run.step());
        // One factor mu_dec at the accepted step, one factor mu_inc at each rejected one.
        let rejected = ((run.leader().latest().parameter / mu).log10() + 1.0).round() as usize;
        if let Some(epochs) = epochs.get_mut(rejected) {
            epochs.push(epoch_ms);
        }
        products.push(time_ms(|| {
            matmul(
                black_box(&mut gram),
                Accum::Replace,
                inputs.transpose(),
                &slopes,
                1.0,
                Par::Seq,
            );
        }));
    }
    let product_ms = median(&mut products);
    println!("## Levenberg-Marquardt epoch, 30-12-20, 1000 samples, one thread\n");
    println!("| | median ms | ratio | of |\n|---|---:|---:|---:|");
    println!("| GEMM 78×1000×496 | {product_ms:.3} | 1.00 | {TURNS} |");
    for (rejected, epochs) in epochs.iter_mut().enumerate().filter(|(_, epochs)| !epochs.is_empty()) {
        let (count, epoch_ms) = (epochs.len(), median(epochs));
        let ratio = epoch_ms / product_ms;
        println!("| epoch with {rejected} rejected steps | {epoch_ms:.3} | {ratio:.2} | {count} |");
    }
}

/// Numbers without zeros or repetition.
fn wave(row: usize, column: usize) -> f64 {
    (row as f64 * 0.37 + column as f64 * 0.73).sin()
}
