use std::{fs::File, io::BufReader, path::PathBuf};

use clap::Args;

use super::failure::Failure;
use crate::{
    dataset::{ReadError, Reading, ResistanceReader},
    export::{AtomicFile, NetworkFile, WriteError, write_coordinates_header, write_numbers},
};

/// Rows decoded and written together, so that memory does not grow with the file.
const BLOCK: usize = 1024;

/// Decouple the resistances of a CSV file with a saved network
///
/// The input has columns named r_1, r_2, … (one for each column-wire, in ohm), in any order and among others, or just
/// as many columns without names. Each line is one row-wire. The output has a line x_1, y_1, z_1, x_2, … in mm for
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
        let mut reader = ResistanceReader::new(BufReader::new(input), scale.columns()).map_err(unreadable)?;
        let mut output = AtomicFile::create(&self.output)?;
        let refused = |source| WriteError::io(&self.output, source);
        write_coordinates_header(scale.nodes_per_row(), &mut output).map_err(refused)?;
        let mut is_empty = true;
        while let Some(Reading { resistances_ohm, lines }) = reader.read(BLOCK).map_err(unreadable)? {
            is_empty = false;
            let coordinates_mm = network.decouple(resistances_ohm.view());
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
        Ok(output.commit()?)
    }
}
