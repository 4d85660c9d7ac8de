//! Scenes from settings to answers: known rows, single rows, noise, sideways movement.

use decoupler_core::{
    dataset::Simulation,
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderSet, Outlook, Preset, Run, RunSets, RunSettings, TrainingSize},
    job::Job,
    machine::MemoryBudget,
    scene::{Movement, Noise, Rows},
    sensor::SensorModel,
};

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
