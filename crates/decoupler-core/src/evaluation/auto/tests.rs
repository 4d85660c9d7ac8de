use ndarray::Array2;
use rand::RngExt as _;

use super::*;
use crate::{
    dataset::{Seed, SplitBy, Stream},
    evaluation::{Combination, Run, RunError, RunSets},
    job::Job,
    machine::MemoryBudget,
    scene::RowModel,
    training::Method,
};

const BUDGET_S: f64 = 0.4;

/// Targets that wander, and readings of a rubber that creeps: half of each reading is an average over 15 samples.
fn creeping(samples: usize) -> (Array2<f64>, Array2<f64>) {
    let target = |sample: usize| {
        let t = sample as f64;
        (0.11 * t).sin() + 0.7 * (0.043 * t + 1.0).sin() + 0.4 * (0.29 * t).cos()
    };
    let mut average = target(0);
    let readings = Array2::from_shape_fn((samples, 2), |(sample, channel)| {
        if channel == 0 {
            average += (target(sample) - average) / 15.0;
        }
        let mixed = 0.5 * target(sample) + 0.5 * average;
        if channel == 0 { mixed } else { (0.8 * mixed).tanh() }
    });
    let targets = Array2::from_shape_fn((samples, 1), |(sample, _)| target(sample));
    (readings, targets)
}

fn choose(by: SplitBy, groups: Vec<usize>, fixed: &AutoFixed, job: &Job<'_>) -> Result<AutoChoice, RunError> {
    let (readings, targets) = creeping(groups.len());
    let set = Dataset::new(readings.clone(), targets, None, groups).unwrap();
    let samples: Vec<usize> = (0..set.samples()).collect();
    let history = History::new(readings, None, None, None, samples.clone());
    let samples = AutoSamples {
        set: &set,
        past: Some((&history, &samples)),
        by,
    };
    let base = RunSettings::measured(RowModel::Shared);
    choose_settings(
        &base,
        fixed,
        &samples,
        BUDGET_S,
        MemoryBudget::UNLIMITED,
        job,
        &mut |_| (),
    )
}

fn in_time() -> Result<AutoChoice, RunError> {
    choose(
        SplitBy::Time,
        (0..400).collect(),
        &AutoFixed::default(),
        &Job::UNINTERRUPTED,
    )
}

#[test]
fn a_sensor_that_creeps_gets_a_memory() {
    let choice = in_time().unwrap();
    assert!(!choice.memory.is_empty(), "{:?}", choice.record);
    let error = choice.record.choice().unwrap().error;
    let without = choice.record.tried.iter().filter(|tried| tried.memory.is_empty());
    let without = without.map(|tried| tried.error).fold(f64::INFINITY, f64::min);
    assert!(error < 0.5 * without, "{error} {without}");
    assert_eq!(choice.settings.combine, Combination::Mean);
    assert!(choice.settings.starts > 1);
}

#[test]
fn the_same_seed_gives_the_same_choice_and_the_budget_is_kept() {
    let (one, other) = (in_time().unwrap(), in_time().unwrap());
    assert_eq!(one.record, other.record);
    assert_eq!((one.settings, &one.answers), (other.settings, &other.answers));
    // A candidate runs at least a few epochs.
    assert!(one.record.seconds() < 1.5 * BUDGET_S, "{}", one.record.seconds());
}

#[test]
fn held_out_answers_have_the_error_of_the_choice() {
    let choice = in_time().unwrap();
    let (_, targets) = creeping(400);
    let mean = targets.mean().unwrap();
    let spread = targets.mapv(|target| (target - mean).powi(2)).sum();
    let square = (&choice.answers - &targets).mapv(|error| error * error).sum();
    let error = choice.record.choice().unwrap().error;
    assert!(((square / spread).sqrt() / error - 1.0).abs() < 1e-9);
}

