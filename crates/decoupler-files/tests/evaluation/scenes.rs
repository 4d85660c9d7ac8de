//! Scenes from settings to answers: known rows, single rows, noise, sideways movement.

use std::path::Path;

use decoupler_core::{
    dataset::{Seed, Simulation},
    decoupling::{DecoderKind, Precision},
    evaluation::{
        DecoderSet, Outlook, Preset, Run, RunError, RunSets, RunSettings, TradeOffPoint, TrainingSize, fastest_under,
        measure_trade_off, most_accurate_under,
    },
    job::Job,
    machine::MemoryBudget,
    scene::{Movement, Noise, Rows},
    sensor::SensorModel,
};
use decoupler_files::import::Setup;

/// Known rows of a small array, quick to train.
fn small() -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("3x4_2x12".parse().unwrap()),
            samples: 900,
            validation_samples: 90,
            test_samples: 60,
            ..*Preset::Best.settings().simulation().unwrap()
        }
        .into(),
        hidden: 6,
        ..Preset::Best.settings()
    };
    settings.training.stopping.epochs = 60;
    settings
}

fn trained(settings: RunSettings) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

fn z_percent(run: &Run, kind: DecoderKind, precision: Precision) -> f64 {
    let sets = RunSets::draw(run.settings(), MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
    let set = DecoderSet::new(*run.settings(), sets.split.training, Some(run.network()));
    let report = set.measure(kind, precision, run.test()).unwrap().unwrap();
    report.errors.percent().unwrap()
}

#[test]
fn knowing_the_row_makes_small_networks_accurate_and_newton_makes_them_exact() {
    let run = trained(small());
    assert_eq!(run.network().values().len(), 3);
    let errors = *run.errors().nodes().unwrap();
    assert!(errors.z_percent.unwrap() < 0.05, "{errors:?}");
    assert_eq!(errors.x_percent, Some(0.0), "a constant coordinate has no error");
    let z = |kind, precision| z_percent(&run, kind, precision);
    let network = z(DecoderKind::Network, Precision::Double);
    assert!((network - errors.z_percent.unwrap()).abs() < 1e-6);
    assert!(z(DecoderKind::Network, Precision::Single) < network + 0.01);
    for kind in [DecoderKind::Newton, DecoderKind::Polish] {
        let exact = z(kind, Precision::Double);
        assert!(exact < 1e-9, "{kind}: {exact}");
    }
    for (kind, most) in [
        (DecoderKind::Ridge, 1.0),
        (DecoderKind::RadialBasis, 1.0),
        (DecoderKind::Mean, 7.0),
    ] {
        let error = z(kind, Precision::Double);
        assert!(error < most, "{kind}: {error}");
    }
    let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(again.install(|| trained(small())).network(), run.network());
}

#[test]
fn unknown_rows_are_identified() {
    let mut settings = small();
    settings.simulation_mut().unwrap().scene.rows = Rows::All;
    settings.training.stopping.epochs = 20;
    let run = trained(settings);
    assert_eq!(run.network().values().len(), 1);
    assert!(z_percent(&run, DecoderKind::Newton, Precision::Double) < 1e-9);
    settings.simulation_mut().unwrap().scene.noise = Noise::relative(1e-5);
    let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
    let set = DecoderSet::new(settings, sets.split.training, None);
    let test = settings.simulation().unwrap().draw_test(settings.seed).unwrap();
    let report = set
        .measure(DecoderKind::Newton, Precision::Double, &test)
        .unwrap()
        .unwrap();
    assert_eq!(
        report.errors.nodes().unwrap().x_percent,
        Some(0.0),
        "every row is the right one"
    );
    assert!(
        set.decoder(DecoderKind::Polish, Precision::Double).unwrap().is_none(),
        "it has no network"
    );
}

#[test]
fn with_one_row_only_that_row_is_drawn_and_modelled() {
    let mut settings = small();
    settings.simulation_mut().unwrap().scene.rows = Rows::One(2);
    settings.simulation_mut().unwrap().samples = 300;
    let run = trained(settings);
    assert_eq!(run.test().row_count(), 1);
    assert_eq!(run.test().samples(), 60);
    assert!(run.test().targets().iter().step_by(3).all(|&x| x == 10.0));
    let size = |settings: &RunSettings| TrainingSize::drawn(settings).unwrap();
    assert_eq!((size(&settings).targets, size(&settings).networks), (4, 1));
    assert!(z_percent(&run, DecoderKind::Polish, Precision::Double) < 1e-9);
    assert_eq!((size(&small()).targets, size(&small()).networks), (4, 3));
    settings.simulation_mut().unwrap().scene.movement = Movement::SIDEWAYS;
    assert_eq!(size(&settings).targets, 12);
    settings.simulation_mut().unwrap().scene.rows = Rows::One(3);
    assert!(Run::prepare(settings).is_err(), "there is no fourth row");
    settings.simulation_mut().unwrap().scene.rows = Rows::One(2);
    let mut scene = Preset::Best.settings();
    let upright = Outlook::of(scene.simulation().unwrap()).unwrap();
    assert!(upright.warnings.is_empty());
    scene.simulation_mut().unwrap().scene.movement = Movement::SIDEWAYS;
    let sideways = Outlook::of(scene.simulation().unwrap()).unwrap();
    assert!(!sideways.warnings.is_empty(), "ill-conditioned");
}

#[test]
fn a_trade_off_has_a_point_for_every_choice() {
    let mut settings = RunSettings {
        source: Simulation {
            samples: 90,
            ..*small().simulation().unwrap()
        }
        .into(),
        seed: Seed(3),
        ..small()
    };
    settings.training.stopping.epochs = 3;
    let mut points: Vec<TradeOffPoint> = Vec::new();
    let keep = |_, point: Result<_, _>, _: Option<&_>| points.push(point.unwrap());
    let sets = Setup::from(settings).sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ());
    let sets = sets.unwrap().sets;
    measure_trade_off(&settings, &sets, &[2, 3], &DecoderKind::ALL, &Job::UNINTERRUPTED, keep).unwrap();
    // Five without a network; network in two precisions and polish, each with two numbers of hidden nodes.
    assert_eq!(points.len(), 5 + 2 * 3);
    assert_eq!(points.iter().filter(|point| point.hidden() == Some(3)).count(), 3);
    let best = &points[most_accurate_under(&points, f64::INFINITY).unwrap()];
    assert!(matches!(best.report.kind, DecoderKind::Newton | DecoderKind::Polish));
    assert!(fastest_under(&points, -1.0).is_none());
    let fastest = &points[fastest_under(&points, f64::INFINITY).unwrap()];
    assert!(
        points
            .iter()
            .all(|point| fastest.report.frame_us <= point.report.frame_us)
    );
    let mut none = 0;
    let count = |_, _: Result<_, _>, _: Option<&_>| none += 1;
    let cancelled = Job::new(&|| true);
    let measured = measure_trade_off(&settings, &sets, &[2], &DecoderKind::ALL, &cancelled, count);
    assert!(matches!(measured, Err(RunError::Cancelled(_))));
    assert_eq!(none, 0);
}
