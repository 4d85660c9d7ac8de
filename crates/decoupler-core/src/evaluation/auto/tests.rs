use ndarray::Array2;
use rand::RngExt as _;

use super::*;
use crate::{
    dataset::{Seed, SplitBy, Stream},
    evaluation::{Run, RunError, RunSets},
    job::Job,
    machine::MemoryBudget,
    scene::{RowModel, standard_normal},
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

/// Chooses for readings (samples × channels) and targets, at an interval of 0.1 s if they are timed.
fn choose_for(
    (readings, targets): (Array2<f64>, Array2<f64>),
    (by, groups, is_timed): (SplitBy, Vec<usize>, bool),
    fixed: &AutoFixed,
    (budget_s, job): (f64, &Job<'_>),
) -> Result<AutoChoice, RunError> {
    let set = Dataset::new(readings.clone(), targets, None, groups.clone()).unwrap();
    let samples: Vec<usize> = (0..set.samples()).collect();
    let times_s = is_timed.then(|| samples.iter().map(|sample| 0.1 * *sample as f64).collect());
    let series = Vec::from_iter(groups.iter().map(|group| *group as u64));
    let series = (by == SplitBy::Group).then_some(&series[..]);
    let history = History::new(readings, series, None, times_s, samples.clone());
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
        (budget_s, MemoryBudget::UNLIMITED),
        job,
        &mut |_| (),
    )
}

fn in_time() -> Result<AutoChoice, RunError> {
    let (fixed, all) = (AutoFixed::default(), (0..400).collect());
    choose_for(
        creeping(400),
        (SplitBy::Time, all, true),
        &fixed,
        (BUDGET_S, &Job::UNINTERRUPTED),
    )
}

fn normal(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
    let mut rng = Seed(seed).rng(Stream::TestNoise);
    Array2::from_shape_simple_fn((rows, columns), || standard_normal(&mut rng))
}

/// Share of the variance of a target that the answers of a choice leave.
fn unexplained(choice: &AutoChoice, targets: &Array2<f64>, target: usize) -> f64 {
    let (answers, truth) = (choice.answers.column(target), targets.column(target));
    let mean = truth.mean().unwrap();
    let spread = truth.mapv(|value| (value - mean).powi(2)).sum();
    (&answers - &truth).mapv(|error| error * error).sum() / spread
}

#[test]
fn a_sensor_that_creeps_gets_a_memory_where_time_is_known() {
    let choice = in_time().unwrap();
    assert!(!choice.memory.is_empty(), "{:?}", choice.record);
    let without = choice.record.tried.iter().filter(|tried| tried.memory.is_empty());
    let without = without.map(|tried| tried.error).fold(f64::INFINITY, f64::min);
    let error = choice.record.combined.unwrap();
    assert!(error < 0.5 * without, "{error} {without}");
    let untimed = |fixed: &AutoFixed| {
        let all = (0..400).collect();
        choose_for(
            creeping(400),
            (SplitBy::Time, all, false),
            fixed,
            (BUDGET_S, &Job::UNINTERRUPTED),
        )
        .unwrap()
    };
    assert!(untimed(&AutoFixed::default()).memory.is_empty());
    let asked = AutoFixed {
        tries_memory: true,
        ..AutoFixed::default()
    };
    assert!(!untimed(&asked).memory.is_empty());
}

/// A scan in rows over the plane; the readings know nothing of it, but wander.
#[test]
fn a_scan_and_sorted_samples_get_no_memory_even_with_times() {
    let count = 800;
    let noise = normal(count, 4, 1);
    let mut readings = noise.clone();
    for sample in 1..count {
        for channel in 0..4 {
            readings[[sample, channel]] = 0.9 * readings[[sample - 1, channel]] + noise[[sample, channel]];
        }
    }
    let scan = Array2::from_shape_fn((count, 2), |(sample, axis)| match axis {
        0 => (sample % 40) as f64,
        _ => (sample / 40) as f64,
    });
    let sorted = Array2::from_shape_fn((count, 1), |(sample, _)| (sample % 100) as f64);
    for targets in [scan, sorted] {
        for readings in [&readings, &noise] {
            let rule = (SplitBy::Time, (0..count).collect(), true);
            let job = (BUDGET_S, &Job::UNINTERRUPTED);
            let choice = choose_for((readings.clone(), targets.clone()), rule, &AutoFixed::default(), job).unwrap();
            assert!(choice.memory.is_empty(), "{:?}", choice.record);
        }
    }
}

/// In every file the same ramp, and a burst of the readings at its beginning: only averages know the time since then.
#[test]
fn what_only_a_memory_predicts_is_reported_and_not_used() {
    let count = 1000;
    let mut readings = normal(count, 2, 2) * 0.05;
    for sample in (0..count).filter(|sample| sample % 100 < 5) {
        readings[[sample, 0]] += 3.0;
    }
    let targets = Array2::from_shape_fn((count, 1), |(sample, _)| (sample % 100) as f64);
    let files = (0..count).map(|sample| sample / 100).collect();
    let rule = (SplitBy::Group, files, true);
    let choice = choose_for(
        (readings, targets),
        rule,
        &AutoFixed::default(),
        (BUDGET_S, &Job::UNINTERRUPTED),
    )
    .unwrap();
    assert_eq!(choice.record.leaks.len(), 1, "{:?}", choice.record);
    assert!(choice.memory.is_empty());
    let remarks = choice.record.remarks(&[Channel::new("y", None)]);
    assert!(
        remarks
            .iter()
            .any(|remark| remark.starts_with("possible leak: the history of readings predicts y")),
        "{remarks:?}"
    );
}

#[test]
fn the_answer_is_never_worse_than_a_candidate_and_noise_does_not_spoil_other_targets() {
    let count = 300;
    let readings = normal(count, 3, 3);
    let noise = normal(count, 3, 4);
    let targets = Array2::from_shape_fn((count, 3), |(sample, target)| {
        let [a, b] = [readings[[sample, 0]], readings[[sample, 1]]];
        let truth = [(2.0 * a).sin() + b, a - b, 0.0][target];
        truth + [0.2, 0.5, 1.0][target] * noise[[sample, target]]
    });
    let rule = (SplitBy::Random, (0..count).collect(), false);
    let job = (BUDGET_S, &Job::UNINTERRUPTED);
    let choice = choose_for((readings, targets.clone()), rule, &AutoFixed::default(), job).unwrap();
    assert_eq!(choice.record.undetermined, [2]);
    // Those on the same features, all of which could be members.
    let combined = choice.record.combined.unwrap();
    for tried in &choice.record.tried {
        let is_network = matches!(tried.model, TriedModel::Network { .. });
        assert!(
            combined <= tried.error * (1.0 + 1e-12) || is_network,
            "{combined} {tried:?}"
        );
    }
    let square = (
        0.2_f64.powi(2) / targets.column(0).var(0.0),
        0.25 / targets.column(1).var(0.0),
    );
    assert!(
        unexplained(&choice, &targets, 0) < 2.0 * square.0,
        "{:?}",
        choice.record
    );
    assert!(unexplained(&choice, &targets, 1) < 1.2 * square.1);
    // The mean of the other folds is within a few percent of that of all.
    assert!(unexplained(&choice, &targets, 2) < 1.05);
}

#[test]
fn the_program_of_the_combination_adds_its_members() {
    let choice = in_time().unwrap();
    let (readings, targets) = creeping(400);
    let times_s = (0..400).map(|sample| 0.1 * f64::from(sample)).collect();
    let history = History::new(readings, None, None, Some(times_s), (0..400).collect());
    let features = history.features(&choice.memory).unwrap();
    let set = Dataset::new(features, targets, None, (0..400).collect()).unwrap();
    let split = crate::dataset::Split {
        training: set.clone(),
        validation: None,
    };
    let mut run = Run::new(
        choice.settings,
        RunSets::new(split, set.clone()),
        None,
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    run.set_combined(Some(choice.combined.clone()));
    let before = run.network().decouple(&set);
    assert!(
        (run.decouple_test() - before).iter().all(|off| off.abs() < 1e-9),
        "the network until it is trained"
    );
    run.finish(&Job::UNINTERRUPTED).unwrap();
    let network = run.network().decouple(&set).column(0).to_vec();
    let expected = Vec::from_iter(network.iter().enumerate().map(|(sample, network)| {
        let others = choice.combined.others.iter().map(|(program, weights)| {
            let answer = crate::decoupling::ProgramDecoder::new(program.clone()).answers_to(&set)[[sample, 0]];
            weights[0] * answer
        });
        choice.combined.network[0] * network + others.sum::<f64>()
    }));
    for (ours, expected) in run.decouple_test().iter().zip(expected) {
        assert!((ours - expected).abs() < 1e-9, "{ours} {expected}");
    }
    assert_eq!(choice.combined.defect(set.channels(), 1), None);
    assert!(choice.combined.defect(set.channels() + 1, 1).is_some() || choice.combined.others.is_empty());
}

#[test]
fn readings_far_outside_are_answered_as_at_the_limits() {
    let choice = in_time().unwrap();
    let mut run = trained(&choice);
    run.finish(&Job::UNINTERRUPTED).unwrap();
    let mut decoder = crate::decoupling::ProgramDecoder::new(run.program());
    let channels = run.test().channels();
    let answer = |value: f64, decoder: &mut crate::decoupling::ProgramDecoder| {
        decoder.answers(&[0], Array2::from_elem((1, channels), value).view())[[0, 0]]
    };
    let far = answer(1e6, &mut decoder);
    assert_eq!(far, answer(1e9, &mut decoder));
    assert!(far.abs() < 100.0, "{far}");
}

#[test]
fn dead_channels_are_left_out_and_sparse_ones_stay() {
    let count = 600;
    let mut readings = normal(count, 4, 5);
    for sample in 0..count {
        // At the end of its range, with a few steps below; and a switch that knows the target.
        readings[[sample, 2]] = if sample % 50 < 2 { 1022.0 } else { 1023.0 };
        readings[[sample, 3]] = f64::from(u8::from(readings[[sample, 0]] > 0.5));
    }
    let targets = readings.select(ndarray::Axis(1), &[0]);
    let set = Dataset::new(readings, targets, None, (0..count).collect()).unwrap();
    assert_eq!(dead_channels(&set), [2]);
    // 16 × 16 taxels, each pressed in one of twenty samples.
    let taxels = Array2::from_shape_fn((2000, 256), |(sample, taxel)| {
        let pressed = (sample * 7919) % 256;
        let [off_x, off_y] = [pressed % 16, pressed / 16].map(|place| place as f64);
        let distance = (off_x - (taxel % 16) as f64).hypot(off_y - (taxel / 16) as f64);
        (2.2 - distance).max(0.0)
    });
    let zeros = taxels.iter().filter(|value| **value == 0.0).count() as f64 / taxels.len() as f64;
    assert!((0.93..0.97).contains(&zeros), "{zeros}");
    let targets = Array2::from_shape_fn((2000, 2), |(sample, axis)| match axis {
        0 => ((sample * 7919) % 256 % 16) as f64,
        _ => ((sample * 7919) % 256 / 16) as f64,
    });
    let set = Dataset::new(taxels, targets, None, (0..2000).collect()).unwrap();
    assert_eq!(dead_channels(&set), Vec::<usize>::new());
}

#[test]
fn the_same_seed_gives_the_same_choice_and_the_budget_is_kept() {
    let (one, other) = (in_time().unwrap(), in_time().unwrap());
    assert_eq!(one.record, other.record);
    assert_eq!((one.settings, &one.answers), (other.settings, &other.answers));
    // A candidate runs at least a few epochs.
    let used = one.record.seconds() + one.record.training_s;
    assert!(used < 1.5 * BUDGET_S, "{used}");
}

#[test]
fn held_out_answers_have_the_error_of_the_choice() {
    let choice = in_time().unwrap();
    let (_, targets) = creeping(400);
    let error = choice.record.combined.unwrap();
    assert!((unexplained(&choice, &targets, 0).sqrt() / error - 1.0).abs() < 1e-9);
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
    let rule = (SplitBy::Group, groups.clone(), true);
    let choice = choose_for(creeping(300), rule, &fixed, (BUDGET_S, &Job::UNINTERRUPTED)).unwrap();
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
    let judge = judge::Judge::new(&samples, judge::Judge::FOLDS, settings.seed).unwrap();
    assert_eq!(judge.parts(), choice.record.folds);
    for (outside, inside, _) in judge.divisions() {
        assert!(
            inside
                .iter()
                .all(|one| outside.iter().all(|other| groups[*one] != groups[*other]))
        );
    }
}

#[test]
fn a_cancelled_search_has_no_result() {
    let rule = (SplitBy::Time, (0..200).collect(), true);
    let cancelled = choose_for(
        creeping(200),
        rule,
        &AutoFixed::default(),
        (BUDGET_S, &Job::new(&|| true)),
    );
    assert!(matches!(cancelled, Err(RunError::Cancelled(_))));
}

/// The run of a choice for 400 samples, tested on the next 200.
fn trained(choice: &AutoChoice) -> Run {
    let (readings, targets) = creeping(600);
    let times_s = (0..600).map(|sample| 0.1 * f64::from(sample)).collect();
    let history = History::new(readings, None, None, Some(times_s), (0..600).collect());
    let features = history.features(&choice.memory).unwrap();
    let all = Dataset::new(features, targets, None, (0..600).collect()).unwrap();
    let part = |samples: std::ops::Range<usize>| all.select(&samples.collect::<Vec<_>>());
    let split = crate::dataset::Split {
        training: part(0..400),
        validation: None,
    };
    let sets = RunSets::new(split, part(400..600));
    let mut run = Run::with_baselines(choice.settings, sets, None, &Job::UNINTERRUPTED).unwrap();
    run.set_combined(Some(choice.combined.clone()));
    run
}

#[test]
fn the_choice_trains_to_about_its_error() {
    let choice = in_time().unwrap();
    let mut run = trained(&choice);
    run.finish(&Job::UNINTERRUPTED).unwrap();
    let truth = run.test().targets().to_owned();
    let square = (run.decouple_test() - &truth).mapv(|error| error * error).sum();
    let spread = truth.mapv(|target| target * target).sum();
    let (error, expected) = ((square / spread).sqrt(), choice.record.combined.unwrap());
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
        (4.0, MemoryBudget::UNLIMITED),
        &Job::UNINTERRUPTED,
        &mut |_| (),
    )
    .unwrap();
    let Method::ScaledConjugateGradient(settings) = choice.settings.training.method else {
        panic!("{:?}", choice.record);
    };
    assert!(settings.decay > 0.0);
    let ridge = choice
        .record
        .tried
        .iter()
        .filter(|tried| tried.model == TriedModel::Ridge);
    let ridge = ridge.map(|tried| tried.error).fold(f64::INFINITY, f64::min);
    let error = choice.record.combined.unwrap();
    assert!(error < 0.8 * ridge, "{error} {ridge}");
}
