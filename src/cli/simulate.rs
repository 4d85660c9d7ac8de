use std::{
    io::{BufWriter, Write, stdout},
    path::PathBuf,
};

use clap::Args;

use super::{
    arguments::{count, seed},
    failure::Failure,
};
use crate::{
    dataset::{Dataset, LARGEST_SAMPLES, Seed, Stream},
    export::{AtomicFile, WriteError, write_samples, write_samples_header},
    scene::Scene,
    sensor::{ArrayScale, SensorModel},
};

/// Snapshots drawn and written together, so that memory does not grow with the number of samples.
const BLOCK: usize = 64;

/// Draw samples of an array and write them as CSV
///
/// A line is one row-wire at one moment: snapshot and row counted from 1, its resistances r_1, r_2, … in ohm, and
/// x_1, y_1, z_1, x_2, … of its nodes in mm. Samples come as whole snapshots of all rows. With the seed and array of
/// a training they are its test samples.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Simulate {
    /// Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns
    #[arg(long, value_name = "SCALE", default_value = "10x10_5x30")]
    array: ArrayScale,
    /// Samples, rounded up to whole snapshots
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count(1..=LARGEST_SAMPLES))]
    samples: usize,
    /// From which everything random follows
    #[arg(long, default_value_t = 0, value_parser = seed)]
    seed: u64,
    /// File to write instead of standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl Simulate {
    pub(super) fn run(self) -> Result<(), Failure> {
        match &self.out {
            Some(path) => {
                let mut file = AtomicFile::create(path)?;
                self.write(&mut file, |source| WriteError::io(path, source).into())?;
                Ok(file.commit()?)
            }
            None => {
                let mut output = BufWriter::new(stdout().lock());
                self.write(&mut output, Failure::Output)?;
                output.flush().map_err(Failure::Output)
            }
        }
    }

    fn write(&self, writer: &mut dyn Write, refused: impl Fn(std::io::Error) -> Failure) -> Result<(), Failure> {
        let model = SensorModel::new(self.array);
        let mut rng = Seed(self.seed).rng(Stream::Test);
        let rows = self.array.rows();
        let snapshots = self.samples.div_ceil(rows);
        write_samples_header(self.array, writer).map_err(&refused)?;
        for first in (0..snapshots).step_by(BLOCK) {
            let samples = BLOCK.min(snapshots - first) * rows;
            let set = Dataset::simulate(&model, &Scene::default(), samples, &mut rng)?;
            write_samples(&set, first + 1, writer).map_err(&refused)?;
        }
        Ok(())
    }
}
