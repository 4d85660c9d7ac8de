//! Samples in NumPy arrays.

use std::{num::NonZero, panic::resume_unwind, thread};

use decoupler_core::{
    dataset::{Dataset, Division, Seed, Split},
    decoupling::{DecodeError, Decoder as _, ProgramDecoder},
};
use ndarray::{Array2, ArrayView2, Axis, Slice};
use numpy::PyReadonlyArray2;
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::work::value_error;

/// Two-dimensional array of readings or targets, of which only what is used is converted to double precision.
#[derive(FromPyObject)]
pub enum Matrix<'py> {
    /// Double precision.
    Double(PyReadonlyArray2<'py, f64>),
    /// Single precision.
    Single(PyReadonlyArray2<'py, f32>),
}

/// View of a [`Matrix`].
#[derive(Clone, Copy)]
pub enum MatrixView<'a> {
    /// Double precision.
    Double(ArrayView2<'a, f64>),
    /// Single precision.
    Single(ArrayView2<'a, f32>),
}

impl Matrix<'_> {
    /// Returns a view, which can be used while other Python threads run.
    pub fn view(&self) -> MatrixView<'_> {
        match self {
            Self::Double(array) => MatrixView::Double(array.as_array()),
            Self::Single(array) => MatrixView::Single(array.as_array()),
        }
    }
}

impl MatrixView<'_> {
    /// Numbers of rows and columns.
    pub fn dim(self) -> (usize, usize) {
        match self {
            Self::Double(view) => view.dim(),
            Self::Single(view) => view.dim(),
        }
    }

    /// Copies all rows.
    pub fn to_array(self) -> Array2<f64> {
        match self {
            Self::Double(view) => view.as_standard_layout().into_owned(),
            Self::Single(view) => view.mapv(f64::from).as_standard_layout().into_owned(),
        }
    }

    /// Copies the rows with these indices.
    fn select(self, rows: &[usize]) -> Array2<f64> {
        let shape = (rows.len(), self.dim().1);
        match self {
            Self::Double(view) => Array2::from_shape_fn(shape, |(row, column)| view[[rows[row], column]]),
            Self::Single(view) => Array2::from_shape_fn(shape, |(row, column)| f64::from(view[[rows[row], column]])),
        }
    }

    /// Replaces the contents of `values` by the rows from `first` up to `end`, row by row.
    fn copy_rows(self, first: usize, end: usize, values: &mut Vec<f64>) {
        values.clear();
        let rows = Slice::from(first..end);
        match self {
            Self::Double(view) => {
                let rows = view.slice_axis(Axis(0), rows);
                match rows.as_slice() {
                    Some(rows) => values.extend_from_slice(rows),
                    None => values.extend(rows),
                }
            }
            Self::Single(view) => values.extend(view.slice_axis(Axis(0), rows).iter().map(|&value| f64::from(value))),
        }
    }
}

/// Samples of a fit.
pub struct Samples<'a> {
    /// Readings: samples × channels.
    pub readings: MatrixView<'a>,
    /// Targets: samples × outputs.
    pub targets: MatrixView<'a>,
    /// Row-wire of each sample, if there is one decoder for each.
    pub row_wires: Option<Vec<usize>>,
    /// Group of each sample; each is its own by default.
    pub groups: Option<Vec<usize>>,
}

impl Samples<'_> {
    fn check(&self) -> PyResult<()> {
        let samples = self.readings.dim().0;
        let lengths = [
            ("targets", self.targets.dim().0),
            ("row-wires", self.row_wires.as_ref().map_or(samples, Vec::len)),
            ("groups", self.groups.as_ref().map_or(samples, Vec::len)),
        ];
        match lengths.into_iter().find(|(_, length)| *length != samples) {
            Some((what, found)) => Err(PyValueError::new_err(format!(
                "there are {found} {what} for {samples} samples: give one for each"
            ))),
            None => Ok(()),
        }
    }

    fn groups(&self) -> Vec<usize> {
        let own = || (0..self.readings.dim().0).collect();
        self.groups.clone().unwrap_or_else(own)
    }

    /// Copies all samples.
    ///
    /// # Errors
    /// `ValueError` if the parts differ in length or are empty.
    pub fn dataset(&self) -> PyResult<Dataset> {
        self.check()?;
        let parts = (self.readings.to_array(), self.targets.to_array());
        Dataset::new(parts.0, parts.1, self.row_wires.as_deref(), self.groups()).map_err(value_error)
    }

    /// Copies the samples with these indices.
    fn select(&self, samples: &[usize]) -> PyResult<Dataset> {
        let groups = self.groups();
        let row_wires = self.row_wires.as_ref();
        let row_wires = row_wires.map(|row_wires| Vec::from_iter(samples.iter().map(|&sample| row_wires[sample])));
        let set = Dataset::new(
            self.readings.select(samples),
            self.targets.select(samples),
            row_wires.as_deref(),
            samples.iter().map(|&sample| groups[sample]).collect(),
        );
        let mut read = self.row_wires.clone().unwrap_or_default();
        read.sort_unstable();
        read.dedup();
        set.and_then(|set| set.among_rows(&read)).map_err(value_error)
    }

    /// Holds out a share of the samples for validation, like the program, and copies every sample once.
    ///
    /// # Errors
    /// `ValueError` if the share is out of range, or the parts differ in length or are empty.
    pub fn split(&self, division: Division, seed: Seed) -> PyResult<Split> {
        self.check()?;
        division.check().map_err(value_error)?;
        if division.validation_fraction == Some(0.0) || self.readings.dim().0 == 0 {
            return Ok(Split {
                training: self.dataset()?,
                validation: None,
            });
        }
        // A division depends only on the groups.
        let samples = self.readings.dim().0;
        let groups = Dataset::new(
            Array2::zeros((samples, 1)),
            Array2::zeros((samples, 1)),
            None,
            self.groups(),
        );
        let (training, held_out) = parts(&groups.map_err(value_error)?, division, seed)?;
        Ok(Split {
            training: self.select(&training)?,
            validation: (!held_out.is_empty()).then(|| self.select(&held_out)).transpose()?,
        })
    }
}

