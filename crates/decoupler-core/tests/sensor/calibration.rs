//! A sensor of unknown geometry: calibrated, trained on its calibrated model, fine-tuned on its frames.

use decoupler_core::{
    calibration::Calibration,
    dataset::{Dataset, Division, Seed, Stream},
    evaluation::{Errors, Preset, Run, RunError, RunSettings, fine_tune},
    glam::DVec3,
    job::Job,
    machine::MemoryBudget,
    network::Networks,
    scene::{Loading, Noise},
    sensor::SensorModel,
};

fn settings() -> RunSettings {
    let mut settings = Preset::Best.settings();
    settings.simulation_mut().unwrap().sensor.scale = "4x4_3x12".parse().unwrap();
    settings.simulation_mut().unwrap().scene.loading = Loading::SmoothField {
        correlation_length_mm: 4.0,
    };
    settings.simulation_mut().unwrap().scene.noise = Noise::relative(1e-3);
    (
        settings.simulation_mut().unwrap().samples,
        settings.simulation_mut().unwrap().validation_samples,
    ) = (600, 100);
    settings.training.stopping.epochs = 25;
    settings.hidden = 6;
    settings
}

fn real(nominal: &SensorModel) -> SensorModel {
    let mut real = *nominal;
    real.geometry.height_mm *= 1.05;
    real.geometry.node_pitch_mm *= 0.95;
    real.geometry.column_node_x0_mm *= 1.05;
    real
}

/// Snapshots of the real sensor with only the displacements known, given as coordinates of the nominal sensor.
fn recorded(settings: &RunSettings, snapshots: usize, seed: u64) -> Dataset {
    let (scene, nominal) = (
        &settings.simulation().unwrap().scene,
        &settings.simulation().unwrap().sensor,
    );
    let real = real(nominal);
    let rows = nominal.scale.rows();
    let mut set = Dataset::simulate(&real, scene, rows * snapshots, &mut Seed(seed).rng(Stream::Training)).unwrap();
    set.disturb(&real, &scene.noise, &mut Seed(seed).rng(Stream::TrainingNoise))
        .unwrap();
    rebased(&set, &real, nominal)
}

/// Returns `set` with coordinates of the model `to` instead of `from`: displacements stay, and rest positions move.
fn rebased(set: &Dataset, from: &SensorModel, to: &SensorModel) -> Dataset {
    let rows = Vec::from_iter((0..set.samples()).map(|sample| set.row_wire(sample).unwrap()));
    let mut targets = set.targets().to_owned();
    for (mut coordinates, &row) in targets.rows_mut().into_iter().zip(&rows) {
        for node in 0..from.scale.nodes_per_row() {
            let [before, after] = [from, to].map(|model| model.displaced_mm(row, node, DVec3::ZERO));
            for (axis, moved) in (after - before).to_array().into_iter().enumerate() {
                coordinates[3 * node + axis] += moved;
            }
        }
    }
    let moved = Dataset::new(set.readings().to_owned(), targets, Some(&rows), set.groups().to_vec());
    moved.unwrap().among_rows(set.row_wires_read().unwrap()).unwrap()
}

fn trained(settings: RunSettings) -> Networks {
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run.network()
}

#[test]
fn calibration_and_fine_tuning_adapt_a_network_to_the_real_sensor() {
    let mut settings = settings();
    let nominal = settings.simulation().unwrap().sensor;
    let (frames, test) = (recorded(&settings, 40, 1), recorded(&settings, 60, 2));
    let calibration = Calibration::fit(&nominal, &frames).unwrap();
    let stroke_mm = settings.simulation().unwrap().stroke_mm();
    let z_mm = |set: &Dataset, networks: &Networks| Errors::measure(set, &networks.decouple(set), stroke_mm).z_mm;
    let before = z_mm(&test, &trained(settings));
    settings.simulation_mut().unwrap().sensor = calibration.model;
    let networks = trained(settings);
    let moved = rebased(&test, &nominal, &calibration.model);
    let calibrated = z_mm(&moved, &networks);
    // The error of a network trained on the real sensor itself.
    settings.simulation_mut().unwrap().sensor = real(&nominal);
    let limit = z_mm(&rebased(&test, &nominal, &real(&nominal)), &trained(settings));
    assert!(calibrated < 0.2 * before, "{before} {calibrated}");
    assert!(calibrated < 1.2 * limit, "{calibrated} {limit}");
    let frames = rebased(&frames, &nominal, &calibration.model);
    let division = Division {
        validation_fraction: Some(0.2),
        ..Division::default()
    };
    let (split, _) = division.sets(&frames, Some(&test), Seed(0)).unwrap();
    let tuned = fine_tune(
        &networks,
        &split,
        settings.training,
        MemoryBudget::UNLIMITED,
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    assert!(z_mm(&moved, &tuned) < 1.2 * calibrated);
    // A network of another sensor improves greatly with the frames.
    settings.simulation_mut().unwrap().sensor = nominal;
    let untold = trained(settings);
    let tuned = fine_tune(
        &untold,
        &split,
        settings.training,
        MemoryBudget::UNLIMITED,
        &Job::UNINTERRUPTED,
    )
    .unwrap();
    assert!(z_mm(&moved, &tuned) < 0.5 * z_mm(&moved, &untold));
    let cancelled = Job::new(&|| true);
    let tuned = fine_tune(&untold, &split, settings.training, MemoryBudget::UNLIMITED, &cancelled);
    assert!(matches!(tuned, Err(RunError::Cancelled(_))));
}

#[test]
fn samples_of_another_sensor_are_refused() {
    let mut settings = settings();
    let split = Division::default().sets(&recorded(&settings, 10, 1), None, Seed(0));
    let (split, _) = split.unwrap();
    settings.simulation_mut().unwrap().sensor.scale = "4x5_3x15".parse().unwrap();
    settings.training.stopping.epochs = 1;
    let message = fine_tune(
        &trained(settings),
        &split,
        settings.training,
        MemoryBudget::UNLIMITED,
        &Job::UNINTERRUPTED,
    )
    .unwrap_err()
    .to_string();
    assert!(message.contains("12 channels, the networks have 15"), "{message}");
}
