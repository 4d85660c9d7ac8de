//! The paper's experiments and sweeps.

use std::{
    fs,
    num::NonZero,
    ops::ControlFlow,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use decoupler_core::{
    dataset::{Seed, Simulation, SplitBy},
    evaluation::{
        CrossValidation, ErrorMeasure, Run, RunError, RunSets, RunSettings, TestErrors,
        experiments::{Axis, AxisKind, Experiment, ExperimentResults, Trial, TrialSamples, run_experiments},
    },
    job::Job,
    machine::MemoryBudget,
    scene::RowModel,
    sensor::{ArrayScale, SensorModel},
    training::Method,
};
use decoupler_files::{
    export::{ExperimentTable, describe_conditions, describe_worse_than_mean, trials_table, write_experiment_markdown},
    import::{Plan, Recipe, Setup},
};

/// Settings that train in less than a second: a small array, few samples, few epochs.
fn small_settings() -> RunSettings {
    let mut base = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("4x2_1x6".parse().unwrap()),
            samples: 40,
            validation_samples: 12,
            test_samples: 20,
            ..Simulation::default()
        }
        .into(),
        hidden: 3,
        starts: 2,
        ..RunSettings::default()
    };
    base.training.stopping.epochs = 8;
    base
}

fn small(axis: Axis) -> Experiment {
    Experiment {
        base: small_settings(),
        recording: None,
        axis,
        second_axis: None,
        seeds: 3,
        cross_validation: None,
    }
}

fn cross_validated(unit: SplitBy) -> Experiment {
    Experiment {
        cross_validation: Some(CrossValidation {
            folds: 4,
            repeats: 2,
            by: unit,
        }),
        ..small(Axis::integers(AxisKind::Samples, [40, 20]))
    }
}

fn worst_mm(errors: &TestErrors) -> f64 {
    errors.nodes().unwrap().worst_mm
}

fn threads(count: usize) -> NonZero<usize> {
    NonZero::new(count).unwrap()
}

fn run(experiments: &[Experiment], thread_count: usize) -> Vec<ExperimentResults> {
    let memory = MemoryBudget::System(8_000_000_000);
    run_on(experiments, &TrialSamples::Drawn(memory), thread_count)
}

fn run_on(experiments: &[Experiment], samples: &TrialSamples, thread_count: usize) -> Vec<ExperimentResults> {
    let mut results: Vec<_> = experiments.iter().cloned().map(ExperimentResults::new).collect();
    run_experiments(
        experiments,
        samples,
        threads(thread_count),
        || false,
        |finished| {
            results[finished.experiment].record(finished.cell, finished.outcome);
        },
    )
    .unwrap();
    results
}

/// Returns the trials of every cell, without their times.
fn timeless(results: &[ExperimentResults]) -> Vec<Vec<Trial>> {
    let cells = results.iter().flat_map(|results| &results.cells);
    let trials = cells.map(|cell| {
        let timeless = |trial: &Trial| {
            let mut timeless = trial.clone();
            (timeless.effort.seconds, timeless.effort.min_epoch_seconds) = (0.0, None);
            timeless.states.clear();
            timeless
        };
        cell.trials.iter().map(timeless).collect()
    });
    trials.collect()
}

#[test]
fn results_are_the_same_on_any_number_of_threads() {
    let experiments = [
        Experiment {
            second_axis: Some(Axis::names(AxisKind::Method, ["lm", "br", "scg", "rp"])),
            ..small(Axis::integers(AxisKind::Hidden, [2, 5]))
        },
        cross_validated(SplitBy::Random),
        cross_validated(SplitBy::Group),
    ];
    let alone = run(&experiments, 1);
    assert!(alone.iter().all(ExperimentResults::is_complete));
    assert_eq!(timeless(&alone), timeless(&run(&experiments, 3)));
    let counts: Vec<_> = timeless(&alone).iter().map(Vec::len).collect();
    assert_eq!(counts, [vec![3; 8], vec![6; 4]].concat());
}

