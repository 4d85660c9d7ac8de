//! Trains on measured pairs of readings and targets, without any model of the sensor, and cross-validates by group:
//! `cargo run --release --example measured`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::error::Error;

use decoupler_core::{
    dataset::{Dataset, Seed, SplitBy, Stream},
    evaluation::{CrossValidation, Run, RunSets, RunSettings},
    job::Job,
    ndarray::Array2,
    scene::RowModel,
};

fn main() -> Result<(), Box<dyn Error>> {
    // In place of a recording: 600 moments, 3 readings of any unit, the position of a probe and its force.
    let probe = |sample: usize| ((0.37 * sample as f64).sin(), (0.011 * sample as f64).cos());
    let readings = Array2::from_shape_fn((600, 3), |(sample, channel)| {
        let (x, force) = probe(sample);
        force * (-(x - channel as f64 + 1.0).powi(2)).exp()
    });
    let targets = Array2::from_shape_fn((600, 2), |(s, target)| [probe(s).0, probe(s).1][target]);
    // Moments of one press form a group of 20.
    let set = Dataset::new(readings, targets, None, (0..600).map(|sample| sample / 20).collect())?;
    let settings = RunSettings::measured(RowModel::Shared);
    let folds = CrossValidation {
        folds: 5,
        repeats: 1,
        by: SplitBy::Group,
    };
    let validated = folds.run(&settings, (&set, &set), 0, &Job::UNINTERRUPTED)?;
    let scores = validated.scores(&set);
    let rows = [
        ("training mean", scores.baselines.mean),
        ("ridge", scores.baselines.linear),
        ("network", scores.network),
    ];
    for (name, errors) in rows {
        let errors = errors.targets().iter().map(|target| format!("{:.4}", target.rmse));
        println!("{name:<14} RMSE {}", Vec::from_iter(errors).join("  "));
    }
    let test = set.select(&Vec::from_iter(500..600));
    let training = set.select(&Vec::from_iter(0..500));
    let split = SplitBy::Group.hold_out(&training, 5, &mut Seed(0).rng(Stream::Split));
    let mut run = Run::with_baselines(settings, RunSets::new(split, test), None, &Job::UNINTERRUPTED)?;
    while run.step().is_none() {}
    println!("one network, last 100 moments: R² {:?}", run.errors().targets()[0].r2);
    Ok(())
}
