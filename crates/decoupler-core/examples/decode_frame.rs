//! Decodes one frame of readings, all row-wires at one moment, by networks of known rows:
//! `cargo run --release --example decode_frame`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::error::Error;

use decoupler_core::{
    decoupling::{Decoder, NewtonDecoder, Precision, ProgramDecoder},
    evaluation::{Preset, Run, RunSettings},
    scene::Noise,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut source = Preset::Best.simulation_in(Noise::default());
    source.sensor.scale = "10x6_3x18".parse()?;
    let mut settings = RunSettings {
        source: source.into(),
        ..Preset::Best.settings()
    };
    settings.training.stopping.epochs = 100;
    let mut run = Run::prepare(settings)?;
    while run.step().is_none() {}
    let frames = run.test().frames()?;
    let mut coordinates_mm = vec![0.0; run.test().row_count() * run.test().outputs()];
    let mut network = ProgramDecoder::new(run.network().program(Precision::Single));
    network.decode(&frames[0], &mut coordinates_mm)?;
    println!("network: node 1 of row-wire 1 is at z = {:.6} mm", coordinates_mm[2]);
    let rows = Vec::from_iter(0..run.test().row_count());
    let mut newton = NewtonDecoder::new(&source.sensor, &source.scene, &rows)?;
    newton.decode(&frames[0], &mut coordinates_mm)?;
    println!("Newton:  node 1 of row-wire 1 is at z = {:.6} mm", coordinates_mm[2]);
    Ok(())
}
