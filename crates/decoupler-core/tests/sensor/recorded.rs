//! Analysis of recorded readings, on sets whose truth is known by construction.

use decoupler_core::{
    dataset::{Dataset, Division, Folds, Seed, SplitBy, Stream},
    evaluation::{
        CrossValidated, RunError, RunSettings,
        recorded::{Findings, FittedModel, SplitComparison, StudyStep, nonlinear_gains, ridge_remark},
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
    let mut settings = RunSettings::measured(RowModel::Shared);
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

/// The network is left out if the time is spent or it is not asked for; ridge regression is measured in any case.
#[test]
fn ridge_regression_comes_first() {
    let set = set(2000, 4, 5, |c, rng| 2.0 * c[0] + 0.5 * c[1] + 0.5 * normal(rng));
    let measure = |model, is_spent: bool| {
        let ends: (&Job<'_>, &dyn Fn() -> bool) = (&Job::UNINTERRUPTED, &|| is_spent);
        Findings::measure(&settings(), &set, (SplitBy::Time, 5), model, &|_| (), ends).unwrap()
    };
    let [ridge, spent] =
        [(FittedModel::Ridge, false), (FittedModel::Network, true)].map(|(model, is_spent)| measure(model, is_spent));
    for found in [&ridge, &spent] {
        let target = &found.targets[0];
        // The readings do not explain 0.5² of the variance 2² + 0.5² + 0.5².
        let expected = 1.0 - 0.25 / 4.5;
        let r2 = target.ridge.unwrap().r2;
        assert!(
            (r2.value - expected).abs() < 0.01 && r2.low < expected && expected < r2.high,
            "{r2:?}"
        );
        assert_eq!((target.network, target.gain, &found.comparison), (None, None, &None));
        assert_eq!(target.best().unwrap().0, FittedModel::Ridge);
    }
    assert_eq!(ridge.left_out, []);
    assert_eq!(spent.left_out, [StudyStep::Folds, StudyStep::OtherFolds]);
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
    assert!(curved.high < 1.0 && ridge_remark(curved, "y").is_none(), "{curved:?}");
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
