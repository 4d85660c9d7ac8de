//! Measured samples in the library: training and tables without any geometry.

use decoupler_core::{
    dataset::{Dataset, PerRow, Split},
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderSet, ErrorTable, Run, RunError, RunSets, RunSettings, Source},
    job::Job,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::RowModel,
};
use decoupler_files::export::{CheckpointFile, NetworkFile};
use ndarray::{Array2, Axis};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

/// Two targets measured by four readings of either sign, scaled by a factor for each row-wire `r`; noise of 1e-3.
fn recording(samples: usize, rows: &[usize], seed: u64) -> Dataset {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let targets = Array2::from_shape_simple_fn((samples, 2), || rng.random_range(-1.0..1.0));
    let row_wires: Vec<usize> = (0..samples).map(|sample| rows[sample % rows.len()]).collect();
    let readings = Array2::from_shape_fn((samples, 4), |(sample, channel)| {
        let (x, y, row): (f64, f64, f64) = (targets[[sample, 0]], targets[[sample, 1]], row_wires[sample] as f64);
        let clean = [x + 0.3 * y * y, y - 0.2 * x, (x + y).sin(), x * y][channel];
        (1.0 + row) * clean + 1e-3 * rng.random_range(-1.0..1.0)
    });
    let groups = (0..samples).map(|sample| sample / (5 * rows.len())).collect();
    Dataset::new(readings, targets, Some(&row_wires), groups).unwrap()
}

fn settings(rows: RowModel) -> RunSettings {
    let mut settings = RunSettings::measured(rows);
    settings.hidden = 6;
    settings.training.stopping.epochs = 60;
    settings
}

fn split(set: &Dataset, first_test: usize) -> (Split, Dataset) {
    let numbers = |range: std::ops::Range<usize>| set.select(&range.collect::<Vec<_>>());
    let validation = first_test * 4 / 5;
    let split = Split {
        training: numbers(0..validation),
        validation: Some(numbers(validation..first_test)),
    };
    (split, numbers(first_test..set.samples()))
}

fn trained(settings: RunSettings, set: &Dataset, first_test: usize) -> Run {
    let (split, test) = split(set, first_test);
    let mut run = Run::with_baselines(settings, RunSets::new(split, test), None, &Job::UNINTERRUPTED).unwrap();
    while run.step().is_none() {}
    run
}

#[test]
fn a_network_learns_a_nonlinear_map_that_a_linear_map_cannot() {
    let run = trained(settings(RowModel::Shared), &recording(600, &[0], 0), 500);
    assert!(matches!(run.settings().source, Source::Measured { .. }));
    let scores = run.scores().unwrap();
    let tables = ErrorTable::of_scores(run.problem(), &scores, None);
    for block in &tables {
        let names = Vec::from_iter(block.rows.iter().map(|row| row.name));
        assert_eq!(names, ["training mean", "ridge", "network"]);
    }
    let baselines = &scores.baselines;
    for target in 0..2 {
        let errors = [&baselines.mean, &baselines.linear, &scores.network];
        let [mean, linear, network] = errors.map(|errors| errors.targets()[target].rmse);
        // Uniform targets on [−1, 1] deviate by 1/√3.
        assert!((mean - 1.0 / 3.0_f64.sqrt()).abs() < 0.1, "{mean}");
        assert!(
            linear < 0.7 * mean && network < 0.2 * linear,
            "{target}: {mean} {linear} {network}"
        );
    }
    let targets = scores.network.targets();
    assert!(targets.iter().all(|target| target.r2.unwrap() > 0.999));
    assert_eq!(scores.network.nodes(), None, "there are no nodes");
    assert_eq!(baselines.model_based, None, "there is no model of the sensor");
}

#[test]
fn networks_of_known_rows_use_the_row_wire_of_each_sample() {
    // Rows interleaved, not numbered from 0, and with gaps.
    let set = recording(1200, &[7, 2, 4], 1);
    let [shared, each] = [RowModel::Shared, RowModel::Each].map(|rows| trained(settings(rows), &set, 1050));
    assert_eq!((shared.network().values().len(), each.network().values().len()), (1, 3));
    let rmse = |run: &Run| run.errors().targets()[0].rmse;
    assert!(rmse(&each) < 0.5 * rmse(&shared), "{} {}", rmse(&each), rmse(&shared));
    // The same samples in another order give the same answers.
    let test = each.test();
    let backwards: Vec<usize> = (0..test.samples()).rev().collect();
    let mut answers = each.network().decouple(&test.select(&backwards));
    answers.invert_axis(Axis(0));
    assert_eq!(answers, each.decouple_test());
}

