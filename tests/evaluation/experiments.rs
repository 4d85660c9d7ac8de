//! The paper's experiments and sweeps.

use std::{
    num::NonZero,
    sync::atomic::{AtomicUsize, Ordering},
};

use decoupler::{
    dataset::{FoldUnit, Seed},
    evaluation::{
        CrossValidation, Run, SimulatedSettings, Simulation,
        experiments::{Axis, Bottleneck, Experiment, ExperimentResults, Trial, run_experiments},
    },
    export::describe_worse_than_mean,
    sensor::SensorModel,
    training::Method,
};

/// Of a second at most: a small array, few samples, few epochs.
fn small(axis: Axis) -> Experiment {
    let mut base = SimulatedSettings {
        source: Simulation {
            sensor: SensorModel::new("4x2_1x6".parse().unwrap()),
            samples: 40,
            validation_samples: 12,
            test_samples: 20,
            ..Simulation::default()
        },
        hidden: 3,
        starts: 2,
        ..SimulatedSettings::default()
    };
    base.training.stopping.epochs = 8;
    Experiment {
        base,
        axis,
        second_axis: None,
        seeds: 3,
        cross_validation: None,
    }
}

fn cross_validated(unit: FoldUnit) -> Experiment {
    Experiment {
        cross_validation: Some(CrossValidation {
            folds: 4,
            repeats: 2,
            unit,
        }),
        ..small(Axis::Samples(vec![40, 20]))
    }
}

fn threads(count: usize) -> NonZero<usize> {
    NonZero::new(count).unwrap()
}

fn run(experiments: &[Experiment], thread_count: usize) -> Vec<ExperimentResults> {
    let mut results: Vec<_> = experiments.iter().cloned().map(ExperimentResults::new).collect();
    run_experiments(
        experiments,
        threads(thread_count),
        || false,
        |finished| {
            results[finished.experiment].record(finished.cell, finished.outcome);
        },
    )
    .unwrap();
    results
}

/// The trials of every cell, without their times.
fn timeless(results: &[ExperimentResults]) -> Vec<Vec<Trial>> {
    let cells = results.iter().flat_map(|results| &results.cells);
    let trials = cells.map(|cell| {
        let timeless = |trial: &Trial| Trial {
            seconds: 0.0,
            least_epoch_seconds: 0.0,
            states: Vec::new(),
            ..trial.clone()
        };
        cell.trials.iter().map(timeless).collect()
    });
    trials.collect()
}

#[test]
fn results_are_the_same_on_any_number_of_threads() {
    let experiments = [
        Experiment {
            second_axis: Some(Axis::Method(Method::all()[..4].to_vec())),
            ..small(Axis::Hidden(vec![2, 5]))
        },
        cross_validated(FoldUnit::Sample),
        cross_validated(FoldUnit::Snapshot),
    ];
    let alone = run(&experiments, 1);
    assert!(alone.iter().all(ExperimentResults::is_complete));
    assert_eq!(timeless(&alone), timeless(&run(&experiments, 3)));
    let counts: Vec<_> = timeless(&alone).iter().map(Vec::len).collect();
    assert_eq!(counts, [vec![3; 8], vec![6; 4]].concat());
}

#[test]
fn a_trial_is_the_run_that_its_settings_describe() {
    let experiment = small(Axis::Hidden(vec![2, 4]));
    for cell in &run(std::slice::from_ref(&experiment), 2)[0].cells {
        let mut z_percent = Vec::new();
        for (trial, seed) in cell.trials.iter().zip(0..3) {
            let settings = SimulatedSettings {
                seed: Seed(seed),
                ..cell.cell.settings
            };
            let mut alone = Run::prepare(settings).unwrap();
            while alone.step().is_none() {}
            assert_eq!(trial.seed, Seed(seed));
            let scores = alone.scores().unwrap().nodes().unwrap();
            assert_eq!(trial.errors, scores.network);
            assert_eq!(trial.baselines, scores.baselines);
            let taken_up = Run::resume(settings, trial.states.clone()).unwrap();
            assert_eq!(taken_up.network(), alone.network());
            assert_eq!(taken_up.stop_reason(), alone.stop_reason());
            z_percent.push(scores.network.z_percent.unwrap());
        }
        z_percent.sort_by(f64::total_cmp);
        let summary = cell.summary();
        let z = &summary.z_percent;
        assert_eq!([z.min, z.median, z.max].map(Option::unwrap), z_percent[..]);
        let median = cell.median_trial().unwrap();
        assert_eq!(median.errors.z_percent, Some(z_percent[1]));
    }
}

#[test]
fn cross_validation_decouples_every_sample_by_what_has_not_seen_it() {
    for unit in [FoldUnit::Sample, FoldUnit::Snapshot] {
        let mut experiment = cross_validated(unit);
        // As many hidden nodes as coordinates vary: nothing is lost in them.
        experiment.base.hidden = 6;
        for cell in &run(&[experiment], 2)[0].cells {
            for trial in &cell.trials {
                // A sample left out would be decoupled as (0, 0, 0), 4 mm below any node.
                assert!(trial.baselines.mean.worst_mm < 1.0, "{unit}: {trial:?}");
                assert!(trial.errors.worst_mm < 4.0, "{unit}: {trial:?}");
                assert!(trial.bottleneck.worst_mm < 1e-12, "{unit}: {trial:?}");
                assert_eq!((trial.networks, trial.states.is_empty()), (4, true));
            }
            let [first, second] = [0, 1].map(|repeat| &cell.trials[repeat]);
            assert_eq!(first.seed, second.seed);
            assert_ne!(first.errors, second.errors, "each repeat deals anew");
        }
    }
}

