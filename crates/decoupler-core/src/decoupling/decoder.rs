use std::{array, fmt, ops::AddAssign};

use ndarray::{Array2, Axis};
use thiserror::Error;

use super::{Program, Solution, equations::RowProblem};
use crate::{
    dataset::Dataset,
    sensor::{Axes, SensorModel},
};

/// A method of decoding readings into targets; for a simulated array, resistances in ohm into coordinates of nodes in
/// millimetres.
///
/// Every decoder decodes single rows and whole frames, with bit-identical results.
pub trait Decoder: Send {
    /// Number of readings per row.
    fn channels(&self) -> usize;

    /// Number of targets per row.
    fn outputs(&self) -> usize;

    /// Decodes rows that need not form a frame: `readings` are rows × channels and `targets` rows × outputs, each for
    /// the row-wire with its index among those read.
    ///
    /// # Errors
    /// If a reading cannot be decoded; `row_index` is then the index among these rows, and the contents of `targets`
    /// are unspecified.
    ///
    /// # Panics
    /// If the slices have other lengths, or there is no such row-wire.
    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError>;

    /// Decodes one row, as [`Self::decode_rows`].
    ///
    /// # Errors
    /// If a reading cannot be decoded; the contents of `targets` are then unspecified.
    ///
    /// # Panics
    /// If the slices have other lengths, or there is no such row-wire.
    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.decode_rows(&[row_index], readings, targets)
    }

    /// Decodes a frame, the readings of all row-wires at one moment: `readings` are rows × channels, row by row, and
    /// `targets` rows × outputs.
    ///
    /// # Errors
    /// If a reading cannot be decoded; the contents of `targets` are then unspecified.
    ///
    /// # Panics
    /// If the slices do not consist of whole rows.
    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        /// Rows that are decoded at once: their indices are on the stack.
        const BLOCK: usize = 16;
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(readings.len() / channels, targets.len() / outputs);
        let blocks = readings
            .chunks(BLOCK * channels)
            .zip(targets.chunks_mut(BLOCK * outputs));
        for (block, (readings, targets)) in blocks.enumerate() {
            let row_indices: [usize; BLOCK] = array::from_fn(|row| block * BLOCK + row);
            self.decode_rows(&row_indices[..readings.len() / channels], readings, targets)
                .map_err(|error| error.after(block * BLOCK))?;
        }
        Ok(())
    }

    /// Returns the number of rows decoded since the last call, by status, for decoders that solve equations; zeros
    /// for others.
    fn take_solved_rows(&mut self) -> SolvedRows {
        SolvedRows::default()
    }

    /// Returns the program that the decoder evaluates, for other programs that decode without this one; `None` if it
    /// solves equations, or is a system of fuzzy rules, which is only for comparison.
    fn program(&self) -> Option<Program> {
        None
    }
}

/// Error for a reading that cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("row {}, reading {}: {value:?} cannot be decoded; give a finite number, above 0 for a resistance", .row_index + 1, .channel + 1)]
pub struct DecodeError {
    /// Index of the row in its frame or set, from 0.
    pub row_index: usize,
    /// Index of the reading in its row, from 0.
    pub channel: usize,
    /// Value of the reading.
    pub value: f64,
}

impl DecodeError {
    /// Checks that all readings (rows × channels) are finite and above 0.
    pub(crate) fn check(readings: &[f64], channels: usize) -> Result<(), Self> {
        let is_valid = |value: f64| (value > 0.0) & (value < f64::INFINITY);
        match readings.iter().position(|&value| !is_valid(value)) {
            None => Ok(()),
            Some(place) => Err(Self {
                row_index: place / channels,
                channel: place % channels,
                value: readings[place],
            }),
        }
    }

    /// Returns the error of a row that comes after `rows` others.
    pub(crate) fn after(self, rows: usize) -> Self {
        Self {
            row_index: rows + self.row_index,
            ..self
        }
    }
}