/// Decodes readings (samples × channels), each of the row-wire with its index among those read, 0 if `row_indices` is
/// `None`. Returns samples × outputs. Many samples are decoded on all cores.
///
/// # Errors
/// If a reading cannot be decoded; `row_index` is then the index of the sample.
pub fn decode(
    decoder: &mut ProgramDecoder,
    readings: MatrixView<'_>,
    row_indices: Option<&[usize]>,
) -> Result<Array2<f64>, DecodeError> {
    /// Samples for which a thread is worth its start.
    const OF_THREAD: usize = 2048;
    let (samples, outputs) = (readings.dim().0, decoder.outputs());
    let mut answers = vec![0.0; samples * outputs];
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let threads = cores.min(samples / OF_THREAD).max(1);
    let share = samples.div_ceil(threads).max(1);
    let mut parts = answers.chunks_mut(share * outputs).zip((0..).step_by(share));
    let own = parts.next();
    thread::scope(|scope| {
        let others = parts.map(|(answers, first)| {
            let mut decoder = decoder.clone();
            scope.spawn(move || decode_part(&mut decoder, readings, row_indices, first, answers))
        });
        let others = Vec::from_iter(others);
        let mut decoded = own.map_or(Ok(()), |(answers, first)| {
            decode_part(decoder, readings, row_indices, first, answers)
        });
        for other in others {
            let other = other.join().unwrap_or_else(|panic| resume_unwind(panic));
            decoded = decoded.and(other);
        }
        decoded
    })?;
    Ok(Array2::from_shape_vec((samples, outputs), answers).expect("samples × outputs answers"))
}

/// Decodes the samples from `first` on, as many as there is room in `answers`.
fn decode_part(
    decoder: &mut ProgramDecoder,
    readings: MatrixView<'_>,
    row_indices: Option<&[usize]>,
    first: usize,
    answers: &mut [f64],
) -> Result<(), DecodeError> {
    /// Samples that are decoded at once.
    const BLOCK: usize = 1024;
    let outputs = decoder.outputs();
    let shared = vec![0; BLOCK.min(answers.len() / outputs)];
    let mut block = Vec::new();
    for (number, answers) in answers.chunks_mut(BLOCK * outputs).enumerate() {
        let (first, count) = (first + number * BLOCK, answers.len() / outputs);
        readings.copy_rows(first, first + count, &mut block);
        let row_indices = row_indices.map_or(&shared[..count], |indices| &indices[first..first + count]);
        decoder
            .decode_rows(row_indices, &block, answers)
            .map_err(|error| DecodeError {
                row_index: first + error.row_index,
                ..error
            })?;
    }
    Ok(())
}

/// Returns the index of each row-wire among those that a decoder knows.
///
/// # Errors
/// `ValueError` if there is not one row-wire for each sample, or one is unknown.
pub fn row_indices(known: &[usize], row_wires: Option<Vec<usize>>, samples: usize) -> PyResult<Vec<usize>> {
    let Some(row_wires) = row_wires else {
        return Err(PyValueError::new_err(format!(
            "there is one network for each of {} row-wires: give the row-wire of each sample",
            known.len()
        )));
    };
    if row_wires.len() != samples {
        return Err(PyValueError::new_err(format!(
            "there are {} row-wires for {samples} samples: give one for each",
            row_wires.len()
        )));
    }
    let index = |(sample, row_wire): (usize, &usize)| {
        known.binary_search(row_wire).map_err(|_| {
            let known = known.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
            PyValueError::new_err(format!(
                "sample {sample}: row-wire {row_wire} has no network; there are {known}"
            ))
        })
    };
    row_wires.iter().enumerate().map(index).collect()
}

/// Training and held-out samples of `set`, as ascending indices.
pub fn parts(set: &Dataset, division: Division, seed: Seed) -> PyResult<(Vec<usize>, Vec<usize>)> {
    let training = division.divide(set, true, seed).map_err(value_error)?.training;
    let is_held_out = |sample: &usize| training.binary_search(sample).is_err();
    let held_out = (0..set.samples()).filter(is_held_out).collect();
    Ok((training, held_out))
}
