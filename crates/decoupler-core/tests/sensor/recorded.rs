//! Analysis of recorded readings, on sets whose truth is known by construction.

use decoupler_core::{
    dataset::{Dataset, Division, Folds, Seed, SplitBy, Stream},
    evaluation::{
        CrossValidated, RunError, RunSettings,
        auto::{AutoFixed, AutoSamples},
        recorded::{Findings, ridge_remarks},
    },
    job::Job,
    problem::Channel,
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
    let mut settings = RunSettings::measured(RowModel::Shared);
    (settings.hidden, settings.training.stopping.epochs) = (4, 30);
    settings
}

/// The findings on a recording that is divided by `by`.
fn findings(set: &Dataset, by: SplitBy, job: &Job<'_>) -> Result<Findings, RunError> {
    let samples = AutoSamples { set, past: None, by };
    Findings::measure(&settings(), &samples, &AutoFixed::default(), job)
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
    let compared = |set: &Dataset, by| findings(set, by, &Job::UNINTERRUPTED).unwrap().comparison;
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
    let cancelled = findings(&independent, SplitBy::Random, &Job::new(&|| true));
    assert!(matches!(cancelled, Err(RunError::Cancelled(_))));
}

/// The sentence on a random split for this recording, whose samples are in order of time.
fn sentence_on_random_split(set: &Dataset) -> String {
    let found = findings(set, SplitBy::Time, &Job::UNINTERRUPTED).unwrap();
    found.comparison.sentence(0, "y")
}

/// About one in a hundred sets may seem to change by chance: at most 3 of 30 with a probability of 0.9998.
#[test]
fn independent_samples_are_not_said_to_change_over_time() {
    let claims = (0..30).filter(|seed| {
        let samples = 60 + 6 * *seed as usize;
        let set = set(samples, 3, 100 + seed, |c, rng| {
            c[0] - 0.5 * c[1] * c[2] + 0.3 * normal(rng)
        });
        sentence_on_random_split(&set).contains("optimistic")
    });
    let claims = claims.count();
    assert!(claims <= 3, "{claims} of 30");
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

/// The readings do not explain 0.5² of the variance 2² + 0.5² + 0.5², or of 0.5 + 2 · 0.5² = 1, since a square of a normal
/// value has the variance 2.
#[test]
fn what_the_readings_determine_is_found_for_linear_and_curved_relations() {
    let linear = set(500, 4, 5, |c, rng| 2.0 * c[0] + 0.5 * c[1] + 0.5 * normal(rng));
    let curved = set(500, 2, 6, |c, rng| 0.5 * c[0] + 0.5 * c[1] * c[1] + 0.5 * normal(rng));
    for (set, by_ridge, by_best) in [(&linear, 1.0 - 0.25 / 4.5, 1.0 - 0.25 / 4.5), (&curved, 0.25, 0.75)] {
        let found = findings(set, SplitBy::Time, &Job::UNINTERRUPTED).unwrap();
        let target = &found.targets[0];
        for (r2, expected) in [
            (target.ridge.unwrap().r2, by_ridge),
            (target.best().unwrap().0.r2, by_best),
        ] {
            assert!((r2.value - expected).abs() < 0.06, "{r2:?} instead of {expected}");
            assert!(r2.low < expected && expected < r2.high, "{r2:?} instead of {expected}");
        }
    }
}

#[test]
fn a_network_no_better_than_ridge_is_reported_as_such() {
    let remarks = |set: &Dataset| {
        let folds = Folds::by(set, 5, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap();
        let validated = CrossValidated::on_folds(&settings(), set, folds, &Job::UNINTERRUPTED).unwrap();
        ridge_remarks(set, &validated, SplitBy::Time, &[Channel::new("y", None)])
    };
    let linear = remarks(&set(400, 3, 7, |c, rng| c[0] + c[1] + normal(rng)));
    assert!(
        linear[0].contains("no better than ridge for y (error 1.0"),
        "{linear:?}"
    );
    assert!(linear[0].ends_with("with these settings, use ridge"), "{linear:?}");
    let curved = remarks(&set(400, 3, 8, |c, rng| c[0] + c[1] * c[1] + 0.2 * normal(rng)));
    assert_eq!(curved, [""; 0]);
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
    let (split, test) = Division::default().sets(&set, None, Seed(0)).unwrap();
    assert_eq!(
        (split.training.samples(), split.validation, test.samples()),
        (96, None, 24)
    );
}