/// Decodes every sample of a set, each with the index of its own row-wire. Returns samples × outputs.
///
/// # Errors
/// If a reading cannot be decoded; `row_index` is then the index of the sample.
///
/// # Panics
/// If the set has a different number of channels, or row-wires unknown to the decoder.
pub fn decode_set(decoder: &mut dyn Decoder, set: &Dataset) -> Result<Array2<f64>, DecodeError> {
    /// Samples that are decoded at once.
    const BLOCK: usize = 1024;
    let mut answers = Array2::zeros((set.samples(), decoder.outputs()));
    let mut readings = Vec::new();
    for (block, mut answers) in answers.axis_chunks_iter_mut(Axis(0), BLOCK).enumerate() {
        let first = block * BLOCK;
        let samples = first..first + answers.nrows();
        let row_indices: Vec<usize> = samples.clone().map(|sample| set.row_index(sample)).collect();
        readings.clear();
        samples.for_each(|sample| readings.extend_from_slice(set.sample_readings(sample)));
        let answers = answers.as_slice_mut().expect("rows of a standard array are contiguous");
        decoder
            .decode_rows(&row_indices, &readings, answers)
            .map_err(|error| error.after(first))?;
    }
    Ok(answers)
}

/// Root mean square of m/R − 1 over the readings m of a row, with R the model's resistances at the decoded coordinates.
///
/// It needs no ground truth and so measures the reliability of any decoder; a value of 1 or more means that the
/// answer does not explain the readings. Infinite if the model has no resistance at these coordinates.
///
/// # Panics
/// If there are not M4 readings and 3·M2 coordinates.
pub fn resistance_residual(model: &SensorModel, readings_ohm: &[f64], coordinates_mm: &[f64]) -> f64 {
    assert_eq!(coordinates_mm.len(), model.scale.coordinates_per_row());
    let mut problem = RowProblem::new(model, Axes::Xyz);
    // Displacements are relative to the first row, wherever the nodes are.
    problem.read(0, readings_ohm);
    let mut unknowns = vec![0.0; problem.unknowns()];
    problem.unknowns_of(coordinates_mm, &mut unknowns);
    let residual = problem.evaluate_residuals(&unknowns);
    if residual.is_finite() { residual } else { f64::INFINITY }
}

/// Number of rows decoded by solving the equations of the sensor, and of those with unreliable answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SolvedRows {
    /// Rows decoded.
    pub rows: usize,
    /// Rows whose answer does not explain the readings.
    pub unsolved: usize,
    /// Rows whose readings are explained by other answers as well.
    pub undetermined: usize,
}

impl SolvedRows {
    pub(super) fn count(&mut self, solution: Solution) {
        self.rows += 1;
        match solution {
            Solution::Unique => {}
            Solution::None => self.unsolved += 1,
            Solution::Undetermined => self.undetermined += 1,
        }
    }

    /// Returns `true` if all answers are reliable.
    pub fn are_reliable(self) -> bool {
        self.unsolved == 0 && self.undetermined == 0
    }
}

impl AddAssign for SolvedRows {
    fn add_assign(&mut self, other: Self) {
        self.rows += other.rows;
        self.unsolved += other.unsolved;
        self.undetermined += other.undetermined;
    }
}

impl fmt::Display for SolvedRows {
    /// Writes how many answers are unreliable, why, and what helps; nothing if all are reliable.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rows, unsolved, undetermined) = (self.rows, self.unsolved, self.undetermined);
        if unsolved > 0 {
            write!(
                f,
                "{unsolved} of {rows} rows were not solved: their answers do not explain the readings. Check that readings \
                 and geometry belong together, give the noise of the readings, or let nodes move along z only"
            )?;
        }
        if unsolved > 0 && undetermined > 0 {
            write!(f, "; ")?;
        }
        if undetermined > 0 {
            write!(
                f,
                "{undetermined} of {rows} rows are not determined by their readings: other deformations may explain \
                 them as well. Use more column-wires, nodes that move along fewer axes, known rows, or a layout without symmetry"
            )?;
        }
        Ok(())
    }
}