#[test]
fn cancelling_keeps_what_is_finished() {
    let experiment = small(Axis::Hidden(vec![2, 3, 4]));
    let trials_after = |asked_at_most: usize| {
        let asked = AtomicUsize::new(0);
        let mut results = ExperimentResults::new(experiment.clone());
        let mut finished = 0;
        run_experiments(
            std::slice::from_ref(&experiment),
            threads(1),
            || asked.fetch_add(1, Ordering::Relaxed) >= asked_at_most,
            |one| {
                assert_eq!((one.trials, one.experiment), (9, 0));
                finished += 1;
                assert_eq!(one.done, finished);
                results.record(one.cell, one.outcome);
            },
        )
        .unwrap();
        (results, finished, asked.into_inner())
    };
    let (whole, finished, asked) = trials_after(usize::MAX);
    assert!(finished == 9 && whole.is_complete());
    let (results, finished, _) = trials_after(asked / 2);
    assert!((3..9).contains(&finished) && !results.is_complete());
    let kept = timeless(std::slice::from_ref(&results));
    assert_eq!(kept.iter().map(Vec::len).sum::<usize>(), finished);
    for (kept, whole) in kept.iter().zip(&timeless(&[whole])) {
        assert!(kept.iter().all(|trial| whole.contains(trial)));
    }
    assert!(
        kept.iter().all(|trials| !trials.is_empty()),
        "every cell is tried once before any twice"
    );
}

#[test]
fn cancelling_does_not_wait_for_a_training_to_end() {
    let mut experiment = small(Axis::Hidden(vec![3]));
    experiment.base.training.stopping.epochs = 1_000_000;
    experiment.base.training.stopping.max_fail = 1_000_000;
    experiment.base.training.method = Method::all()[8];
    for experiment in [
        experiment.clone(),
        Experiment {
            cross_validation: Some(CrossValidation::default()),
            ..experiment
        },
    ] {
        let asked = AtomicUsize::new(0);
        let is_cancelled = || asked.fetch_add(1, Ordering::Relaxed) >= 50;
        run_experiments(&[experiment], threads(2), is_cancelled, |one| panic!("{one:?}")).unwrap();
        assert!((51..=60).contains(&asked.into_inner()));
    }
}

#[test]
fn a_cell_that_cannot_be_trained_says_why_and_the_others_go_on() {
    let mut experiment = small(Axis::Hidden(vec![2, 512]));
    experiment.base.source.sensor = SensorModel::new("1x32_5x96".parse().unwrap());
    experiment.base.starts = 1;
    let by_name = |method: &Method| method.to_string().contains("Bayesian");
    experiment.base.training.method = Method::all().into_iter().find(by_name).unwrap();
    let results = &run(&[experiment], 2)[0];
    assert!(results.is_complete());
    assert_eq!((results.cells[0].trials.len(), results.cells[0].failures.len()), (3, 0));
    assert_eq!((results.cells[1].trials.len(), results.cells[1].failures.len()), (0, 3));
    let message = results.cells[1].failures[0].to_string();
    assert!(
        message.contains("seed 0") && message.contains("memory") && message.contains("hidden nodes"),
        "{message}"
    );
    assert_eq!(results.cells[1].summary().z_percent.median, None);
}

#[test]
fn cells_with_networks_worse_than_the_mean_are_named() {
    let mut experiment = small(Axis::Epochs(vec![1, 60]));
    let by_name = |method: &Method| method.short_name() == "gd";
    experiment.base.training.method = Method::all().into_iter().find(by_name).unwrap();
    let results = &run(&[experiment], 2)[0];
    let worse = |cell: usize| {
        let trials = results.cells[cell].trials.iter();
        trials
            .filter(|trial| trial.errors.z_mm > trial.baselines.mean.z_mm)
            .count()
    };
    assert!(worse(0) > 0, "one epoch of gradient descent teaches little");
    let told = describe_worse_than_mean(results);
    assert_eq!(told.len(), (0..2).filter(|&cell| worse(cell) > 0).count());
    let beginning = format!(
        "At {}, {} of 3 are worse",
        results.cell_labels(&results.cells[0]).join(", "),
        worse(0)
    );
    assert!(told[0].starts_with(&beginning), "{told:?}");
}

/// Against the property itself: whatever is trained, and however well, the training error stays above.
#[test]
fn no_training_gets_below_the_bound_of_its_hidden_nodes() {
    for seed in 0..4 {
        for hidden in 1..=4 {
            let mut settings = small(Axis::Hidden(vec![hidden])).base;
            settings.hidden = hidden;
            settings.seed = Seed(seed);
            settings.source.sensor = SensorModel::new("3x3_2x9".parse().unwrap());
            settings.source.samples = 12;
            settings.source.validation_samples = 0;
            settings.training.stopping.epochs = 200;
            let (split, _) = settings.draw().unwrap();
            let least = Bottleneck::fit(split.training.targets(), hidden).unwrap().least_mse();
            let mut run = Run::prepare(settings).unwrap();
            while run.step().is_none() {}
            let reached = run.leader().best_mse();
            assert!(
                reached >= least * (1.0 - 1e-9),
                "{hidden} hidden: {reached} below {least}"
            );
            if hidden < 4 {
                assert!(
                    reached < 1.2 * least,
                    "{hidden} hidden: the bound {least} is far below {reached}"
                );
            }
        }
    }
}
