use std::path::{Path, PathBuf};

use clap::Args;
use ndarray::{Array2, Axis, Slice};

use super::{
    answers::{rows_read, write_heading},
    failure::Failure,
    follow::Follow,
    outside_training::OutsideTraining,
    readings::{Readings, read},
};
use decoupler_core::decoupling::{CompiledNetworks, Decoder};
use decoupler_files::export::{AtomicFile, NetworkFile, WriteError, is_same, write_decoded};

/// Decouple the resistances of a CSV file with a saved network
///
/// The input has columns named r_1, r_2, … (one for each column-wire, in ohm), in any order and among others, or exactly
/// as many unnamed columns. Each line is one row-wire. For networks of known rows a column named row has its
/// number from 1; without one, lines are whole snapshots from the first row to the last. The output has a line x_1, y_1, z_1, x_2, … in mm for
/// each line of the input, then readings_outside, the number of its readings that are outside the range seen in training
/// by more than a tenth of that, and coordinates_outside, the number of coordinates that are outside by more than all of
/// it; a warning names such lines. With --follow, frames are decoded as they come, from standard input, a serial port or
/// a socket too. The network of a recording (train --data) reads columns of the names of its inputs (or as many without
/// names), from CSV, .npy, .npz or .mat, and gives its targets under their names.
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
        match (&self.input, &self.output) {
            (Some(input), Some(output)) if !self.follow.follow => {
                self.follow.check_unused()?;
                decode_file(&file, input, output)
            }
            (input, _) => {
                let standard_input = Path::new("-");
                self.follow.run(input.as_deref().unwrap_or(standard_input), &file)
            }
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
fn decode_file(file: &NetworkFile, input: &Path, output: &Path) -> Result<(), Failure> {
    let mut written = AtomicFile::create(output)?;
    let refused = |source| WriteError::io(output, source);
    write_heading(&file.problem, 1, &mut written).map_err(refused)?;
    let mut outside = OutsideTraining::new(&file.problem);
    let mut compiled = CompiledNetworks::<f64>::new(&file.network, rows_read(file)?);
    read(file, input, &mut |readings| {
        let answers = decoded(file, &mut compiled, &readings);
        let lines = readings.lines.iter().zip(&readings.row_indices);
        let values = readings.values.outer_iter().zip(answers.outer_iter());
        for ((&line, &row_index), (readings, answer)) in lines.zip(values) {
            if answer.iter().any(|value| !value.is_finite()) {
                let path = input.to_owned();
                return Err(Failure::NoAnswer { path, line });
            }
            let [readings, targets] =
                [&readings, &answer].map(|row| row.to_slice().expect("a row of a standard array is contiguous"));
            let of_line = outside.count(file.network.at(row_index), line, readings, targets);
            write_decoded(answer, of_line.readings, of_line.targets, &mut written).map_err(refused)?;
        }
        Ok(())
    })?;
    written.commit()?;
    outside.warn();
    Ok(())
}

/// Decodes each line with the network of its row, one network for all rows of an array in one matrix product. Answers that do
/// not exist are NaN.
fn decoded(file: &NetworkFile, compiled: &mut CompiledNetworks<f64>, readings: &Readings) -> Array2<f64> {
    let Readings {
        values, row_indices, ..
    } = readings;
    let networks = &file.network;
    if file.problem.has_nodes
        && let Some(only) = networks.only()
    {
        return only.decouple(values.view());
    }
    let mut answers = Array2::zeros((row_indices.len(), file.problem.targets.len()));
    for (line, &row_index) in row_indices.iter().enumerate() {
        let mut answer = answers.row_mut(line);
        if file.problem.has_nodes {
            let of_line = networks
                .at(row_index)
                .decouple(values.slice_axis(Axis(0), Slice::from(line..=line)));
            answer.assign(&of_line.row(0));
            continue;
        }
        let readings = values.row(line);
        let (readings, targets) = (readings.to_slice(), answer.as_slice_mut());
        let (readings, targets) = readings.zip(targets).expect("rows of standard arrays are contiguous");
        if compiled.decode_row(row_index, readings, targets).is_err() {
            targets.fill(f64::NAN);
        }
    }
    answers
}
