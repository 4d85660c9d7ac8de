use std::io::{self, Write};

use ndarray::Array2;

use decoupler_core::{dataset::Dataset, sensor::ArrayScale};

/// Writes the names of the columns of [`write_samples`], with or without those of decoded coordinates, and ends the
/// line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_samples_header(scale: ArrayScale, with_decoded: bool, writer: &mut dyn Write) -> io::Result<()> {
    write!(writer, "snapshot,row,")?;
    for column in 1..=scale.columns() {
        write!(writer, "r_{column},")?;
    }
    if with_decoded {
        for node in 1..=scale.nodes_per_row() {
            write!(writer, "x_{node},y_{node},z_{node},")?;
        }
        write_names("decoded_", scale.nodes_per_row(), writer)?;
    } else {
        write_names("", scale.nodes_per_row(), writer)?;
    }
    writeln!(writer)
}

/// Writes the samples of `set` as CSV: snapshot and row-wire, M4 resistances in ohm, x, y, z of each node in
/// millimetres, and the same as `decoded_mm` (samples × 3·M2) has it. Row-wires are written counted from 1, snapshots from
/// `first_snapshot`; the row-wire is empty where it is not known.
///
/// # Errors
/// Any error of `writer`.
pub fn write_samples(
    set: &Dataset,
    decoded_mm: Option<&Array2<f64>>,
    first_snapshot: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    for sample in 0..set.samples() {
        write!(writer, "{},", first_snapshot + set.groups()[sample])?;
        if let Some(row_wire) = set.row_wire(sample) {
            write!(writer, "{}", row_wire + 1)?;
        }
        write!(writer, ",")?;
        let decoded_mm = decoded_mm.map(|decoded_mm| decoded_mm.row(sample));
        let decoded_mm = decoded_mm.iter().flatten();
        let measured = set.sample_readings(sample).iter().chain(set.sample_targets(sample));
        write_numbers(measured.chain(decoded_mm), writer)?;
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes the names of the columns of [`write_decoded`], and ends the line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded_header(nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    write_names("", nodes, writer)?;
    writeln!(writer, ",readings_outside,coordinates_outside")
}

/// Writes decoded coordinates in millimetres, how many of the readings were outside the range seen in training, empty if
/// that is not known, and how many of the coordinates.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded(
    coordinates_mm: ndarray::ArrayView1<'_, f64>,
    readings_outside: Option<usize>,
    coordinates_outside: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    write_numbers(coordinates_mm, writer)?;
    write!(writer, ",")?;
    if let Some(count) = readings_outside {
        write!(writer, "{count}")?;
    }
    writeln!(writer, ",{coordinates_outside}")
}

/// Writes `x_1,y_1,z_1,…` for the nodes of a row-wire, each name after `before`.
fn write_names(before: &str, nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    for node in 1..=nodes {
        let separator = if node == 1 { "" } else { "," };
        write!(writer, "{separator}{before}x_{node},{before}y_{node},{before}z_{node}")?;
    }
    Ok(())
}

/// Writes numbers, separated by commas, so that reading gives the same bits.
fn write_numbers<'a>(numbers: impl IntoIterator<Item = &'a f64>, writer: &mut dyn Write) -> io::Result<()> {
    let mut separator = "";
    for number in numbers {
        write!(writer, "{separator}{number:?}")?;
        separator = ",";
    }
    Ok(())
}
