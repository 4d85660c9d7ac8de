//! Analysis of recorded readings, on sets whose truth is known by construction.

use decoupler_core::{
    dataset::{Dataset, Division, Folds, Seed, SplitBy, Stream},
    evaluation::{
        CrossValidated, Measured, RunError, RunSettings,
        recorded::{Findings, FittedModel, SplitComparison, nonlinear_gains, ridge_remark},
    },
    job::Job,
    scene::RowModel,
};
use ndarray::Array2;
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};

/// A value of mean 0 and variance 1.
fn normal(rng: &mut impl Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// Independent samples of this many normal readings with one target.
fn set(samples: usize, channels: usize, seed: u64, target: impl Fn(&[f64], &mut ChaCha8Rng) -> f64) -> Dataset {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let readings = Array2::from_shape_simple_fn((samples, channels), || normal(&mut rng));
    let targets = Array2::from_shape_fn((samples, 1), |(sample, _)| {
        target(readings.row(sample).as_slice().unwrap(), &mut rng)
    });
    Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
}

fn settings() -> RunSettings {
    let mut settings = RunSettings::from(Measured { rows: RowModel::Shared });
    (settings.hidden, settings.training.stopping.epochs) = (4, 30);
    settings
}

#[test]
fn a_random_split_is_optimistic_if_samples_of_a_group_are_alike() {
    // Readings identify the group and nothing else, and each group has its own offset.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let offsets: Vec<f64> = (0..20).map(|_| rng.random_range(-1.0..1.0)).collect();
    let readings = Array2::from_shape_fn((400, 20), |(sample, channel)| {
        f64::from(u8::from(sample / 20 == channel))
    });
    let targets = Array2::from_shape_fn((400, 1), |(sample, _)| offsets[sample / 20] + 0.01 * normal(&mut rng));
    let groups = (0..400).map(|sample| sample / 20).collect();
    let alike = Dataset::new(readings, targets, None, groups).unwrap();
    let compared = |set: &Dataset, by| {
        let assigned = Folds::by(set, 5, by, &mut Seed(0).rng(Stream::Split)).unwrap();
        let validated = CrossValidated::on_folds(&settings(), set, assigned, &Job::UNINTERRUPTED).unwrap();
        SplitComparison::complete(&settings(), set, 5, (by, &validated), &Job::UNINTERRUPTED).unwrap()
    };
    // For any split, random folds are compared with folds by group if there are groups.
    for by in SplitBy::ALL {
        let compared = compared(&alike, by);
        assert_eq!(compared.by, SplitBy::Group);
        let ratio = compared.ratios[0].unwrap();
        assert!(ratio.high < 0.3, "{by}: {ratio:?}");
        let sentence = compared.sentence(0, "offset");
        assert!(sentence.contains("split is optimistic by 9"), "{sentence}");
    }
    let independent = set(400, 3, 4, |c, rng| c[0] - 0.5 * c[1] + 0.3 * normal(rng));
    let of_independent = compared(&independent, SplitBy::Random);
    assert_eq!(of_independent.by, SplitBy::Time);
    let sentence = of_independent.sentence(0, "y");
    assert!(sentence.starts_with("no significant difference"), "{sentence}");
    let assigned = Folds::by(&independent, 5, SplitBy::Random, &mut Seed(0).rng(Stream::Split)).unwrap();
    let validated = CrossValidated::on_folds(&settings(), &independent, assigned, &Job::UNINTERRUPTED).unwrap();
    let given = (SplitBy::Random, &validated);
    let cancelled = SplitComparison::complete(&settings(), &independent, 5, given, &Job::new(&|| true));
    assert!(matches!(cancelled, Err(RunError::Cancelled(_))));
}

/// The sentence on a random split for this recording, whose samples are in order of time.
fn sentence_on_random_split(set: &Dataset) -> String {
    let mut settings = settings();
    (settings.hidden, settings.training.stopping.epochs) = (2, 8);
    let folds = Folds::by(set, 5, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap();
    let validated = CrossValidated::on_folds(&settings, set, folds, &Job::UNINTERRUPTED).unwrap();
    let compared = SplitComparison::complete(&settings, set, 5, (SplitBy::Time, &validated), &Job::UNINTERRUPTED);
    compared.unwrap().sentence(0, "y")
}

/// About one in a hundred sets may seem to change by chance: at most 5 of 100 with a probability of 0.9995.
#[test]
fn independent_samples_are_not_said_to_change_over_time() {
    let claims = (0..100).filter(|seed| {
        let samples = 60 + 3 * *seed as usize;
        let set = set(samples, 3, 100 + seed, |c, rng| {
            c[0] - 0.5 * c[1] * c[2] + 0.3 * normal(rng)
        });
        sentence_on_random_split(&set).contains("optimistic")
    });
    let claims = claims.count();
    assert!(claims <= 5, "{claims} of 100");
}

#[test]
fn a_relation_that_drifts_is_said_to_change_over_time() {
    let mut at = 0.0;
    let targets = Array2::from_shape_simple_fn((300, 1), || {
        at += 1.0 / 300.0;
        at
    });
    let independent = set(300, 3, 9, |c, rng| c[0] - 0.5 * c[1] + 0.1 * normal(rng));
    // The offset drifts, and the third channel is a clock: random folds learn the drift, blocks of time cannot.
    let mut readings = independent.readings().to_owned();
    readings.column_mut(2).assign(&targets.column(0));
    let drift = targets.mapv(|at| (7.0 * at).sin());
    let set = Dataset::new(readings, &independent.targets() + &drift, None, (0..300).collect()).unwrap();
    let sentence = sentence_on_random_split(&set);
    assert!(
        sentence.contains("the random split is optimistic by") && sentence.contains("as with drift"),
        "{sentence}"
    );
}

/// Findings with this model on a set whose last part of this share is for testing.
fn findings(set: &Dataset, folds: usize, by: SplitBy, test_fraction: f64, model: FittedModel) -> Findings {
    let division = Division {
        by,
        test_fraction,
        validation_fraction: 0.0,
    };
    let ends: (&Job<'_>, &dyn Fn() -> bool) = (&Job::UNINTERRUPTED, &|| false);
    Findings::measure(&settings(), set, (&division, folds), Some(model), &|_| (), ends).unwrap()
}

#[test]
fn the_error_grows_by_the_information_unique_to_a_left_out_channel() {
    let set = set(2000, 4, 5, |c, rng| 2.0 * c[0] + 0.5 * c[1] + 0.5 * normal(rng));
    let found = findings(&set, 5, SplitBy::Time, 0.2, FittedModel::Ridge);
    // √(2² + 0.5²)/0.5, √(0.5² + 0.5²)/0.5, and no growth.
    for (channel, expected) in [(0, 4.123), (1, 1.414), (2, 1.0), (3, 1.0)] {
        let growth = found.importance[channel][0].unwrap();
        assert!((growth.value / expected - 1.0).abs() < 0.05, "{channel}: {growth:?}");
        assert!(
            growth.low - 0.01 < expected && expected < growth.high + 0.01,
            "{channel}: {growth:?}"
        );
        assert_eq!(found.is_dispensable(channel), channel > 1, "{channel}: {growth:?}");
    }
    // A copy makes the channel redundant, which permuting it would not show.
    let copied = set.of_channels(&[0, 1, 2, 0]);
    let growth = |found: &Findings| Vec::from_iter(found.importance.iter().map(|of| of[0].unwrap().value));
    let found = growth(&findings(&copied, 5, SplitBy::Time, 0.2, FittedModel::Ridge));
    assert!(found[0] < 1.01 && found[1] > 1.3, "{found:?}");
    let few = set.select(&Vec::from_iter(0..300));
    let found = growth(&findings(&few, 3, SplitBy::Time, 0.2, FittedModel::Network));
    assert!(
        found[0] > 3.0 && (1.1..2.0).contains(&found[1]) && found[2] < 1.1,
        "{found:?}"
    );
}

#[test]
fn a_learning_curve_has_the_errors_of_theory() {
    // Least squares with p = 20 readings: the error is σ √(1 + p/(n − p − 1)) for n samples, on average.
    let all = set(4000, 20, 6, |c, rng| c.iter().sum::<f64>() + 3.0 * normal(rng));
    let theory = |samples: f64| 3.0 * (1.0 + 20.0 / (samples - 21.0)).sqrt();
    for by in [SplitBy::Time, SplitBy::Random, SplitBy::Group] {
        let curve = findings(&all, 5, by, 0.5, FittedModel::Ridge).curve;
        assert_eq!(curve.len(), 7);
        assert_eq!((curve[0].samples, curve[6].samples), (250, 2000), "{by}");
        assert!(curve.windows(2).all(|pair| pair[0].samples < pair[1].samples));
        for point in &curve {
            let (rmse, [best, worst]) = (point.rmse[0], point.range[0]);
            let expected = theory(point.samples as f64);
            assert!((rmse / expected - 1.0).abs() < 0.05, "{by}, {expected}: {point:?}");
            assert!(best <= rmse && rmse <= worst, "{point:?}");
        }
    }
    let few = all.select(&Vec::from_iter(0..18));
    let curve = findings(&few, 2, SplitBy::Time, 0.5, FittedModel::Ridge).curve;
    assert_eq!(curve.len(), 1, "fits to fewer than 8 samples are left out: {curve:?}");
}

#[test]
fn a_network_no_better_than_ridge_is_reported_as_such() {
    let gain = |set: &Dataset| {
        let folds = Folds::by(set, 5, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap();
        let validated = CrossValidated::on_folds(&settings(), set, folds, &Job::UNINTERRUPTED).unwrap();
        nonlinear_gains(set, &validated, SplitBy::Time)[0].unwrap()
    };
    let linear = gain(&set(400, 3, 7, |c, rng| c[0] + c[1] + normal(rng)));
    let remark = ridge_remark(linear, "y").unwrap();
    assert!(remark.contains("no better than ridge"), "{remark}");
    let curved = gain(&set(400, 3, 8, |c, rng| c[0] + c[1] * c[1] + 0.2 * normal(rng)));
    assert!(
        curved.is_improvement() && ridge_remark(curved, "y").is_none(),
        "{curved:?}"
    );
}

#[test]
fn folds_of_every_rule_are_checked_and_seeded() {
    let set = set(120, 3, 9, |c, rng| c[0] - c[2] + 0.1 * normal(rng));
    for by in SplitBy::ALL {
        let validate = || {
            let folds = Folds::by(&set, 4, by, &mut Seed(1).rng(Stream::Split)).unwrap();
            CrossValidated::on_folds(&settings(), &set, folds, &Job::UNINTERRUPTED).unwrap()
        };
        let (one, other) = (validate(), validate());
        assert_eq!((&one.network, &one.linear), (&other.network, &other.linear), "{by}");
        let scores = one.scores(&set);
        let r2 = [&scores.network, &scores.baselines.linear].map(|errors| errors.targets()[0].r2.unwrap());
        assert!(r2.iter().all(|r2| *r2 > 0.95), "{by}: {r2:?}");
    }
    assert_eq!(settings().validation_fraction(), 0.0);
    let parts = Division::default()
        .divide(&set, &mut Seed(0).rng(Stream::Split))
        .unwrap();
    assert_eq!(
        (parts.training.len(), parts.validation.len(), parts.test.len()),
        (96, 0, 24)
    );
}
