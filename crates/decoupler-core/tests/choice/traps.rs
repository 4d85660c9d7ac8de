use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        Intervals, Run,
        auto::{TriedModel, dead_channels},
    },
};
use ndarray::{Array2, Axis, concatenate};
use rand::RngExt;

use super::recordings::{Recording, generator, normal, normals, relative_errors, responses, trained, wandering};

const BUDGET_S: f64 = 0.5;

/// Ten objects, each pressed with a rising force: the order of recording determines the force, and so do the readings.
#[test]
fn sorted_grasps_are_decoded_from_the_readings_of_the_moment() {
    let mut rng = generator(1);
    let widths = Vec::from_iter((0..10).map(|_| rng.random_range(-1.0..1.0)));
    let targets = Array2::from_shape_fn((1000, 2), |(sample, target)| match target {
        0 => (sample % 100) as f64 / 50.0 - 1.0,
        _ => widths[sample / 100],
    });
    let readings = responses(&targets, 8, &mut rng) + 0.2 * normals((1000, 8), &mut rng);
    let all = Recording {
        is_timed: false,
        ..Recording::of_time(readings, targets)
    };
    let is_test = |sample: &usize| sample % 5 == 4;
    let (test, training): (Vec<usize>, Vec<usize>) = (0..1000).partition(is_test);
    let (training, test) = (all.part(&training), all.part(&test));
    let choice = training.choose(BUDGET_S);
    assert!(choice.memory.is_empty(), "{:?}", choice.record);
    let run = trained(&choice, &training, &test);
    let errors = relative_errors(&run.decouple_test(), &test.targets);
    let of_ridge = ridge_errors(&run);
    for (error, of_ridge) in errors.into_iter().zip(of_ridge) {
        assert!(error < 1.05 * of_ridge, "{error} {of_ridge} {:?}", choice.record);
    }
}

/// Errors of ridge regression on the test samples of a run, relative to the spread of each target.
fn ridge_errors(run: &Run) -> Vec<f64> {
    let ridge = run.baselines().unwrap().linear.targets();
    let spread = run.test().targets().std_axis(Axis(0), 0.0);
    ridge
        .iter()
        .zip(spread)
        .map(|(ridge, spread)| ridge.rmse / spread)
        .collect()
}

/// 9 of 30 channels are at the end of their range in the first session, with a few steps below it, and wake in the second.
#[test]
fn channels_that_wake_in_a_later_session_are_left_out() {
    let mut rng = generator(2);
    let targets = wandering((1500, 3), 40.0, &mut rng).mapv(f64::tanh);
    let truth = 500.0 + 300.0 * responses(&targets, 30, &mut rng) + 8.0 * normals((1500, 30), &mut rng);
    let mut readings = truth.mapv(f64::round);
    let asleep = Vec::from_iter((0..30).filter(|channel| channel % 10 < 3));
    for sample in 0..1000 {
        for &channel in &asleep {
            let is_below = rng.random::<f64>() < 0.002;
            readings[[sample, channel]] = if is_below { 1020.0 } else { 1023.0 };
        }
    }
    let all = Recording {
        readings,
        targets,
        sessions: (0..1500).map(|sample| sample / 250).collect(),
        by: SplitBy::Group,
        is_timed: false,
    };
    let [first, second] = [0..1000, 1000..1500].map(|part| all.part(&Vec::from_iter(part)));
    assert_eq!(dead_channels(&first.set()), asleep);

    let awake = Vec::from_iter((0..30).filter(|channel| !asleep.contains(channel)));
    let of_awake = [&first, &second].map(|part| Recording {
        readings: part.readings.select(Axis(1), &awake),
        ..part.part(&Vec::from_iter(0..part.targets.nrows()))
    });
    let choice = of_awake[0].choose(BUDGET_S);
    let run = trained(&choice, &of_awake[0], &of_awake[1]);
    let errors = relative_errors(&run.decouple_test(), &second.targets);
    assert!(errors.iter().all(|error| *error < 0.1), "{errors:?}");

    // Where they are kept, readings far outside are limited; without limits, errors are several times the spread.
    let choice = first.choose(BUDGET_S);
    let run = trained(&choice, &first, &second);
    let errors = relative_errors(&run.decouple_test(), &second.targets);
    assert!(errors.iter().all(|error| *error < 2.0), "{errors:?}");
}

#[test]
fn a_target_of_noise_does_not_change_the_errors_of_the_others() {
    let mut rng = generator(3);
    let hidden = normals((700, 3), &mut rng);
    let readings = responses(&(0.6 * &hidden), 8, &mut rng) + 0.05 * normals((700, 8), &mut rng);
    let of = |row: usize, target: usize| [(2.0 * hidden[[row, 0]]).sin() + hidden[[row, 1]], hidden[[row, 2]]][target];
    let determined = Array2::from_shape_fn((700, 2), |(row, target)| of(row, target));
    let junk = 100.0 * normals((700, 1), &mut rng);
    let with_junk = concatenate(Axis(1), &[determined.view(), junk.view()]).unwrap();
    let [without, with] = [determined, with_junk].map(|targets| {
        let all = Recording::of_time(readings.clone(), targets);
        let [training, test] = [0..500, 500..700].map(|part| all.part(&Vec::from_iter(part)));
        let choice = training.choose(BUDGET_S);
        let run = trained(&choice, &training, &test);
        (relative_errors(&run.decouple_test(), &test.targets), choice)
    });
    assert_eq!(with.1.record.undetermined, [2]);
    assert!(without.1.record.undetermined.is_empty());
    for target in 0..2 {
        let [without, with] = [without.0[target], with.0[target]];
        assert!(with < 1.3 * without, "{with} {without}");
    }
    assert!(with.0[2] < 1.05, "{}", with.0[2]);
}

