//! Trains a network for a simulated array and prints what it is worth: `cargo run --release --example train`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use decoupler::evaluation::{Run, RunError, SimulatedSettings, error_rows};

fn main() -> Result<(), RunError> {
    let mut settings = SimulatedSettings::default();
    settings.source.sensor.scale = "10x6_3x18".parse().expect("an array scale of the paper");
    settings.training.stopping.epochs = 100;
    let mut run = Run::prepare(settings)?;
    let reason = loop {
        if let Some(reason) = run.step() {
            break reason;
        }
    };
    let scores = run.node_scores().expect("the run is simulated");
    println!("{} epochs: {reason}", run.leader().latest().epoch);
    for row in error_rows(&scores.network, &scores.baselines, settings.published().as_ref()) {
        println!("{:<14} Z {:.3} %", row.name, row.z_percent.unwrap_or(f64::NAN));
    }
    Ok(())
}
