use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        Intervals, Run,
        auto::{TriedModel, dead_channels},
    },
};
use ndarray::{Array2, Axis};
use rand::RngExt;

use super::recordings::{Recording, generator, normal, normals, relative_errors, responses, trained, wandering};

const BUDGET_S: f64 = 0.5;

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