/// Taxels of eight levels, most of which are 0 in nearly all samples, as in every pressed skin.
#[test]
fn taxels_that_are_rarely_pressed_stay() {
    let mut rng = generator(4);
    let places = Array2::from_shape_simple_fn((800, 2), || rng.random_range(1.0..14.0));
    let taxels = Array2::from_shape_fn((800, 256), |(sample, taxel)| {
        let [x, y] = [taxel % 16, taxel / 16].map(|place| place as f64);
        let distance = (places[[sample, 0]] - x).hypot(places[[sample, 1]] - y);
        (7.0 - 3.0 * distance).max(0.0).round()
    });
    let zeros = taxels.iter().filter(|level| **level == 0.0).count() as f64 / taxels.len() as f64;
    assert!((0.93..0.98).contains(&zeros), "{zeros}");
    let set = Recording::of_time(taxels, places).set();
    assert_eq!(dead_channels(&set), Vec::<usize>::new());
}

/// Trainings of networks with thousands of weights for two dozen samples would take minutes and fit noise.
#[test]
fn few_samples_of_wide_readings_get_cheap_candidates() {
    let mut rng = generator(5);
    let hidden = normals((48, 3), &mut rng);
    let readings = hidden.dot(&normals((3, 800), &mut rng)) + 0.5 * normals((48, 800), &mut rng);
    let targets = Array2::from_shape_fn((48, 1), |(row, _)| 2.0 * hidden[[row, 0]] + hidden[[row, 1]]);
    let all = Recording {
        by: SplitBy::Random,
        ..Recording::of_time(readings, targets)
    };
    let [training, test] = [0..24, 24..48].map(|part| all.part(&Vec::from_iter(part)));
    let choice = training.choose(4.0);
    for tried in &choice.record.tried {
        if let TriedModel::Network { hidden, .. } = tried.model {
            assert!(hidden <= 16, "{tried:?}");
        }
    }
    let run = trained(&choice, &training, &test);
    let error = relative_errors(&run.decouple_test(), &test.targets)[0];
    assert!(error < 1.05 * ridge_errors(&run)[0], "{error} {:?}", choice.record);
}

/// Gain and offset of each channel change from session to session, so that samples of one session know nothing of another.
fn drifting(sessions: usize, seed: u64) -> Recording {
    const EACH: usize = 60;
    let mut rng = generator(seed);
    let targets = normals((sessions * EACH, 1), &mut rng);
    // The same sensor for all seeds.
    let mut readings = responses(&targets, 6, &mut generator(100));
    for mut part in readings.axis_chunks_iter_mut(Axis(0), EACH) {
        for mut channel in part.columns_mut() {
            let (gain, offset) = (1.0 + 0.1 * normal(&mut rng), 0.3 * normal(&mut rng));
            channel.mapv_inplace(|reading| gain * reading + offset);
        }
    }
    readings += &(0.03 * normals(readings.dim(), &mut rng));
    Recording {
        sessions: (0..sessions * EACH).map(|sample| sample / EACH).collect(),
        readings,
        targets,
        by: SplitBy::Group,
        is_timed: false,
    }
}

/// Intervals for new sessions contain the share of the samples that they claim, on average over recordings; those that
/// contain much less are reported.
#[test]
fn intervals_after_drift_between_sessions_hold_in_new_sessions() {
    let mut shares = Vec::new();
    for seed in 0..6 {
        let training = drifting(20, seed);
        let choice = training.choose(0.1);
        assert_eq!((choice.record.by, choice.record.folds), (SplitBy::Group, 5));
        let set = training.set();
        let intervals = Intervals::calibrate(&set, choice.answers.view(), SplitBy::Group);
        let test = drifting(20, 1000 + seed);
        let run = trained(&choice, &training, &test);
        let coverage = intervals.coverage(&test.set(), run.decouple_test().view())[0].unwrap();
        assert!(coverage.share > 0.75 || coverage.is_too_low(), "{coverage:?}");
        shares.push(coverage.share);
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!((0.84..0.97).contains(&mean), "{shares:?}");
}

/// A scan whose lines follow a ramp, with readings that know nothing of it: means of the mean of the other lines are far off at
/// both ends, so that anything that wanders slowly, such as an average of noise, seems better.
#[test]
fn averages_of_noise_are_no_memory_of_a_scan() {
    for seed in 0..6 {
        let scan = Array2::from_shape_fn((1280, 2), |(sample, axis)| match axis {
            0 => (sample % 40) as f64,
            _ => (sample / 40) as f64,
        });
        let readings = normals((1280, 8), &mut generator(200 + seed));
        let choice = Recording::of_time(readings, scan).choose(0.2);
        assert!(choice.memory.is_empty(), "{seed}: {:?}", choice.record);
    }
}