#[test]
fn a_trial_equals_the_run_with_its_settings() {
    let experiment = small(Axis::integers(AxisKind::Hidden, [2, 4]));
    for cell in &run(std::slice::from_ref(&experiment), 2)[0].cells {
        let mut z_percent = Vec::new();
        for (trial, seed) in cell.trials.iter().zip(0..3) {
            let settings = RunSettings {
                seed: Seed(seed),
                ..cell.settings
            };
            let mut alone = Run::prepare(settings).unwrap();
            while alone.step().is_none() {}
            assert_eq!(trial.seed, Seed(seed));
            assert_eq!(trial.scores.network, alone.scores().unwrap().network);
            let baselines = alone.baselines().unwrap();
            assert_eq!(
                [&trial.scores.baselines.mean, &trial.scores.baselines.linear],
                [&baselines.mean, &baselines.linear]
            );
            let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
            let begin = Some(trial.states.clone());
            let taken_up = Run::new(settings, sets, begin, &Job::UNINTERRUPTED).unwrap();
            assert_eq!(taken_up.network(), alone.network());
            assert_eq!(taken_up.stop_reason(), alone.stop_reason());
            z_percent.push(alone.errors().percent().unwrap());
        }
        z_percent.sort_by(f64::total_cmp);
        let z = cell.percent();
        assert_eq!([z.min, z.median, z.max].map(Option::unwrap), z_percent[..]);
        let median = cell.median_trial().unwrap();
        assert_eq!(median.scores.network.percent(), Some(z_percent[1]));
    }
}

#[test]
fn cross_validation_decouples_every_sample_with_a_network_that_was_not_trained_on_it() {
    for unit in [SplitBy::Random, SplitBy::Group] {
        let mut experiment = cross_validated(unit);
        experiment.base.hidden = 6;
        for cell in &run(&[experiment], 2)[0].cells {
            for trial in &cell.trials {
                // A sample left out would be decoupled as (0, 0, 0), 4 mm below any node.
                assert!(worst_mm(&trial.scores.baselines.mean) < 1.0, "{unit}: {trial:?}");
                assert!(worst_mm(&trial.scores.network) < 4.0, "{unit}: {trial:?}");
                assert_eq!((trial.effort.networks, trial.states.is_empty()), (4, true));
            }
            let [first, second] = [0, 1].map(|repeat| &cell.trials[repeat]);
            assert_eq!(first.seed, second.seed);
            assert_ne!(
                first.scores.network, second.scores.network,
                "each repeat draws new folds"
            );
        }
    }
}

#[test]
fn cancelling_keeps_finished_trials() {
    let folder = tempfile::tempdir().unwrap();
    let setup = recording(folder.path());
    let hidden = Axis::integers(AxisKind::Hidden, [2, 3, 4]);
    let drawn = TrialSamples::Drawn(MemoryBudget::UNLIMITED);
    for (experiment, samples, count) in [
        (small(hidden.clone()), drawn, 9),
        (on_recording(&setup, hidden, None), samples_of(&setup), 6),
    ] {
        let trials_after = |asked_at_most: usize| {
            let asked = AtomicUsize::new(0);
            let mut results = ExperimentResults::new(experiment.clone());
            let mut finished = 0;
            run_experiments(
                std::slice::from_ref(&experiment),
                &samples,
                threads(1),
                || asked.fetch_add(1, Ordering::Relaxed) >= asked_at_most,
                |one| {
                    finished += 1;
                    assert_eq!((one.experiment, one.done), (0, finished));
                    results.record(one.cell, one.outcome);
                },
            )
            .unwrap();
            (results, finished, asked.into_inner())
        };
        let (whole, finished, asked) = trials_after(usize::MAX);
        assert!(finished == count && whole.is_complete());
        let (results, finished, _) = trials_after(asked / 2);
        assert!((2..count).contains(&finished) && !results.is_complete());
        let kept = timeless(std::slice::from_ref(&results));
        assert_eq!(kept.iter().map(Vec::len).sum::<usize>(), finished);
        for (kept, whole) in kept.iter().zip(&timeless(&[whole])) {
            assert!(kept.iter().all(|trial| whole.contains(trial)));
        }
        let is_tried_once = finished < 3 || kept.iter().all(|trials| !trials.is_empty());
        assert!(is_tried_once, "every cell is tried once before any twice");
    }
}

