//! Breaks wires of a simulated array at random, and prints how often the right one is named and how much leaving it
//! out improves the answer: `cargo run --release --example faults -- [FAULTS [FAULTLESS-FRAMES [ARRAY]]]`; 1000
//! faults and 100 000 frames without a fault take a few minutes.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::error::Error;

use decoupler_core::{
    dataset::{Seed, Simulation, Stream},
    decoupling::Decoder,
    evaluation::{Preset, Run, RunSettings},
    live::{FaultEvent, FaultyWire, WireCheck},
    rand::{Rng, RngExt},
    scene::{Indenter, Loading, Noise},
    sensor::ArrayScale,
};
use decoupler_files::live::{ConverterEnd, Fault, FaultEffect, Simulated};

const KINDS: [&str; 5] = ["open row", "open column", "short columns", "gain", "stuck"];
/// Number of frames between presses that are decoded, and in all with each fault.
const FRAMES: usize = 20;

/// Results for the faults of one kind.
#[derive(Default)]
struct Tally {
    faults: usize,
    right: usize,
    wrong: usize,
    frames: usize,
    /// Sums of absolute errors in mm: frames without a fault, faulty ones by the network, and with the wire left out.
    errors_mm: [f64; 3],
    values: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |index: usize, default: &str| arguments.get(index).map_or(default, String::as_str).to_owned();
    let (faults, frames_without_fault): (usize, usize) = (argument(0, "12").parse()?, argument(1, "500").parse()?);
    let noise = Noise::relative(1e-3);
    let mut source = Preset::Best.simulation_in(noise);
    source.sensor.scale = argument(2, "10x10_5x30").parse()?;
    source.scene.loading = Loading::Indenter(Indenter::default());
    (source.samples, source.validation_samples) = (5000, 1000);
    let mut settings = RunSettings {
        source: source.into(),
        ..Preset::Best.settings_in(noise)
    };
    settings.training.stopping.epochs = 50;
    let mut run = Run::prepare(settings)?;
    while run.step().is_none() {}
    let mut network = run.network().decoder();
    let mut tallies: [Tally; 5] = Default::default();
    let mut rng = Seed(1).rng(Stream::Live);
    for trial in 0..faults {
        let kind = trial % KINDS.len();
        let fault = draw(kind, source.sensor.scale, &mut rng);
        examine(&source, Seed(trial as u64), fault, &mut network, &mut tallies[kind])?;
    }
    println!("fault           right  wrong  of    frames  error: intact faulty  left out (mm)");
    for (name, tally) in KINDS.iter().zip(&tallies) {
        let Tally {
            right, wrong, faults, ..
        } = tally;
        let frames = tally.frames as f64 / (*right).max(1) as f64;
        let [intact, faulty, left_out] = tally.errors_mm.map(|sum| sum / tally.values.max(1) as f64);
        println!(
            "{name:<14} {right:>6} {wrong:>6} {faults:>4} {frames:>8.1}       {intact:.4}  {faulty:.4}    {left_out:.4}"
        );
    }
    let right: usize = tallies.iter().map(|tally| tally.right).sum();
    println!("right wire named: {right} of {faults}");
    let alarms = false_alarms(&source, frames_without_fault)?;
    println!("false alarms: {alarms} in {frames_without_fault} frames without a fault");
    Ok(())
}

/// Draws a fault of one kind. Gain errors are 1 to 20 %.
fn draw(kind: usize, scale: ArrayScale, rng: &mut impl Rng) -> Fault {
    let mut below = |count: usize| rng.random_range(0..count);
    let (row, column) = (below(scale.rows()), below(scale.columns()));
    let (wire, effect) = match kind {
        0 => (FaultyWire::Row(row), FaultEffect::Open(below(scale.nodes_per_row()))),
        1 => {
            let before_node = below(scale.nodes_per_column());
            (FaultyWire::Column(column), FaultEffect::Open(before_node))
        }
        2 => (FaultyWire::Columns(below(scale.columns() - 1)), FaultEffect::Shorted),
        3 => {
            let sign = if below(2) == 0 { 1.0 } else { -1.0 };
            let relative = sign * 0.01 * 20.0_f64.powf(rng.random());
            (FaultyWire::Column(column), FaultEffect::Gain(relative))
        }
        _ => {
            let end = if below(2) == 0 {
                ConverterEnd::Low
            } else {
                ConverterEnd::High
            };
            (FaultyWire::Column(column), FaultEffect::Stuck(end))
        }
    };
    Fault { wire, effect }
}

/// Runs the source with the fault until it is named, and decodes frames with and without the wire.
fn examine(
    simulation: &Simulation,
    seed: Seed,
    fault: Fault,
    network: &mut dyn Decoder,
    tally: &mut Tally,
) -> Result<(), Box<dyn Error>> {
    let Simulation { sensor, scene, .. } = simulation;
    let mut intact = Simulated::new(sensor, scene, seed, 10.0)?;
    let mut source = Simulated::new(sensor, scene, seed, 10.0)?;
    source.set_fault(Some(fault))?;
    let mut check = WireCheck::new(sensor, scene, source.rows())?;
    let (mut intact_ohm, mut frame_ohm) = (vec![0.0; source.readings()], vec![0.0; source.readings()]);
    let mut answer_mm = vec![0.0; source.rows().len() * network.outputs()];
    let mut is_named = false;
    tally.faults += 1;
    for frame in 0..FRAMES {
        intact.next_frame(&mut intact_ohm)?;
        source.next_frame(&mut frame_ohm)?;
        if let Some(event @ FaultEvent::Named { wire: found, .. }) = check.check(&frame_ohm) {
            is_named = true;
            if found == fault.wire {
                tally.right += 1;
                tally.frames += frame + 1;
            } else {
                tally.wrong += 1;
                println!("{fault:?}: {event}");
            }
        }
        if check.named().is_none() {
            continue;
        }
        let error_mm = |answer_mm: &[f64]| -> f64 {
            let rows = answer_mm.chunks_exact(sensor.scale.coordinates_per_row()).enumerate();
            let errors = rows.flat_map(|(row, answer_mm)| {
                let truth = source.deformation().row_positions_mm(sensor, row);
                answer_mm
                    .chunks_exact(3)
                    .zip(truth)
                    .map(|(node, truth)| (node[2] - truth.z).abs())
            });
            errors.sum()
        };
        network.decode(&intact_ohm, &mut answer_mm)?;
        tally.errors_mm[0] += error_mm(&answer_mm);
        network.decode(&frame_ohm, &mut answer_mm)?;
        tally.errors_mm[1] += error_mm(&answer_mm);
        check.decode(&frame_ohm, 0..source.rows().len(), &mut answer_mm)?;
        tally.errors_mm[2] += error_mm(&answer_mm);
        tally.values += source.rows().len() * sensor.scale.nodes_per_row();
    }
    if !is_named {
        println!("{fault:?}: not named");
    }
    Ok(())
}

/// Number of events of the check in frames without a fault.
fn false_alarms(simulation: &Simulation, frames: usize) -> Result<usize, Box<dyn Error>> {
    let Simulation { sensor, scene, .. } = simulation;
    let mut source = Simulated::new(sensor, scene, Seed(12345), 100.0)?;
    let mut check = WireCheck::new(sensor, scene, source.rows())?;
    let mut frame_ohm = vec![0.0; source.readings()];
    let mut alarms = 0;
    for _ in 0..frames {
        source.next_frame(&mut frame_ohm)?;
        alarms += usize::from(check.check(&frame_ohm).is_some());
    }
    Ok(alarms)
}
