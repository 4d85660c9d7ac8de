use std::{fs::File, io::BufReader, path::PathBuf};

use clap::Args;
use ndarray::{Array2, Axis, Slice};

use super::failure::Failure;
use crate::{
    dataset::{DatasetError, ReadError, Reading, ResistanceReader},
    export::{AtomicFile, NetworkFile, WriteError, write_coordinates_header, write_numbers},
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
        let scale = settings.sensor.scale;
        let input = File::open(&self.input).map_err(|source| Failure::Open {
            path: self.input.clone(),
            source,
        })?;
        let unreadable = |source| Failure::Resistances {
            path: self.input.clone(),
            source,
        };
        let reader = ResistanceReader::new(BufReader::new(input), scale.columns()).map_err(unreadable)?;
        let rows = settings.scene.rows;
        let read = rows.read(scale.rows()).map_err(DatasetError::from)?;
        let mut reader = if rows.are_known() {
            reader.with_row_wires(scale.rows())
        } else {
            reader
        };
        let mut next_place = 0;
        let mut has_row_wires = false;
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
            let row_wires_given = row_wires.is_some();
            let coordinates_mm = match network.each() {
                [only] => {
                    let others = |row: &usize| rows.are_known() && !read.contains(row);
                    let place = row_wires
                        .as_ref()
                        .and_then(|row_wires| row_wires.iter().position(others));
                    if let Some(place) = place {
                        let row = row_wires.map_or(0, |row_wires| row_wires[place]) + 1;
                        let (path, line) = (self.input.clone(), lines[place]);
                        return Err(Failure::OtherRow { path, line, row, rows });
                    }
                    only.decouple(resistances_ohm.view())
                }
                each => {
                    let mut all_mm = Array2::zeros((lines.len(), scale.coordinates_per_row()));
                    for sample in 0..lines.len() {
                        let place = match &row_wires {
                            Some(row_wires) => row_wires[sample],
                            None => next_place,
                        };
                        next_place = (place + 1) % each.len();
                        let resistances_ohm = resistances_ohm.slice_axis(Axis(0), Slice::from(sample..=sample));
                        all_mm
                            .row_mut(sample)
                            .assign(&each[place].decouple(resistances_ohm).row(0));
                    }
                    all_mm
                }
            };
            has_row_wires |= row_wires_given;
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
        if !has_row_wires && next_place != 0 {
            let (path, rows) = (self.input.clone(), read.len());
            return Err(Failure::PartOfSnapshot { path, rows });
        }
        Ok(output.commit()?)
    }
}
