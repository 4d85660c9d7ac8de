//! Decoders that solve the equations of the sensor.

mod newton;
mod polished;
#[cfg(test)]
mod tests;

pub use newton::NewtonDecoder;
pub use polished::PolishedDecoder;
use rayon::prelude::*;

use super::{DecodeError, SolvedRows};

/// Checks that all readings (rows × `channels`) are resistances.
fn check(readings: &[f64], channels: usize) -> Result<(), DecodeError> {
    let mut rows = readings.chunks_exact(channels).enumerate();
    rows.try_for_each(|(row_index, readings)| {
        DecodeError::check(readings).map_err(|error| DecodeError { row_index, ..error })
    })
}

/// Solves rows by `solve`, in parallel if there are many: each block of rows by `solver` or a clone of it. Readings are
/// rows × channels and targets rows × outputs.
fn solve_in_blocks<S: Clone + Send>(
    solver: &mut S,
    row_wires: &[usize],
    readings: &[f64],
    targets: &mut [f64],
    solve: impl Fn(&mut S, &[usize], &[f64], &mut [f64]) -> SolvedRows + Sync,
) -> SolvedRows {
    /// Number of rows from which threads pay.
    const PARALLEL: usize = 64;
    /// Rows per block: a multiple of those that are solved side by side.
    const BLOCK: usize = 16;
    let rows = row_wires.len();
    if rows < PARALLEL {
        return solve(solver, row_wires, readings, targets);
    }
    let (channels, outputs) = (readings.len() / rows, targets.len() / rows);
    row_wires
        .par_chunks(BLOCK)
        .zip(readings.par_chunks(BLOCK * channels))
        .zip(targets.par_chunks_mut(BLOCK * outputs))
        .map_with(solver.clone(), |solver, ((rows, readings), targets)| {
            solve(solver, rows, readings, targets)
        })
        .reduce(SolvedRows::default, |mut all, some| {
            all += some;
            all
        })
}
