//! How an epoch's time grows, per method, on one thread and on all.

use decoupler::{
    network::{Mlp, Shape},
    training::{Examples, Method, Problem, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;
use rayon::ThreadPoolBuilder;

use crate::timing::{median, time_ms};

/// Median milliseconds of an epoch.
fn epoch_ms(method: Method, shape: Shape, samples: usize, threads: usize, epochs: usize) -> f64 {
    let wave = |row: usize, column: usize| {
        (1.0 + 12.9898 * row as f64 + 78.233 * column as f64 + 0.71 * (row * column) as f64).sin()
    };
    let columns = |count, first| Array2::from_shape_fn((samples, count), |(row, column)| wave(row, first + column));
    let problem = Problem {
        training: Examples::new(columns(shape.inputs, 0).view(), columns(shape.outputs, 200).view()),
        validation: None,
        test: None,
    };
    let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 1)).collect());
    let settings = TrainingSettings {
        method,
        stopping: StoppingRules::default(),
    };
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads can be had");
    pool.install(|| {
        let mut trainer = Trainer::new(start, problem, settings).expect("it can be trained");
        median(&mut (0..epochs).map(|_| time_ms(|| trainer.step())).collect::<Vec<_>>())
    })
}

/// The exponent of the power law through some points, by least squares on logarithms.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let logs = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (mean_x, mean_y) = (
        logs().map(|(x, _)| x).sum::<f64>() / count,
        logs().map(|(_, y)| y).sum::<f64>() / count,
    );
    let (above, below) = logs().fold((0.0, 0.0), |(above, below), (x, y)| {
        (above + (x - mean_x) * (y - mean_y), below + (x - mean_x).powi(2))
    });
    above / below
}

pub(crate) fn print() {
    let array = |nodes: usize, hidden| Shape {
        inputs: 3 * nodes,
        hidden,
        outputs: 2 * nodes,
    };
    println!("\n## Epochs, milliseconds, one thread\n");
    println!("| method | 10×6 | 10×8 | 10×10 | 10×10, 100 samples | 10×10, 10 000 | exponent of samples |");
    println!("|---|---:|---:|---:|---:|---:|---:|");
    for method in Method::all() {
        let of = |nodes, samples| epoch_ms(method, array(nodes, 12), samples, 1, 15);
        let [six, eight, ten, few, many] = [of(6, 1000), of(8, 1000), of(10, 1000), of(10, 100), of(10, 10_000)];
        let grown = exponent(&[(1000.0, ten), (10_000.0, many)]);
        println!("| {method} | {six:.2} | {eight:.2} | {ten:.2} | {few:.2} | {many:.1} | {grown:.2} |");
    }
    let lm = Method::default();
    println!("\n## Levenberg-Marquardt at its limits, milliseconds\n");
    println!("| | 1 thread | 2 threads |\n|---|---:|---:|");
    for (what, shape, samples, epochs) in [
        ("10×10, 12 hidden, 1000 samples", array(10, 12), 1000, 15),
        ("10×10, 64 hidden, 1000 samples", array(10, 64), 1000, 5),
        ("10×10, 12 hidden, 100 000 samples", array(10, 12), 100_000, 5),
        ("10×32, 64 hidden, 2000 samples", array(32, 64), 2000, 3),
    ] {
        let [one, two] = [1, 2].map(|threads| epoch_ms(lm, shape, samples, threads, epochs));
        println!("| {what} | {one:.1} | {two:.1} |");
    }
    let by_samples =
        [1000, 10_000, 100_000].map(|samples| (samples as f64, epoch_ms(lm, array(10, 12), samples, 1, 5)));
    let by_hidden = [6, 12, 24, 48].map(|hidden| (hidden as f64, epoch_ms(lm, array(10, hidden), 1000, 1, 5)));
    let by_nodes = [6, 10, 16, 32].map(|nodes| (nodes as f64, epoch_ms(lm, array(nodes, 12), 1000, 1, 5)));
    println!(
        "\nExponents: samples {:.2}, hidden nodes {:.2}, nodes of a row {:.2}.",
        exponent(&by_samples),
        exponent(&by_hidden),
        exponent(&by_nodes)
    );
}
