//! Simulates, then calibrates: fits the geometry of Eq. (2) to frames of known presses, trains on the calibrated model and
//! fine-tunes on the frames: `cargo run --release --example calibrate`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::error::Error;

use decoupler_core::{
    calibration::{Calibration, SensorParameter},
    dataset::{Dataset, Division, Seed, Simulation, Stream},
    evaluation::{Errors, Preset, Run, RunSettings, fine_tune},
    glam::DVec3,
    job::Job,
    machine::MemoryBudget,
    network::Networks,
    scene::{Loading, Noise},
    sensor::SensorModel,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut source = Preset::Best.simulation_in(Noise::default());
    source.sensor.scale = "10x6_3x18".parse()?;
    source.scene.loading = Loading::SmoothField {
        correlation_length_mm: 4.0,
    };
    source.scene.noise = Noise::relative(1e-3);
    source.samples = 4000;
    let mut settings = RunSettings {
        source: source.into(),
        ..Preset::Best.settings()
    };
    settings.training.stopping.epochs = 60;
    let nominal = source.sensor;
    // In place of a recording: 60 frames of a sensor that differs from the drawing, with known presses.
    let mut real = nominal;
    real.geometry.height_mm *= 1.05;
    real.geometry.node_pitch_mm *= 0.95;
    real.geometry.column_node_x0_mm *= 1.05;
    let recorded = |snapshots: usize, seed: u64| -> Result<Dataset, Box<dyn Error>> {
        let scene = source.scene;
        let mut set = Dataset::simulate(&real, &scene, 10 * snapshots, &mut Seed(seed).rng(Stream::Training))?;
        set.disturb(&real, &scene.noise, &mut Seed(seed).rng(Stream::TrainingNoise))?;
        rebased(&set, &real, &nominal) // Only displacements are known, not the true positions.
    };
    let (frames, test) = (recorded(60, 1)?, recorded(100, 2)?);

    let calibration = Calibration::fit(&nominal, &frames)?;
    for parameter in &calibration.parameters {
        println!("{parameter}");
    }
    println!("{}", coverage(&nominal, &real, recorded)?);
    let before = train(settings)?;
    settings.source = Simulation {
        sensor: calibration.model,
        ..source
    }
    .into();
    let calibrated = train(settings)?;
    let moved = |set: &Dataset| rebased(set, &nominal, &calibration.model);
    let division = Division {
        validation_fraction: Some(0.2),
        ..Division::default()
    };
    let (split, _) = division.sets(&moved(&frames)?, Some(&test), Seed(0))?;
    let tuned = fine_tune(
        &calibrated,
        &split,
        settings.training,
        MemoryBudget::UNLIMITED,
        &Job::UNINTERRUPTED,
    )?;
    let (stroke_mm, after) = (source.scene.stroke_mm(&calibration.model.geometry), moved(&test)?);
    let z_mm = |set: &Dataset, networks: &Networks| Errors::measure(set, &networks.decouple(set), stroke_mm).z_mm;
    println!("Z error, nominal geometry:  {:.4} mm", z_mm(&test, &before));
    println!("Z error, calibrated:        {:.4} mm", z_mm(&after, &calibrated));
    println!("Z error, fine-tuned:        {:.4} mm", z_mm(&after, &tuned));
    Ok(())
}

/// Counts, over 50 recordings, how often the true value is within the interval of each parameter, and of all
/// together.
fn coverage(
    nominal: &SensorModel,
    real: &SensorModel,
    recorded: impl Fn(usize, u64) -> Result<Dataset, Box<dyn Error>>,
) -> Result<String, Box<dyn Error>> {
    const SEEDS: u64 = 50;
    let (mut of_each, mut of_all) = ([0; SensorParameter::ALL.len()], 0);
    for seed in 0..SEEDS {
        let calibration = Calibration::fit(nominal, &recorded(60, seed)?)?;
        let holds = SensorParameter::ALL.map(|parameter| {
            let mut fitted = calibration.parameters.iter();
            let fitted = fitted
                .find(|fitted| fitted.parameter == parameter)
                .expect("all are fitted");
            let truth = parameter.of(real);
            match fitted.half_width {
                Some(half_width) => (fitted.value - truth).abs() <= half_width,
                None => fitted.value == truth,
            }
        });
        for (count, holds) in of_each.iter_mut().zip(holds) {
            *count += usize::from(holds);
        }
        of_all += usize::from(holds.iter().all(|&holds| holds));
    }
    let of_each = SensorParameter::ALL.iter().zip(of_each);
    let of_each = Vec::from_iter(of_each.map(|(parameter, count)| format!("{parameter} {count}")));
    Ok(format!(
        "Within its interval, of {SEEDS} recordings: {}; all together {of_all}",
        of_each.join(", ")
    ))
}

/// Returns `set` with coordinates of the model `to` instead of `from`: displacements stay, and rest positions move.
fn rebased(set: &Dataset, from: &SensorModel, to: &SensorModel) -> Result<Dataset, Box<dyn Error>> {
    let rows = (0..set.samples()).map(|sample| set.row_wire(sample));
    let rows: Vec<usize> = rows.collect::<Option<_>>().ok_or("samples without row-wires")?;
    let mut targets = set.targets().to_owned();
    for (mut coordinates, &row) in targets.rows_mut().into_iter().zip(&rows) {
        for node in 0..from.scale.nodes_per_row() {
            let [before, after] = [from, to].map(|model| model.displaced_mm(row, node, DVec3::ZERO));
            for (axis, moved) in (after - before).to_array().into_iter().enumerate() {
                coordinates[3 * node + axis] += moved;
            }
        }
    }
    let moved = Dataset::new(set.readings().to_owned(), targets, Some(&rows), set.groups().to_vec())?;
    Ok(moved.among_rows(set.row_wires_read().unwrap_or_default())?)
}

fn train(settings: RunSettings) -> Result<Networks, Box<dyn Error>> {
    let mut run = Run::prepare(settings)?;
    while run.step().is_none() {}
    Ok(run.network())
}