#[test]
fn every_decoder_without_a_sensor_model_is_measured() {
    let set = recording(600, &[0, 1], 4);
    let mut settings = settings(RowModel::Each);
    settings.inputs = InputChoice {
        quantity: Quantity::Raw,
        scaling: ScalingChoice::Whitening,
    };
    let run = trained(settings, &set, 500);
    let (split, test) = split(&set, 500);
    let decoders = DecoderSet::new(settings, split.training, Some(run.network()));
    for kind in DecoderKind::ALL {
        let report = decoders.measure(kind, Precision::Double, &test).unwrap();
        assert_eq!(report.is_none(), kind.needs_sensor(), "{kind}");
        let is_offered = DecoderSet::kinds(run.problem()).any(|(offered, _)| offered == kind);
        assert_eq!(is_offered, report.is_some(), "{kind}");
        if let Some(report) = report {
            let targets = report.errors.targets();
            assert!(targets.iter().all(|target| target.rmse.is_finite()), "{kind}");
            assert_eq!(targets[0].rmse < 0.4, kind != DecoderKind::Mean, "{kind}: {targets:?}");
            assert_eq!(report.residual, None, "there is no model of the sensor");
        }
    }
}

#[test]
fn mismatched_sets_are_named() {
    let set = recording(100, &[0, 1], 6);
    let (training, _) = split(&set, 80);
    let run = |rows, split: &Split, test| {
        let sets = RunSets::new(split.clone(), test);
        let run = Run::with_baselines(settings(rows), sets, None, &Job::UNINTERRUPTED);
        run.err().unwrap().to_string()
    };
    let narrow = Dataset::new(
        Array2::zeros((4, 3)),
        Array2::zeros((4, 2)),
        Some(&[0, 1, 0, 1]),
        vec![0; 4],
    )
    .unwrap();
    let message = run(RowModel::Shared, &training, narrow);
    assert!(
        message.contains("the test set has 3 channels, the training set 4"),
        "{message}"
    );
    let message = run(RowModel::Each, &training, recording(10, &[0], 7));
    assert!(
        message.contains("the test set has the row-wires 1, the training set the row-wires 1, 2"),
        "{message}"
    );
    let one_row = |set: &Dataset| set.of_row(0);
    let lacking = Split {
        training: one_row(&training.training),
        validation: training.validation.clone(),
    };
    let message = run(RowModel::Each, &lacking, set.clone());
    assert!(message.contains("row 2 has no training samples"), "{message}");
    let simulated = RunSettings {
        hidden: 2,
        ..RunSettings::default()
    };
    let nameless = Dataset::new(Array2::zeros((4, 3)), Array2::zeros((4, 2)), None, vec![0; 4]).unwrap();
    let nameless = Split {
        training: nameless.clone(),
        validation: None,
    };
    let test = nameless.training.clone();
    assert!(matches!(
        Run::with_baselines(simulated, RunSets::new(nameless, test), None, &Job::UNINTERRUPTED),
        Err(RunError::NoRowWires)
    ));
}

#[test]
fn the_error_on_a_test_set_without_a_row_lists_the_rows() {
    let set = recording(400, &[0, 1], 8);
    let (split, _) = split(&set, 300);
    let test = recording(50, &[1], 9).among_rows(&[0, 1]).unwrap();
    let mut run = Run::with_baselines(
        settings(RowModel::Each),
        RunSets::new(split, test),
        None,
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    while run.step().is_none() {}
    assert!(run.errors().targets()[0].rmse < 0.05);
}

#[test]
fn files_refuse_recorded_samples_without_a_plan() {
    let run = trained(settings(RowModel::Shared), &recording(60, &[0], 10), 50);
    let message = NetworkFile::from_run(&run, None).unwrap_err().to_string();
    assert!(message.contains("give the plan"), "{message}");
    let message = CheckpointFile::from_run(&run, None).unwrap_err().to_string();
    assert!(message.contains("give the plan"), "{message}");
    // The networks themselves are written by serde.
    let text = serde_json::to_string(&run.network()).unwrap();
    let read: PerRow<_> = serde_json::from_str(&text).unwrap();
    assert_eq!(read, run.network());
}
