use std::{fs::File, io::BufReader, path::PathBuf};

use clap::Args;
use ndarray::{Array2, Axis, Slice};

use super::failure::Failure;
use crate::{
    dataset::{ReadError, Reading, ResistanceReader, SimulationError},
    export::{AtomicFile, NetworkFile, WriteError, write_coordinates_header, write_numbers},
    scene::RowModel,
};

/// Number of lines decoded and written together, so that memory does not grow with the file.
const BLOCK: usize = 1024;

/// Decouple the resistances of a CSV file with a saved network
///
/// The input has columns named r_1, r_2, … (one for each column-wire, in ohm), in any order and among others, or just
/// as many columns without names. Each line is one row-wire. For networks of known rows a column named row has its
/// number from 1; without one, lines are whole snapshots from the first row to the last. The output has a line x_1, y_1, z_1, x_2, … in mm for
/// each line of the input.
#[derive(Args)]
pub(super) struct Decode {
    /// Network saved by train --out or by the window
    #[arg(long, value_name = "FILE")]
    network: PathBuf,
    /// CSV file of resistances in ohm
    #[arg(long, value_name = "FILE")]
    input: PathBuf,
    /// CSV file of coordinates in mm, to be written
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
}

impl Decode {
    pub(super) fn run(self) -> Result<(), Failure> {
        let NetworkFile { settings, network, .. } = NetworkFile::load(&self.network)?;
        let scale = settings.source.sensor.scale;
        let input = File::open(&self.input).map_err(|source| Failure::Open {
            path: self.input.clone(),
            source,
        })?;
        let unreadable = |source| Failure::Resistances {
            path: self.input.clone(),
            source,
        };
        let reader = ResistanceReader::new(BufReader::new(input), scale.columns()).map_err(unreadable)?;
        let rows = settings.source.scene.rows;
        let read = rows.read(scale.rows()).map_err(SimulationError::from)?;
        let mut reader = match rows.model() {
            RowModel::Shared => reader,
            RowModel::Each => reader.with_row_wires(scale.rows()),
        };
        // The turn of each line's row-wire, where the file does not say it.
        let mut turns = (0..read.len()).cycle();
        let mut lines_in_turn = 0;
        let mut output = AtomicFile::create(&self.output)?;
        let refused = |source| WriteError::io(&self.output, source);
        write_coordinates_header(scale.nodes_per_row(), &mut output).map_err(refused)?;
        let mut is_empty = true;
        while let Some(reading) = reader.read(BLOCK).map_err(unreadable)? {
            is_empty = false;
            let Reading {
                resistances_ohm,
                lines,
                row_wires,
            } = reading;
            let other = |row_wires: &Vec<usize>| row_wires.iter().position(|row_wire| !read.contains(row_wire));
            if let Some((row_wires, line)) = row_wires.as_ref().and_then(|all| Some((all, other(all)?))) {
                return Err(Failure::OtherRow {
                    path: self.input.clone(),
                    line: lines[line],
                    row: row_wires[line] + 1,
                    rows,
                });
            }
            let coordinates_mm = if let Some(only) = network.only() {
                only.decouple(resistances_ohm.view())
            } else {
                let mut all_mm = Array2::zeros((lines.len(), scale.coordinates_per_row()));
                if row_wires.is_none() {
                    lines_in_turn += lines.len();
                }
                for (line, mut row_mm) in all_mm.rows_mut().into_iter().enumerate() {
                    let row_index = match &row_wires {
                        Some(row_wires) => read.iter().position(|row_wire| *row_wire == row_wires[line]),
                        None => turns.next(),
                    };
                    let resistances_ohm = resistances_ohm.slice_axis(Axis(0), Slice::from(line..=line));
                    let network = network.at(row_index.unwrap_or(0));
                    row_mm.assign(&network.decouple(resistances_ohm).row(0));
                }
                all_mm
            };
            for (coordinates_mm, line) in coordinates_mm.rows().into_iter().zip(lines) {
                if coordinates_mm.iter().any(|coordinate| !coordinate.is_finite()) {
                    let path = self.input.clone();
                    return Err(Failure::NoAnswer { path, line });
                }
                write_numbers(coordinates_mm, &mut output).map_err(refused)?;
            }
        }
        if is_empty {
            return Err(unreadable(ReadError::Empty));
        }
        if !lines_in_turn.is_multiple_of(read.len()) {
            return Err(Failure::PartOfSnapshot {
                path: self.input.clone(),
                lines: lines_in_turn,
                rows: read.len(),
            });
        }
        Ok(output.commit()?)
    }
}