#[test]
fn cancelling_does_not_wait_for_a_training_to_end() {
    let mut experiment = small(Axis::integers(AxisKind::Hidden, [3]));
    experiment.base.training.stopping.epochs = 1_000_000;
    experiment.base.training.stopping.max_fail = 1_000_000;
    experiment.base.training.method = Method::all()[7];
    for experiment in [
        experiment.clone(),
        Experiment {
            cross_validation: Some(CrossValidation::default()),
            ..experiment
        },
    ] {
        let asked = AtomicUsize::new(0);
        let is_cancelled = || asked.fetch_add(1, Ordering::Relaxed) >= 50;
        run_experiments(
            &[experiment],
            &TrialSamples::Drawn(MemoryBudget::UNLIMITED),
            threads(2),
            is_cancelled,
            |one| panic!("{one:?}"),
        )
        .unwrap();
        assert!((51..=60).contains(&asked.into_inner()));
    }
}

#[test]
fn a_cell_that_cannot_be_trained_gives_the_reason_and_the_others_continue() {
    let mut settings = small_settings();
    settings.simulation_mut().unwrap().sensor = SensorModel::new("1x32_5x96".parse().unwrap());
    let mut experiment = small(Axis::integers(AxisKind::Hidden, [2, 512]));
    experiment.base = settings;
    experiment.base.starts = 1;
    experiment.base.training.method = Method::named("br").unwrap();
    let results = &run(&[experiment], 2)[0];
    assert!(results.is_complete());
    assert_eq!((results.cells[0].trials.len(), results.cells[0].failures.len()), (3, 0));
    assert_eq!((results.cells[1].trials.len(), results.cells[1].failures.len()), (0, 3));
    let message = results.cells[1].failures[0].to_string();
    assert!(
        message.contains("seed 0") && message.contains("memory") && message.contains("hidden nodes"),
        "{message}"
    );
    assert_eq!(results.cells[1].percent().median, None);
}

#[test]
fn cells_with_networks_worse_than_the_mean_are_named() {
    let mut experiment = small(Axis::integers(AxisKind::Epochs, [1, 60]));
    experiment.base.training.method = Method::named("gd").unwrap();
    let results = &run(&[experiment], 2)[0];
    let z_mm = |errors: &TestErrors| errors.nodes().unwrap().z_mm;
    let worse = |cell: usize| {
        let trials = results.cells[cell].trials.iter();
        trials
            .filter(|trial| z_mm(&trial.scores.network) > z_mm(&trial.scores.baselines.mean))
            .count()
    };
    assert!(worse(0) > 0, "one epoch of gradient descent is not enough");
    let sentences = describe_worse_than_mean(results);
    assert_eq!(sentences.len(), (0..2).filter(|&cell| worse(cell) > 0).count());
    let beginning = format!(
        "At {}, {} of 3 are worse",
        results.cell_labels(&results.cells[0]).join(", "),
        worse(0)
    );
    assert!(sentences[0].starts_with(&beginning), "{sentences:?}");
}

/// A recording of two forces, read through four channels in nine presses, and the setup of runs on it.
fn recording(folder: &Path) -> Setup {
    let mut text = "press,a,b,c,d,fx,fz (N)\n".to_owned();
    for sample in 0..72 {
        let press = sample / 8;
        let (x, z) = (
            (0.7 * f64::from(sample)).sin(),
            (0.31 * f64::from(sample)).cos() + 0.1 * f64::from(press),
        );
        let readings = [x + 0.2 * z * z, z - 0.3 * x * z, (x + z).tanh(), 0.5 * x - z];
        let readings = readings.map(|reading| format!("{reading:.5}")).join(",");
        text += &format!("{press},{readings},{x:.5},{z:.5}\n");
    }
    fs::write(folder.join("forces.csv"), text).unwrap();
    let plan = Plan {
        import: Recipe {
            data: folder.join("forces.csv"),
            inputs: ["a", "b", "c", "d"].map(str::to_owned).to_vec(),
            targets: ["fx", "fz"].map(str::to_owned).to_vec(),
            group: Some("press".to_owned()),
            ..Recipe::default()
        },
        ..Plan::default()
    };
    let mut settings = RunSettings::measured(RowModel::Shared);
    settings.hidden = 3;
    settings.training.stopping.epochs = 6;
    Setup::recording(settings, plan)
}