#[test]
fn given_settings_are_kept_and_groups_are_not_divided() {
    let fixed = AutoFixed {
        hidden: Some(3),
        starts: Some(2),
        epochs: Some(7),
        memory: Some(Memory::default()),
        ..AutoFixed::default()
    };
    let groups: Vec<usize> = (0..300).map(|sample| sample / 50).collect();
    let choice = choose(SplitBy::Group, groups.clone(), &fixed, &Job::UNINTERRUPTED).unwrap();
    let settings = choice.settings;
    assert_eq!(
        (settings.hidden, settings.starts, settings.training.stopping.epochs),
        (3, 2, 7)
    );
    assert!(choice.memory.is_empty());
    let (readings, targets) = creeping(300);
    let set = Dataset::new(readings, targets, None, groups.clone()).unwrap();
    let samples = AutoSamples {
        set: &set,
        past: None,
        by: SplitBy::Group,
    };
    let folds = search::folds(&samples, settings.seed).unwrap();
    assert_eq!(folds.count(), choice.record.folds);
    for fold in 0..folds.count() {
        let of_fold = folds.test(fold);
        let others = folds.without(&[fold]);
        assert!(
            of_fold
                .iter()
                .all(|&one| others.iter().all(|&other| groups[one] != groups[other]))
        );
    }
}

#[test]
fn a_cancelled_search_has_no_result() {
    let cancelled = choose(
        SplitBy::Time,
        (0..200).collect(),
        &AutoFixed::default(),
        &Job::new(&|| true),
    );
    assert!(matches!(cancelled, Err(RunError::Cancelled(_))));
}

/// Training stops at the chosen epoch and begins with the ridge regression that the search began with.
#[test]
fn the_choice_trains_to_about_its_error() {
    let choice = in_time().unwrap();
    let (readings, targets) = creeping(600);
    let history = History::new(readings.clone(), None, None, None, (0..600).collect());
    let features = history.features(&choice.memory).unwrap();
    let all = Dataset::new(features, targets.clone(), None, (0..600).collect()).unwrap();
    let part = |samples: std::ops::Range<usize>| all.select(&samples.collect::<Vec<_>>());
    let split = crate::dataset::Split {
        training: part(0..400),
        validation: None,
    };
    let mut run = Run::with_baselines(
        choice.settings,
        RunSets::new(split, part(400..600)),
        None,
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    while run.step().is_none() {}
    let mut square = 0.0;
    for (answer, target) in run.decouple_test().iter().zip(targets.iter().skip(400)) {
        square += (answer - target).powi(2);
    }
    let spread = targets.iter().skip(400).map(|target| target * target).sum::<f64>();
    let (error, expected) = ((square / spread).sqrt(), choice.record.choice().unwrap().error);
    assert!(error < 4.0 * expected, "{error} {expected}");
}

/// Potentials at 40 places on a soft sheet that is pressed somewhere, with noise: 100 samples are fewer than the weights of
/// four hidden nodes.
#[test]
fn many_inputs_for_few_samples_get_weight_decay() {
    let mut rng = Seed(3).rng(Stream::Folds);
    let places = Array2::from_shape_simple_fn((40, 2), || rng.random_range(-1.0..1.0));
    let targets = Array2::from_shape_simple_fn((100, 2), || rng.random_range(-1.0..1.0));
    let readings = Array2::from_shape_fn((100, 40), |(sample, channel)| {
        let square: f64 = (&targets.row(sample) - &places.row(channel)).mapv(|d| d * d).sum();
        1.0 / (1.0 + 4.0 * square) + rng.random_range(-0.03..0.03)
    });
    let set = Dataset::new(readings, targets, None, (0..100).collect()).unwrap();
    let samples = AutoSamples {
        set: &set,
        past: None,
        by: SplitBy::Random,
    };
    let base = RunSettings::measured(RowModel::Shared);
    let choice = choose_settings(
        &base,
        &AutoFixed::default(),
        &samples,
        4.0,
        MemoryBudget::UNLIMITED,
        &Job::UNINTERRUPTED,
        &mut |_| (),
    )
    .unwrap();
    let Method::ScaledConjugateGradient { decay, .. } = choice.settings.training.method else {
        panic!("{:?}", choice.record);
    };
    assert!(decay > 0.0);
    let ridge = choice
        .record
        .tried
        .iter()
        .filter(|tried| tried.model == TriedModel::Ridge);
    let ridge = ridge.map(|tried| tried.error).fold(f64::INFINITY, f64::min);
    let error = choice.record.choice().unwrap().error;
    assert!(error < 0.8 * ridge, "{error} {ridge}");
}
