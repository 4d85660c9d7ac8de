use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng, seq::SliceRandom};

use super::{half_width::expected_shares, *};
use crate::{evaluation::cross_validation::scatter, scene::standard_normal};

/// Synthetic relation y = 2x with noise, whose intervals are known.
#[derive(Clone, Copy)]
struct Truth {
    /// Correlation of the noise of neighbouring samples.
    memory: f64,
    /// Growth of the noise with x.
    growth: f64,
    samples: usize,
}

impl Truth {
    /// Draws samples in the order of time; the second target has five times the noise of the first.
    fn draw(self, samples: usize, rng: &mut ChaCha8Rng) -> Dataset {
        let mut noise = [standard_normal(rng), standard_normal(rng)];
        let mut readings = Array2::zeros((samples, 1));
        let mut targets = Array2::zeros((samples, 2));
        for sample in 0..samples {
            let x: f64 = rng.random();
            let spread = 0.1 * (1.0 + self.growth * x);
            readings[[sample, 0]] = x;
            for (target, noise) in noise.iter_mut().enumerate() {
                let fresh = standard_normal(rng) * (1.0 - self.memory * self.memory).sqrt();
                *noise = self.memory * *noise + fresh;
                targets[[sample, target]] = 2.0 * x + spread * [1.0, 5.0][target] * *noise;
            }
        }
        Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
    }
}

/// Least-squares line of each target.
fn fit(set: &Dataset) -> Vec<[f64; 2]> {
    let x = set.readings().column(0).to_vec();
    let count = x.len() as f64;
    let mean_x = x.iter().sum::<f64>() / count;
    let squares: f64 = x.iter().map(|x| (x - mean_x).powi(2)).sum();
    let line = |y: ArrayView1<'_, f64>| {
        let mean_y = y.sum() / count;
        let slope = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / squares;
        [mean_y - slope * mean_x, slope]
    };
    set.targets().columns().into_iter().map(line).collect()
}

fn answers(lines: &[[f64; 2]], set: &Dataset) -> Array2<f64> {
    Array2::from_shape_fn(set.targets().dim(), |(sample, target)| {
        lines[target][0] + lines[target][1] * set.readings()[[sample, 0]]
    })
}

/// Mean coverage of both targets on new samples over `repeats` sets, and share of shorter tests whose coverage is
/// said to be too low.
fn coverage(truth: Truth, repeats: u64) -> (f64, f64) {
    let (mut total, mut alarms, mut intervals_found) = (0.0, 0.0, 0.0);
    for seed in 0..repeats {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let set = truth.draw(truth.samples, &mut rng);
        let folds = Folds::by(&set, Intervals::FOLDS, SplitBy::Time, &mut rng).unwrap();
        let mut held_out = Array2::zeros(set.targets().dim());
        for fold in 0..folds.count() {
            let lines = fit(&set.select(&folds.without(&[fold])));
            let of_fold = answers(&lines, &set.select(folds.test(fold)));
            scatter(&mut held_out, folds.test(fold), &of_fold);
        }
        let intervals = Intervals::calibrate(&set, held_out.view(), SplitBy::Time);
        let lines = fit(&set);
        let new = truth.draw(2000, &mut rng);
        let short = truth.draw(truth.samples / 4, &mut rng);
        let many = intervals.coverage(&new, answers(&lines, &new).view());
        let few = intervals.coverage(&short, answers(&lines, &short).view());
        for (many, few) in many.iter().flatten().zip(few.iter().flatten()) {
            total += many.share;
            alarms += f64::from(u8::from(few.is_too_low()));
            intervals_found += 1.0;
        }
    }
    (total / intervals_found, alarms / intervals_found)
}

#[test]
fn half_widths_follow_the_noise_only_if_it_varies() {
    let calibrate = |growth: f64| {
        let truth = Truth {
            memory: 0.0,
            growth,
            samples: 1000,
        };
        let set = truth.draw(truth.samples, &mut ChaCha8Rng::seed_from_u64(0));
        let answers = Array2::from_shape_fn((1000, 2), |(sample, _)| 2.0 * set.readings()[[sample, 0]]);
        Intervals::calibrate(&set, answers.view(), SplitBy::Time)
    };
    // The 90 % quantile of |noise| is 1.645 standard deviations: 0.1 and 0.5 without growth.
    let constant = calibrate(0.0);
    for (target, spread) in [0.1, 0.5].into_iter().enumerate() {
        let half_width = constant.targets[target].as_ref().unwrap();
        assert!(half_width.by_answer.is_empty(), "{half_width:?}");
        assert!(
            (half_width.constant / (1.645 * spread) - 1.0).abs() < 0.1,
            "{half_width:?}"
        );
    }
    // With growth, the standard deviation is 0.1 (1 + 5x) at the answer 2x.
    let growing = calibrate(5.0);
    for answer in [0.4, 1.0, 1.6] {
        let ratio = growing.half_width(0, answer).unwrap() / (0.1645 * (1.0 + 2.5 * answer));
        assert!((ratio - 1.0).abs() < 0.2, "{answer}: {ratio}");
    }
}

