use std::io::{self, Write};

use crate::{dataset::Dataset, sensor::ArrayScale};

/// Writes the names of the columns of [`write_samples`], and ends the line.
///
/// # Errors
/// What `writer` said.
pub fn write_samples_header(scale: ArrayScale, writer: &mut dyn Write) -> io::Result<()> {
    write!(writer, "snapshot,row,")?;
    for column in 1..=scale.columns() {
        write!(writer, "r_{column},")?;
    }
    write_coordinates_header(scale.nodes_per_row(), writer)
}

/// Writes the samples of `set` as CSV: snapshot and row-wire, M4 resistances in ohm, and x, y, z of each node in
/// millimetres. Everything is counted from 1, snapshots from `first_snapshot`.
///
/// # Errors
/// What `writer` said.
pub fn write_samples(set: &Dataset, first_snapshot: usize, writer: &mut dyn Write) -> io::Result<()> {
    let samples = set.resistances_ohm.rows().into_iter().zip(set.coordinates_mm.rows());
    for (sample, (resistances_ohm, coordinates_mm)) in samples.enumerate() {
        let (snapshot, row) = (first_snapshot + sample / set.rows(), 1 + sample % set.rows());
        write!(writer, "{snapshot},{row},")?;
        write_numbers(resistances_ohm.iter().chain(&coordinates_mm), writer)?;
    }
    Ok(())
}

/// Writes `x_1,y_1,z_1,…` for the nodes of a row-wire, and ends the line.
///
/// # Errors
/// What `writer` said.
pub fn write_coordinates_header(nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    for node in 1..=nodes {
        let end = if node == nodes { "\n" } else { "," };
        write!(writer, "x_{node},y_{node},z_{node}{end}")?;
    }
    Ok(())
}

/// Writes a line of numbers so that reading gives the same bits.
///
/// # Errors
/// What `writer` said.
pub fn write_numbers<'a>(numbers: impl IntoIterator<Item = &'a f64>, writer: &mut dyn Write) -> io::Result<()> {
    let mut separator = "";
    for number in numbers {
        write!(writer, "{separator}{number:?}")?;
        separator = ",";
    }
    writeln!(writer)
}
