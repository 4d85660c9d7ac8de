//! Trains a network for a simulated array and prints its errors: `cargo run --release --example train`.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use decoupler_core::{
    dataset::Simulation,
    evaluation::{ErrorTable, Run, RunError, RunSettings},
};

fn main() -> Result<(), RunError> {
    let mut simulation = Simulation::default();
    simulation.sensor.scale = "10x6_3x18".parse().expect("an array scale of the paper");
    let mut settings = RunSettings::from(simulation);
    settings.training.stopping.epochs = 100;
    let mut run = Run::prepare(settings)?;
    let reason = loop {
        if let Some(reason) = run.step() {
            break reason;
        }
    };
    let scores = run.scores().expect("the baselines are measured");
    let tables = ErrorTable::of_scores(run.problem(), &scores, settings.published().as_ref());
    println!("{} epochs: {reason}", run.leader().latest().epoch);
    for row in tables.iter().flat_map(|table| &table.rows) {
        println!("{:<14} Z {:.3} %", row.name, row.errors[0].unwrap_or(f64::NAN));
    }
    Ok(())
}