#[test]
fn expected_shares_are_quantiles_of_the_beta_binomial_distribution() {
    // From scipy.stats.betabinom(test, 0.9 (n + 1), 0.1 (n + 1)).ppf([0.005, 0.995]) / test.
    for (test, calibration, expected) in [
        (10.0, 40.0, [0.5, 1.0]),
        (50.0, 200.0, [0.76, 1.0]),
        (400.0, 60.0, [0.77, 0.9775]),
        (2000.0, 3000.0, [0.877, 0.9215]),
    ] {
        let found = expected_shares(Intervals::NOMINAL, test, calibration);
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(found, expected)| (found - expected).abs() < 1e-12),
            "{test} {calibration}: {found:?}"
        );
    }
}

#[test]
fn too_few_samples_or_groups_have_no_interval() {
    let truth = Truth {
        memory: 0.0,
        growth: 0.0,
        samples: 8,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let few = truth.draw(8, &mut rng);
    let intervals = Intervals::calibrate(&few, few.targets().mapv(|y| y + 1.0).view(), SplitBy::Time);
    assert_eq!(intervals.checked(), Err(RunError::NoIntervals));
    // Errors that differ only between three subjects.
    let set = truth.draw(300, &mut rng);
    let groups: Vec<usize> = (0..300).map(|sample| sample / 100).collect();
    let answers = Array2::from_shape_fn((300, 2), |(sample, _)| groups[sample] as f64);
    let set = Dataset::new(set.readings().to_owned(), Array2::zeros((300, 2)), None, groups).unwrap();
    let intervals = Intervals::calibrate(&set, answers.view(), SplitBy::Group);
    assert_eq!(intervals.checked(), Err(RunError::NoIntervals));
    // A single subject says nothing about others.
    let one = Dataset::new(set.readings().to_owned(), set.targets().to_owned(), None, vec![0; 300]).unwrap();
    let answers = Array2::from_shape_fn((300, 2), |_| standard_normal(&mut rng));
    let intervals = Intervals::calibrate(&one, answers.view(), SplitBy::Group);
    assert_eq!(intervals.checked(), Err(RunError::NoIntervals));
}

/// For n independent samples, the half-width is the 0.9 (n + 1)th smallest error.
#[test]
fn independent_samples_have_the_quantile_of_conformal_prediction() {
    for (samples, rank) in [(9, 9.0), (19, 18.0), (24, 22.5), (99, 90.0)] {
        // The errors are 1 to n, without autocorrelation.
        let mut errors = Vec::from_iter((1..=samples).map(|error| error as f64));
        errors.shuffle(&mut ChaCha8Rng::seed_from_u64(1));
        let answers = Array2::from_shape_fn((samples, 1), |(sample, _)| errors[sample]);
        let zeros = Array2::zeros((samples, 1));
        let set = Dataset::new(zeros.clone(), zeros, None, (0..samples).collect()).unwrap();
        let intervals = Intervals::calibrate(&set, answers.view(), SplitBy::Random);
        let half_width = intervals.targets[0].as_ref().unwrap();
        assert_eq!(half_width.effective_samples, samples as f64);
        assert!((half_width.constant - rank).abs() < 1e-9, "{samples}: {half_width:?}");
    }
}

/// Intervals that are six times too wide, and those of a test part that is offset by a multiple of the noise, are noticed.
#[test]
fn wrong_coverage_is_noticed_in_both_directions() {
    let truth = Truth {
        memory: 0.9,
        growth: 0.0,
        samples: 1000,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (set, test) = (truth.draw(1000, &mut rng), truth.draw(300, &mut rng));
    let of = |set: &Dataset, factor: f64, offset: f64| {
        Array2::from_shape_fn((set.samples(), 2), |(sample, target)| {
            let truth = set.targets()[[sample, target]];
            truth + factor * (2.0 * set.readings()[[sample, 0]] - truth) + offset
        })
    };
    let intervals = Intervals::calibrate(&set, of(&set, 1.0, 0.0).view(), SplitBy::Time);
    let found = |factor: f64, offset: f64| {
        let coverage = intervals.coverage(&test, of(&test, factor, offset).view())[0].unwrap();
        (coverage.is_too_low(), coverage.is_too_high())
    };
    assert_eq!(found(1.0, 0.0), (false, false));
    assert_eq!(found(1.0, 0.2), (true, false));
    assert_eq!(found(1.0 / 6.0, 0.0), (false, true));
}

/// The mean over 200 sets and two targets has a standard error of about 0.3 %, 0.6 % with autocorrelation.
#[test]
fn new_samples_are_within_their_intervals_at_the_nominal_rate() {
    for (what, memory, growth, samples) in [
        ("independent noise", 0.0, 0.0, 200),
        ("few samples", 0.0, 0.0, 40),
        ("noise that grows with the reading", 0.0, 5.0, 400),
        ("autocorrelated noise, few samples", 0.9, 0.0, 200),
        ("autocorrelated noise", 0.9, 0.0, 600),
        ("autocorrelated noise, many samples", 0.9, 0.0, 3000),
        ("autocorrelated noise that grows", 0.9, 5.0, 1500),
    ] {
        let (share, alarms) = coverage(
            Truth {
                memory,
                growth,
                samples,
            },
            200,
        );
        assert!((0.88..0.92).contains(&share), "{what}: {share}");
        // The shortest tests have about six effective samples.
        assert!(alarms < 0.04, "{what}: {alarms}");
    }
}
