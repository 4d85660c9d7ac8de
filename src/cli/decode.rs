use std::{
    fs::File,
    io::BufReader,
    path::{Path, PathBuf},
};

use clap::Args;
use ndarray::{Array2, Axis, Slice};

use super::{failure::Failure, follow::Follow, measured_decode, outside_training::OutsideTraining};
use crate::{
    dataset::{ReadError, Reading, ResistanceReader, SimulationError},
    export::{AtomicFile, NetworkFile, WriteError, is_same, write_decoded, write_decoded_header},
    network::Networks,
    scene::RowModel,
};

/// Number of lines decoded and written together, so that memory does not grow with the file.
const BLOCK: usize = 1024;

/// Decouple the resistances of a CSV file with a saved network
///
/// The input has columns named r_1, r_2, … (one for each column-wire, in ohm), in any order and among others, or exactly
/// as many unnamed columns. Each line is one row-wire. For networks of known rows a column named row has its
/// number from 1; without one, lines are whole snapshots from the first row to the last. The output has a line x_1, y_1, z_1, x_2, … in mm for
/// each line of the input, then readings_outside, the number of its readings that are outside the range seen in training
/// by more than a tenth of that, and coordinates_outside, the number of coordinates that are outside by more than all of
/// it; a warning names such lines. With --follow, frames are decoded as they come, from standard input, a serial port or
/// a socket too. A network trained on own data (train --data) reads columns of the names of its inputs (or as many without names), from
/// CSV, .npy, .npz or .mat, and gives its targets under their names.
#[derive(Args)]
pub(super) struct Decode {
    /// Network saved by train --out or by the window
    #[arg(long, value_name = "FILE")]
    network: PathBuf,
    /// CSV file of resistances in ohm; with --follow also -, the default, DEVICE:BAUD or tcp:HOST:PORT
    #[arg(long, value_name = "FILE", required_unless_present = "follow")]
    input: Option<PathBuf>,
    /// CSV file of coordinates in mm, to be written
    #[arg(long, value_name = "FILE", required_unless_present = "follow")]
    output: Option<PathBuf>,
    #[command(flatten)]
    follow: Follow,
}

impl Decode {
    pub(super) fn run(self) -> Result<(), Failure> {
        if let Some((input, output)) = self.input.as_ref().zip(self.output.as_ref()) {
            self.check_output(input, output)?;
        }
        let file = NetworkFile::load(&self.network)?;
        if file.recorded.is_some() {
            return self.decode_measured(&file);
        }
        match (&self.input, &self.output) {
            (Some(input), Some(output)) if !self.follow.follow => {
                self.follow.check_unused()?;
                decode_file(file, input, output)
            }
            (input, _) => {
                let standard_input = Path::new("-");
                self.follow.run(input.as_deref().unwrap_or(standard_input), &file)
            }
        }
    }

    fn decode_measured(&self, file: &NetworkFile) -> Result<(), Failure> {
        match (&self.input, &self.output) {
            (Some(input), Some(output)) if !self.follow.follow => {
                self.follow.check_unused()?;
                measured_decode::decode_file(file, input, output)
            }
            (input, _) => self
                .follow
                .run_measured(input.as_deref().unwrap_or(Path::new("-")), file),
        }
    }

    /// Checks that writing the output destroys no input.
    fn check_output(&self, input: &Path, output: &Path) -> Result<(), Failure> {
        for (name, path) in [("input", input), ("network", &self.network)] {
            if is_same(path, output) {
                let message = format!("--{name} and --output name the same file: give the output another name");
                return Err(Failure::Arguments(message));
            }
        }
        Ok(())
    }
}

/// Decodes the file `input` into the file `output`.
fn decode_file(file: NetworkFile, input: &Path, output: &Path) -> Result<(), Failure> {
    let network = file.network;
    let settings = file.settings.simulated().expect("the network is of an array");
    let scale = settings.source.sensor.scale;
    let opened = File::open(input).map_err(|source| Failure::Open {
        path: input.to_owned(),
        source,
    })?;
    let unreadable = |source| Failure::Resistances {
        path: input.to_owned(),
        source,
    };
    let reader = ResistanceReader::new(BufReader::new(opened), scale.columns()).map_err(unreadable)?;
    let rows = settings.source.scene.rows;
    let read = rows.read(scale.rows()).map_err(SimulationError::from)?;
    let mut reader = match rows.model() {
        RowModel::Shared => reader,
        RowModel::Each => reader.with_row_wires(scale.rows()),
    };
    // The turn of each line's row-wire, where the file does not say it.
    let mut turns = (0..read.len()).cycle();
    let mut lines_in_turn = 0;
    let path = output;
    let mut output = AtomicFile::create(path)?;
    let refused = |source| WriteError::io(path, source);
    write_decoded_header(scale.nodes_per_row(), &mut output).map_err(refused)?;
    let mut outside = OutsideTraining::default();
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
                path: input.to_owned(),
                line: lines[line],
                row: row_wires[line] + 1,
                rows,
            });
        }
        let row_indices: Vec<usize> = match &row_wires {
            _ if network.only().is_some() => vec![0; lines.len()],
            Some(row_wires) => {
                let index = |row_wire| read.iter().position(|other| other == row_wire).unwrap_or(0);
                row_wires.iter().map(index).collect()
            }
            None => {
                lines_in_turn += lines.len();
                turns.by_ref().take(lines.len()).collect()
            }
        };
        let coordinates_mm = match network.only() {
            Some(only) => only.decouple(resistances_ohm.view()),
            None => decouple_lines(&network, &row_indices, &resistances_ohm),
        };
        let lines = lines.into_iter().zip(row_indices);
        let decoded = resistances_ohm.rows().into_iter().zip(coordinates_mm.rows()).zip(lines);
        for ((readings_ohm, coordinates_mm), (line, row_index)) in decoded {
            if coordinates_mm.iter().any(|coordinate| !coordinate.is_finite()) {
                let path = input.to_owned();
                return Err(Failure::NoAnswer { path, line });
            }
            let readings_ohm = readings_ohm
                .to_slice()
                .expect("a row of a standard array is contiguous");
            let coordinates = coordinates_mm
                .to_slice()
                .expect("a row of a standard array is contiguous");
            let of_line = outside.count(network.at(row_index), line, readings_ohm, coordinates);
            write_decoded(coordinates_mm, of_line.readings, of_line.coordinates, &mut output).map_err(refused)?;
        }
    }
    if is_empty {
        return Err(unreadable(ReadError::Empty));
    }
    if !lines_in_turn.is_multiple_of(read.len()) {
        return Err(Failure::PartOfSnapshot {
            path: input.to_owned(),
            lines: lines_in_turn,
            rows: read.len(),
        });
    }
    output.commit()?;
    outside.warn();
    Ok(())
}

/// Decodes each line with the network of its row.
fn decouple_lines(networks: &Networks, row_indices: &[usize], resistances_ohm: &Array2<f64>) -> Array2<f64> {
    let outputs = networks.at(0).outputs().channels();
    let mut coordinates_mm = Array2::zeros((row_indices.len(), outputs));
    for (line, &row_index) in row_indices.iter().enumerate() {
        let resistances_ohm = resistances_ohm.slice_axis(Axis(0), Slice::from(line..=line));
        let row_mm = networks.at(row_index).decouple(resistances_ohm);
        coordinates_mm.row_mut(line).assign(&row_mm.row(0));
    }
    coordinates_mm
}