fn on_recording(setup: &Setup, axis: Axis, second_axis: Option<Axis>) -> Experiment {
    Experiment {
        base: *setup.settings(),
        recording: setup.experiment_recording(),
        axis,
        second_axis,
        seeds: 2,
        cross_validation: None,
    }
}

fn samples_of(setup: &Setup) -> TrialSamples {
    setup
        .trial_samples(Path::new(""), &Job::UNINTERRUPTED, &mut |_| {})
        .unwrap()
}

#[test]
fn a_trial_on_a_recording_equals_the_run_with_its_settings_and_division() {
    let folder = tempfile::tempdir().unwrap();
    let setup = recording(folder.path());
    let methods = Axis::names(AxisKind::Method, ["br", "lm"]);
    let splits = Axis::names(AxisKind::Split, SplitBy::ALL);
    let experiment = on_recording(&setup, methods, Some(splits));
    let results = run_on(std::slice::from_ref(&experiment), &samples_of(&setup), 2).remove(0);
    assert!(results.is_complete());
    for (place, cell) in results.cells.iter().enumerate() {
        assert!(cell.failures.is_empty(), "{:?}", cell.failures);
        for (trial, seed) in cell.trials.iter().zip([Seed(0), Seed(1)]) {
            let mut plan = setup.plan().unwrap().clone();
            plan.division.by = SplitBy::ALL[place / 2];
            // Levenberg-Marquardt needs samples for validation, Bayesian regularisation none.
            plan.division.validation_fraction = Some([0.0, 0.2][place % 2]);
            let divided = || {
                let watch = &mut |_| ControlFlow::Continue(());
                let recording = plan.recording(Path::new(""), watch).unwrap();
                plan.divide(&recording, None, seed).unwrap()
            };
            let (split, test) = divided();
            assert_eq!(split.validation.is_some(), place % 2 == 1);
            let mut settings = *setup.settings();
            settings.seed = seed;
            settings.training.method = [Method::recorded_regularization(), Method::default()][place % 2];
            let mut alone =
                Run::with_baselines(settings, RunSets::new(split, test), None, &Job::UNINTERRUPTED).unwrap();
            while alone.step().is_none() {}
            assert_eq!(trial.seed, seed);
            assert_eq!(trial.scores.network, alone.errors(), "cell {place}");
            let baselines = alone.baselines().unwrap();
            assert_eq!(
                [&trial.scores.baselines.mean, &trial.scores.baselines.linear],
                [&baselines.mean, &baselines.linear]
            );
            let (split, test) = divided();
            let taken_up = Run::with_baselines(
                settings,
                RunSets::new(split, test),
                Some(trial.states.clone()),
                &Job::UNINTERRUPTED,
            )
            .unwrap();
            assert_eq!(taken_up.network(), alone.network());
        }
        let r2 = cell.error(ErrorMeasure::R2).expect("a recording has targets");
        let mean_r2 = |trial: &Trial| {
            let targets = trial.scores.network.targets();
            Some((targets[0].r2.unwrap() + targets[1].r2.unwrap()) / 2.0)
        };
        assert_eq!(r2.values, cell.trials.iter().map(mean_r2).collect::<Vec<_>>());
        assert_eq!(
            cell.percent().values,
            cell.trials
                .iter()
                .map(|trial| trial.scores.network.percent())
                .collect::<Vec<_>>()
        );
    }
    // A split by time has the same test samples for each seed; other splits are drawn.
    let ridge = |cell: usize| {
        let trials = results.cells[cell].trials.iter();
        trials
            .map(|trial| trial.scores.baselines.linear.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(ridge(0)[0], ridge(0)[1]);
    assert_ne!(ridge(2)[0], ridge(2)[1]);
    assert_ne!(ridge(4)[0], ridge(4)[1]);
    let again = run_on(&[experiment], &samples_of(&setup), 3);
    assert_eq!(timeless(&[results]), timeless(&again), "on any number of threads");
}

#[test]
fn axes_belong_to_their_source() {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = recording(folder.path());
    let message = |experiment: &Experiment| experiment.check().unwrap_err().to_string();
    for axis in [
        Axis::integers(AxisKind::Samples, [10]),
        Axis::parse(AxisKind::Noise, ["0.1"]).unwrap(),
        Axis::names(AxisKind::Array, [ArrayScale::default()]),
    ] {
        let name = axis.kind.name();
        let expected = format!("recordings have no setting '{name}': vary another one");
        assert_eq!(message(&on_recording(&setup, axis, None)), expected);
    }
    let split = Axis::names(AxisKind::Split, [SplitBy::Time, SplitBy::Group]);
    let array = small(split.clone());
    assert_eq!(
        message(&array),
        "simulated arrays have no setting 'split': vary another one"
    );
    let by_group = on_recording(&setup, split.clone(), None);
    by_group.check().unwrap();
    let mut plan = setup.plan().unwrap().clone();
    plan.import.group = None;
    setup = Setup::recording(*setup.settings(), plan);
    assert!(message(&on_recording(&setup, split, None)).contains("no column of groups"));
    let hidden = Axis::integers(AxisKind::Hidden, [2]);
    for (experiment, samples) in [
        (
            on_recording(&setup, hidden.clone(), None),
            TrialSamples::Drawn(MemoryBudget::UNLIMITED),
        ),
        (small(hidden), samples_of(&setup)),
    ] {
        let refused = run_experiments(&[experiment], &samples, threads(1), || false, |one| panic!("{one:?}"));
        assert_eq!(refused, Err(RunError::OtherSamples));
    }
}

#[test]
fn tables_of_a_recording_have_its_error_measures_and_target_names() {
    let folder = tempfile::tempdir().unwrap();
    let setup = recording(folder.path());
    let experiment = on_recording(&setup, Axis::integers(AxisKind::Hidden, [2, 4]), None);
    let samples = samples_of(&setup);
    let mut results = run_on(std::slice::from_ref(&experiment), &samples, 2).remove(0);
    let TrialSamples::Recorded { problem, .. } = &samples else {
        panic!("the samples are recorded");
    };
    results.problem = Some(Arc::clone(problem));
    let ExperimentTable { table, .. } = ExperimentTable::new(&results);
    let headings: Vec<_> = table.columns.iter().map(|column| column.heading.as_str()).collect();
    assert_eq!(
        headings,
        [
            "hidden nodes",
            "error % median",
            "min",
            "max",
            "R² median",
            "mean %",
            "ridge %",
            "epochs",
            "training time"
        ],
        "nothing is published for a recording"
    );
    assert!(table.rows.iter().all(|row| row.len() == headings.len()));
    assert_eq!(
        describe_conditions(&experiment),
        "forces, Bayesian regularisation, 6 epochs, one restart, 2 seeds from 0, the last 20 % of the samples for test"
    );
    let trials = trials_table(&results);
    let fields: Vec<_> = trials.columns.iter().map(|column| column.field.as_str()).collect();
    assert_eq!(
        fields[..7],
        ["split", "scaling", "hidden", "method", "epochs", "seed", "repeat"]
    );
    assert_eq!(fields[7..11], ["percent_of_range", "r2", "fx.rmse", "fx.mae"]);
    assert_eq!(trials.rows.len(), 4);
    let mut markdown = Vec::new();
    write_experiment_markdown("Forces", "", &results, &mut markdown).unwrap();
    let markdown = String::from_utf8(markdown).unwrap();
    assert!(markdown.contains("| ridge % |") && markdown.contains("percent of the range"));
    assert!(!markdown.contains("Z %"), "{markdown}");
}
