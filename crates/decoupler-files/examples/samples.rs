//! Makes the files in `assets/samples`: a small network, a recording that it decodes, and a table of one row-wire with the
//! deformation of its nodes, all simulated: `cargo run --release --example samples -- assets/samples`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::{error::Error, fmt::Write as _, fs, path::PathBuf};

use decoupler_core::{
    dataset::{Seed, Simulation},
    evaluation::{Run, RunSettings},
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Noise, Rows},
};
use decoupler_files::{
    export::NetworkFile,
    live::{Recorder, Simulated},
};

/// Enough for smooth motion, and keeps the file small.
const FRAMES_PER_SECOND: f64 = 15.0;
const FRAMES: usize = 60;
/// Number of lines of the table, and its row-wire, from 0.
const LINES: usize = 400;
const ROW: usize = 2;
/// With this noise, six digits of a reading are enough.
const NOISE: f64 = 2e-5;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("target/samples"), PathBuf::from);
    fs::create_dir_all(&folder)?;
    let mut source = Simulation {
        samples: 4000,
        validation_samples: 0,
        test_samples: 200,
        ..Simulation::default()
    };
    source.sensor.scale = "10x6_3x18".parse()?;
    source.scene.rows = Rows::Known;
    source.scene.loading = Loading::Indenter(Indenter::default());
    source.scene.noise = Noise::relative(NOISE);
    let mut settings = RunSettings::from(source);
    settings.inputs = InputChoice {
        quantity: Quantity::Conductance,
        scaling: ScalingChoice::MinMax,
    };
    settings.hidden = 8;
    settings.training.stopping.epochs = 60;
    let mut run = Run::prepare(settings)?;
    while run.step().is_none() {}
    let file = NetworkFile::from_run(&run, None)?;
    file.save(&folder.join("network.json"))?;
    println!(
        "network.json: Z {:.3} %",
        file.scores.network.percent().unwrap_or(f64::NAN)
    );

    let Simulation { sensor, scene, .. } = settings.drawn()?;
    let columns = sensor.scale.columns();
    let mut source = Simulated::new(sensor, scene, Seed(0), FRAMES_PER_SECOND)?;
    let mut frame_ohm = vec![0.0; source.readings()];
    let mut recording = Vec::new();
    let mut recorder = Recorder::new(&mut recording, source.rows(), columns)?;
    for _ in 0..FRAMES {
        let time_s = source.next_frame(&mut frame_ohm)?;
        frame_ohm.iter_mut().for_each(|ohm| *ohm = rounded(*ohm));
        recorder.record(rounded(time_s), &frame_ohm)?;
    }
    fs::write(folder.join("recording.csv"), recording)?;

    let mut table = String::from("time_s");
    (1..=columns).for_each(|column| table += &format!(",r_{column}"));
    (1..=sensor.scale.nodes_per_row()).for_each(|node| table += &format!(",depth_{node}_mm"));
    table.push('\n');
    let mut source = Simulated::new(sensor, scene, Seed(1), FRAMES_PER_SECOND)?;
    for _ in 0..LINES {
        let time_s = source.next_frame(&mut frame_ohm)?;
        write!(table, "{time_s:.3}")?;
        for ohm in &frame_ohm[ROW * columns..][..columns] {
            write!(table, ",{}", rounded(*ohm))?;
        }
        for node in source.deformation().row_mm(ROW) {
            write!(table, ",{:.4}", node.z)?;
        }
        table.push('\n');
    }
    fs::write(folder.join("simulated_row.csv"), table)?;
    Ok(())
}

/// Rounds to six significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
