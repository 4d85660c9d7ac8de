//! Decoders without a network: ridge regression, radial-basis networks and fuzzy rules.

use std::sync::{Mutex, PoisonError};

use decoupler_core::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{Decoder, Program, ProgramDecoder},
    network::{InputChoice, ScalingChoice},
    scene::{NoiseSource, RowModel},
    text::{Named, counted},
};
use numpy::{IntoPyArray, PyArray2};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyTuple},
};
use serde::{Deserialize, Serialize};

use crate::{
    arrays::{Matrix, Samples, decode, row_indices},
    training::quantity,
    work::{detached, value_error},
};

/// A fitted decoder: one for all row-wires, or one for each.
#[pyclass(frozen, module = "decoupler._native")]
pub struct FittedDecoder {
    row_wires: Option<Vec<usize>>,
    decoder: Mutex<ProgramDecoder>,
}

/// Contents of a pickle.
#[derive(Serialize, Deserialize)]
struct State {
    row_wires: Option<Vec<usize>>,
    program: Program,
}

impl FittedDecoder {
    fn new(row_wires: Option<Vec<usize>>, program: Program) -> Self {
        Self {
            row_wires,
            decoder: Mutex::new(ProgramDecoder::new(program)),
        }
    }
}

/// Fits the decoder `kind` (ridge, rbf or fuzzy) to readings (samples × channels) and targets (samples × outputs).
#[pyfunction]
#[pyo3(signature = (kind, readings, targets, *, inputs, scaling, seed, row_wires = None, groups = None))]
#[allow(clippy::too_many_arguments, reason = "one for each argument in Python")]
pub fn fit_decoder(
    py: Python<'_>,
    kind: &str,
    readings: Matrix<'_>,
    targets: Matrix<'_>,
    inputs: &str,
    scaling: &str,
    seed: u64,
    row_wires: Option<Vec<usize>>,
    groups: Option<Vec<usize>>,
) -> PyResult<FittedDecoder> {
    let choice = InputChoice {
        quantity: quantity(inputs)?,
        scaling: ScalingChoice::parse(scaling).map_err(value_error)?,
    };
    let samples = Samples {
        readings: readings.view(),
        targets: targets.view(),
        row_wires,
        groups,
    };
    let set = samples.dataset()?;
    let row_wires = set.row_wires_read().map(<[usize]>::to_vec);
    let model = if row_wires.is_some() {
        RowModel::Each
    } else {
        RowModel::Shared
    };
    let unseen = NoiseSource::default();
    let mut rng = Seed(seed).rng(Stream::Expectation);
    let mut fit = |set: &Dataset| match kind {
        "ridge" => Program::ridge(set, choice.quantity, unseen).map_err(|error| error.to_string()),
        "rbf" => Program::radial_basis(set, choice, unseen, &mut rng).map_err(|error| error.to_string()),
        "fuzzy" => Program::fuzzy(set, choice.quantity, unseen, &mut rng).map_err(|error| error.to_string()),
        other => Err(format!("'{other}' is not a decoder: give ridge, rbf or fuzzy")),
    };
    let programs = detached(py, || PerRow::fit(&set, model, &mut fit))?;
    Ok(FittedDecoder::new(row_wires, Program::each(&programs)))
}

#[pymethods]
impl FittedDecoder {
    /// Decodes readings (samples × channels) to targets (samples × outputs).
    #[pyo3(signature = (readings, rows = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        readings: Matrix<'py>,
        rows: Option<Vec<usize>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let view = readings.view();
        let (samples, found) = view.dim();
        let indices = match &self.row_wires {
            Some(known) => Some(row_indices(known, rows, samples)?),
            None => None,
        };
        let answers = detached(py, || {
            // A panic leaves only buffers behind, which the next call overwrites.
            let mut decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            let expected = decoder.channels();
            if found != expected {
                return Err(format!(
                    "X has {} per sample, the decoder reads {expected}",
                    counted(found, "reading")
                ));
            }
            decode(&mut decoder, view, indices.as_deref()).map_err(|error| error.to_string())
        })?;
        Ok(answers.into_pyarray(py))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
        let state = State {
            row_wires: self.row_wires.clone(),
            program: decoder.program().clone(),
        };
        let bytes = PyBytes::new(py, &serde_json::to_vec(&state).map_err(value_error)?);
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, PyTuple::new(py, [bytes])?))
    }

    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        let State { row_wires, program } = serde_json::from_slice(state).map_err(|error| {
            PyValueError::new_err(format!(
                "this pickle was written by another version of Decoupler, or is damaged ({error}): fit the decoder again"
            ))
        })?;
        Ok(Self::new(row_wires, program))
    }
}
