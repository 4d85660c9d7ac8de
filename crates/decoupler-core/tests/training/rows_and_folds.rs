//! Samples keep their row-wire in all folds and selections.

use decoupler_core::{
    dataset::{Dataset, Seed, Simulation, SplitBy, Stream},
    decoupling::{NewtonDecoder, decode_set},
    evaluation::{
        CrossValidation, Errors, RunError, RunSettings,
        experiments::{Axis, AxisKind, Experiment, ExperimentResults, TrialSamples, run_experiments},
    },
    machine::MemoryBudget,
    scene::{Noise, NoisySets, Rows, Scene},
    sensor::SensorModel,
};

fn small(rows: Rows) -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("4x3_2x9".parse().unwrap()),
            scene: Scene {
                rows,
                ..Scene::default()
            },
            samples: 24,
            validation_samples: 0,
            test_samples: 8,
        }
        .into(),
        hidden: 2,
        ..RunSettings::default()
    };
    settings.training.stopping.epochs = 3;
    settings
}

fn experiment(rows: Rows, folds: usize, unit: SplitBy) -> Experiment {
    experiment_on(small(rows), folds, unit)
}

fn experiment_on(settings: RunSettings, folds: usize, unit: SplitBy) -> Experiment {
    Experiment {
        base: settings,
        recording: None,
        axis: Axis::integers(AxisKind::Hidden, [2]),
        second_axis: None,
        seeds: 1,
        cross_validation: Some(CrossValidation {
            folds,
            repeats: 1,
            by: unit,
        }),
    }
}

fn finished(experiment: Experiment) -> ExperimentResults {
    let mut results = ExperimentResults::new(experiment.clone());
    run_experiments(
        &[experiment],
        &TrialSamples::Drawn(MemoryBudget::UNLIMITED),
        1.try_into().unwrap(),
        || false,
        |finished| {
            results.record(finished.cell, finished.outcome);
        },
    )
    .unwrap();
    results
}

#[test]
fn folds_are_counted_by_the_rows_read() {
    // 24 samples of one row-wire are 24 snapshots; 24 samples of four row-wires are 6.
    let cases = [
        (
            "single samples of one row-wire",
            Rows::One(2),
            24,
            SplitBy::Random,
            true,
        ),
        ("as many snapshots as samples", Rows::One(2), 24, SplitBy::Group, true),
        ("one more than there are", Rows::One(2), 25, SplitBy::Group, false),
        ("single samples of known rows", Rows::Known, 6, SplitBy::Random, true),
        ("whole snapshots of all rows", Rows::All, 6, SplitBy::Group, true),
        ("more than there are snapshots", Rows::All, 7, SplitBy::Group, false),
    ];
    for (sentence, rows, folds, unit, is_possible) in cases {
        assert_eq!(experiment(rows, folds, unit).check().is_ok(), is_possible, "{sentence}");
    }
    let missing = experiment(Rows::One(4), 2, SplitBy::Random).check();
    assert!(matches!(missing, Err(RunError::Scene(_))), "{missing:?}");
}

#[test]
fn a_fold_without_samples_of_a_known_row_is_named() {
    let results = finished(experiment(Rows::Known, 12, SplitBy::Random));
    let reason = results.cells[0].failures[0].to_string();
    assert!(reason.contains("has no validation samples"), "{reason}");
}

#[test]
fn cross_validation_by_samples_works_for_one_row_and_for_known_rows() {
    for rows in [Rows::One(2), Rows::Known] {
        let mut settings = small(rows);
        // Enough samples for every fold to have every row.
        settings.simulation_mut().unwrap().samples = 240;
        let results = finished(experiment_on(settings, 3, SplitBy::Random));
        assert_eq!(results.cells[0].failures, []);
        let errors = &results.cells[0].trials[0].scores.network;
        assert!(errors.percent().unwrap() < 50.0, "{rows}: {errors:?}");
    }
}

fn noisy_test(scene: &Scene, model: &SensorModel) -> Dataset {
    let mut set = Dataset::simulate(model, scene, 80, &mut Seed(1).rng(Stream::Test)).unwrap();
    set.disturb(model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
        .unwrap();
    set
}

#[test]
fn newton_uses_the_row_wire_of_each_sample() {
    let model = SensorModel::new("4x3_2x9".parse().unwrap());
    let scene = Scene {
        rows: Rows::Known,
        noise: Noise::relative(1e-3),
        ..Scene::default()
    };
    let set = noisy_test(&scene, &model);
    let mut newton = NewtonDecoder::new(&model, &scene, &[0, 1, 2, 3]).unwrap();
    let mut z_mm = |set: &Dataset| {
        let answers_mm = decode_set(&mut newton, set).unwrap();
        Errors::measure(set, &answers_mm, scene.stroke_mm(&model.geometry)).z_mm
    };
    let whole = z_mm(&set);
    // As in a fold assigned by samples: incomplete snapshots, in a different order.
    let odd: Vec<usize> = (0..80).filter(|sample| sample % 3 != 0).collect();
    let even: Vec<usize> = (0..80).rev().filter(|sample| sample % 3 == 0).collect();
    let parts = [&odd, &even].map(|part| z_mm(&set.select(part)) * part.len() as f64);
    assert!(
        (parts.iter().sum::<f64>() / 80.0 - whole).abs() < 1e-12 * whole,
        "{parts:?} {whole}"
    );
}

#[test]
fn the_worst_node_is_named_by_its_row_wire() {
    let model = SensorModel::new("4x3_2x9".parse().unwrap());
    let scene = Scene {
        rows: Rows::One(2),
        ..Scene::default()
    };
    let set = Dataset::simulate(&model, &scene, 5, &mut Seed(0).rng(Stream::Test)).unwrap();
    let mut decoupled = set.targets().to_owned();
    decoupled[[3, 5]] += 0.5;
    let worst = Errors::measure(&set, &decoupled, 1.0).worst_node;
    assert_eq!((worst.snapshot, worst.row, worst.node), (3, 2, 1));
}

/// The noise of the test set is in the held-out folds, and that of the training set in the others.
#[test]
fn folds_are_tested_with_the_noise_of_the_test_set() {
    let z_mm = |sets, relative| {
        let mut settings = small(Rows::All);
        settings.simulation_mut().unwrap().scene.noise = Noise {
            sets,
            ..Noise::relative(relative)
        };
        let results = finished(experiment_on(settings, 4, SplitBy::Group));
        results.cells[0].trials[0].scores.network.nodes().unwrap().z_mm
    };
    let clean = z_mm(NoisySets::Both, 0.0);
    assert!(z_mm(NoisySets::Test, 0.2) > 1.1 * clean);
    // Training and test differ, so this equals neither noise in both sets nor noise in none.
    let [both, training] = [NoisySets::Both, NoisySets::Training].map(|sets| z_mm(sets, 0.2));
    assert!(both != training && training != clean, "{both} {training} {clean}");
}
