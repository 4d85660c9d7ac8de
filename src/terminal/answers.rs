//! Columns of decoded targets, for an array and for a recording.

use std::io::{self, Write};

use super::failure::Failure;
use decoupler_core::{dataset::SimulationError, evaluation::Problem, text::inert};
use decoupler_files::export::{NetworkFile, write_decoded_header};

/// Number of row-wires that the network of `file` reads; 1 for a recording whose row-wires share a network.
pub(super) fn rows_read(file: &NetworkFile) -> Result<usize, Failure> {
    match file.settings.source.simulation() {
        Some(simulation) => {
            let rows = simulation.scene.rows.read(simulation.sensor.scale.rows());
            Ok(rows.map_err(SimulationError::from)?.len())
        }
        None => Ok(file.network.values().len()),
    }
}

/// Writes the names of the targets of `rows` row-wires, and of the columns that count what is outside the training range.
pub(super) fn write_heading(problem: &Problem, rows: usize, out: &mut dyn Write) -> io::Result<()> {
    if problem.has_nodes {
        return write_decoded_header(rows * problem.targets.len() / 3, out);
    }
    let titles = problem.targets.iter().map(|target| inert(&target.title()));
    let names = titles.chain(["readings_outside".to_owned(), "targets_outside".to_owned()]);
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(names).map_err(io::Error::other)?;
    writer.flush()
}
