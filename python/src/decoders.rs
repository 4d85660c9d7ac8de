//! Decoders without a network: ridge regression, radial-basis networks and fuzzy rules.

use std::sync::{Mutex, PoisonError};

use decoupler_core::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{AffineMap, Decoder, RadialBasisNetwork, TakagiSugeno},
    network::{InputChoice, NetworkError, ScalingChoice},
    scene::{NoiseSource, RowModel},
    text::counted,
};
use numpy::{IntoPyArray, PyArray2};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyTuple},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    arrays::{Matrix, Samples, decode, row_indices},
    training::quantity,
    work::{detached, value_error},
};

/// A fitted decoder: one for all row-wires, or one for each.
#[pyclass(frozen, module = "decoupler._native")]
pub struct FittedDecoder {
    kind: Kind,
    row_wires: Option<Vec<usize>>,
    decoder: Mutex<Fitted>,
}

/// Kind of decoder.
#[derive(Clone, Copy, Serialize, Deserialize)]
enum Kind {
    Ridge,
    RadialBasis,
    Fuzzy,
}

/// Decoders of one kind.
enum Fitted {
    Ridge(PerRow<AffineMap>),
    RadialBasis(PerRow<RadialBasisNetwork>),
    Fuzzy(PerRow<TakagiSugeno>),
}

impl Fitted {
    fn decoder(&mut self) -> &mut dyn Decoder {
        match self {
            Self::Ridge(decoders) => decoders,
            Self::RadialBasis(decoders) => decoders,
            Self::Fuzzy(decoders) => decoders,
        }
    }
}

/// Contents of a pickle.
#[derive(Serialize, Deserialize)]
struct State {
    kind: Kind,
    row_wires: Option<Vec<usize>>,
    decoders: serde_json::Value,
}

impl FittedDecoder {
    fn new(kind: Kind, row_wires: Option<Vec<usize>>, decoder: Fitted) -> Self {
        Self {
            kind,
            row_wires,
            decoder: Mutex::new(decoder),
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
    let kind = match kind {
        "ridge" => Kind::Ridge,
        "rbf" => Kind::RadialBasis,
        "fuzzy" => Kind::Fuzzy,
        other => {
            return Err(PyValueError::new_err(format!(
                "'{other}' is not a decoder: give ridge, rbf or fuzzy"
            )));
        }
    };
    let choice = InputChoice {
        quantity: quantity(inputs)?,
        scaling: scaling.parse::<ScalingChoice>().map_err(value_error)?,
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
    let fitted = detached(py, || fit(kind, &set, model, choice, Seed(seed)))?;
    Ok(FittedDecoder::new(kind, row_wires, fitted))
}

fn fit(kind: Kind, set: &Dataset, model: RowModel, choice: InputChoice, seed: Seed) -> Result<Fitted, NetworkError> {
    let unseen = NoiseSource::default();
    let mut rng = seed.rng(Stream::Expectation);
    Ok(match kind {
        Kind::Ridge => Fitted::Ridge(PerRow::fit(set, model, |set| {
            AffineMap::ridge(set, choice.quantity, unseen)
        })?),
        Kind::RadialBasis => Fitted::RadialBasis(PerRow::fit(set, model, |set| {
            RadialBasisNetwork::fit(set, choice, unseen, &mut rng)
        })?),
        Kind::Fuzzy => Fitted::Fuzzy(PerRow::fit(set, model, |set| {
            TakagiSugeno::fit(set, choice.quantity, unseen, &mut rng)
        })?),
    })
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
            let mut fitted = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            let decoder = fitted.decoder();
            let expected = decoder.channels();
            if found != expected {
                return Err(format!(
                    "X has {} per sample, the decoder reads {expected}",
                    counted(found, "reading")
                ));
            }
            decode(decoder, view, indices.as_deref()).map_err(|error| error.to_string())
        })?;
        Ok(answers.into_pyarray(py))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let fitted = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
        let decoders = match &*fitted {
            Fitted::Ridge(decoders) => serde_json::to_value(decoders.values()),
            Fitted::RadialBasis(decoders) => serde_json::to_value(decoders.values()),
            Fitted::Fuzzy(decoders) => serde_json::to_value(decoders.values()),
        };
        let state = State {
            kind: self.kind,
            row_wires: self.row_wires.clone(),
            decoders: decoders.map_err(value_error)?,
        };
        let bytes = PyBytes::new(py, &serde_json::to_vec(&state).map_err(value_error)?);
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, PyTuple::new(py, [bytes])?))
    }

    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        let State {
            kind,
            row_wires,
            decoders,
        } = serde_json::from_slice(state).map_err(value_error)?;
        let fitted = match kind {
            Kind::Ridge => Fitted::Ridge(each(decoders)?),
            Kind::RadialBasis => Fitted::RadialBasis(each(decoders)?),
            Kind::Fuzzy => Fitted::Fuzzy(each(decoders)?),
        };
        Ok(Self::new(kind, row_wires, fitted))
    }
}

fn each<T: DeserializeOwned>(decoders: serde_json::Value) -> PyResult<PerRow<T>> {
    let values: Vec<T> = serde_json::from_value(decoders).map_err(value_error)?;
    if values.is_empty() {
        return Err(PyValueError::new_err("the pickle contains no decoder"));
    }
    Ok(PerRow::each(values))
}
