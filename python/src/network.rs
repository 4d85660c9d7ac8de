//! Trained networks, from a fit or from a file.

use std::{
    path::PathBuf,
    sync::{Mutex, PoisonError},
};

use decoupler_core::{
    dataset::History,
    decoupling::{Combined, Program, ProgramDecoder},
    evaluation::{Intervals, RunSettings},
    network::Networks,
    problem::{Channel, Problem},
    text::{Named, counted},
};
use decoupler_files::export::{
    NetworkFile,
    bundle::{BundleFormat, BundlePrecision, ExportedDecoder, export_bundle},
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyDict, PyTuple},
};
use serde::{Deserialize, Serialize};

use crate::{
    arrays::{Matrix, MatrixView, Samples, decode, row_indices},
    saving::{Origin, Saved},
    work::{detached, value_error},
};

/// Trained networks with their scalings: one for all row-wires, or one for each.
#[pyclass(frozen, module = "decoupler._native")]
pub struct Network {
    record: Record,
    /// The file that it was read from, with its scores and its record of the training.
    file: Option<NetworkFile>,
    decoder: Mutex<ProgramDecoder>,
}

/// What a network needs to decode and to be exported.
#[derive(Serialize, Deserialize)]
struct Record {
    networks: Networks,
    /// What it answers with instead of its network alone, if settings were chosen.
    #[serde(default)]
    combined: Option<Combined>,
    /// Row-wires with a network each, in ascending order.
    row_wires: Option<Vec<usize>>,
    #[serde(with = "saved_problem")]
    problem: Problem,
    settings: RunSettings,
    intervals: Option<Intervals>,
    /// Record of the training; `None` for a network from a file, which has its own.
    origin: Option<Origin>,
}

/// The problem of a network that was trained in Python, which has no sensor.
mod saved_problem {
    use decoupler_core::problem::Problem;
    use decoupler_files::export::SavedProblem;
    use serde::{Deserializer, Serializer, de::Error as _};

    pub(super) fn serialize<S: Serializer>(problem: &Problem, serializer: S) -> Result<S::Ok, S::Error> {
        SavedProblem::serialize(problem, serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Problem, D::Error> {
        match SavedProblem::deserialize(deserializer)? {
            problem if problem.has_nodes() => Err(D::Error::custom("the network has no sensor model")),
            problem => Ok(problem),
        }
    }
}

/// Readings, targets, row-wires and groups of samples.
type SampleParts<'py> = (Matrix<'py>, Matrix<'py>, Option<Vec<usize>>, Option<Vec<usize>>);

fn samples<'a>((readings, targets, row_wires, groups): &'a SampleParts<'_>) -> Samples<'a> {
    Samples {
        readings: readings.view(),
        targets: targets.view(),
        row_wires: row_wires.clone(),
        groups: groups.clone(),
    }
}

/// Contents of a pickle.
#[derive(Serialize, Deserialize)]
enum State {
    Trained(Box<Record>),
    /// Text of the network file.
    File(String),
}

impl Record {
    /// The program of the answers; readings are limited to their range in training.
    fn program(&self) -> Program {
        self.networks.decoder_program(&self.problem, self.combined.as_ref())
    }
}

impl Network {
    fn new(record: Record, file: Option<NetworkFile>) -> Self {
        Self {
            decoder: Mutex::new(ProgramDecoder::new(record.program())),
            record,
            file,
        }
    }

    /// Wraps the networks of a fit; `row_wires` are those with a network each.
    pub fn trained(
        (networks, combined): (Networks, Option<Combined>),
        row_wires: Option<Vec<usize>>,
        problem: Problem,
        settings: RunSettings,
        intervals: Option<Intervals>,
        origin: Origin,
    ) -> Self {
        let record = Record {
            networks,
            combined,
            row_wires,
            problem,
            settings,
            intervals,
            origin: Some(origin),
        };
        Self::new(record, None)
    }

    fn of_file(file: NetworkFile) -> Self {
        let has_rows = file.network.only().is_none();
        let record = Record {
            networks: file.network.clone(),
            combined: file.combined().cloned(),
            row_wires: file.row_wires.clone().filter(|_| has_rows),
            problem: file.problem.clone(),
            settings: file.settings,
            intervals: file.intervals.clone(),
            origin: None,
        };
        Self::new(record, Some(file))
    }

    /// Values computed from the readings and their past, for networks with a memory.
    fn features(&self, readings: MatrixView<'_>, past: &Past) -> PyResult<Option<Array2<f64>>> {
        let Some(memory) = &self.record.problem.memory else {
            return Ok(None);
        };
        let samples = readings.dim().0;
        let Past { rows, times, groups } = past;
        let lengths = [
            ("row-wire", rows.as_ref().map(Vec::len)),
            ("time", times.as_ref().map(Vec::len)),
            ("group", groups.as_ref().map(Vec::len)),
        ];
        if let Some((name, _)) = lengths
            .into_iter()
            .find(|(_, found)| found.is_some_and(|found| found != samples))
        {
            return Err(PyValueError::new_err(format!("give the {name} of each sample")));
        }
        if times.iter().flatten().any(|time| !time.is_finite()) {
            return Err(PyValueError::new_err(
                "times contain NaN or infinity: leave these samples out",
            ));
        }
        let samples = (0..samples).collect();
        let history = History::new(
            readings.to_array(),
            groups.as_deref(),
            rows.as_deref(),
            times.clone(),
            samples,
        );
        let features = history.features(memory).map_err(value_error)?;
        Ok(Some(features.into_owned()))
    }

    fn decode(&self, py: Python<'_>, readings: &Matrix<'_>, past: Past) -> PyResult<Array2<f64>> {
        let view = readings.view();
        let ((samples, found), expected) = (view.dim(), self.record.problem.inputs.len());
        if found != expected {
            return Err(PyValueError::new_err(format!(
                "X has {} per sample, the network reads {expected}",
                counted(found, "reading")
            )));
        }
        let features = self.features(view, &past)?;
        let indices = match &self.record.row_wires {
            Some(known) => Some(row_indices(known, past.rows, samples)?),
            None => None,
        };
        detached(py, || {
            let view = features
                .as_ref()
                .map_or(view, |features| MatrixView::Double(features.view()));
            // A panic leaves only buffers behind, which the next call overwrites.
            let mut decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            decode(&mut decoder, view, indices.as_deref())
        })
    }
}

/// Row-wire, time in seconds and group of each sample, as far as they are known.
struct Past {
    rows: Option<Vec<usize>>,
    times: Option<Vec<f64>>,
    groups: Option<Vec<u64>>,
}

fn names(channels: &[Channel]) -> Vec<String> {
    channels.iter().map(|channel| channel.name.clone()).collect()
}

fn units(channels: &[Channel]) -> Vec<Option<String>> {
    channels.iter().map(|channel| channel.unit.clone()).collect()
}

#[pymethods]
impl Network {
    /// Decodes readings (samples × channels) to targets (samples × targets).
    #[pyo3(signature = (X, rows = None, times = None, groups = None))]
    #[allow(non_snake_case, reason = "the name in scikit-learn")]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        X: Matrix<'py>,
        rows: Option<Vec<usize>>,
        times: Option<Vec<f64>>,
        groups: Option<Vec<u64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(self.decode(py, &X, Past { rows, times, groups })?.into_pyarray(py))
    }

    /// Half-widths of the 90 % prediction intervals (samples × targets) of `answers`, NaN for targets without one.
    fn half_widths<'py>(&self, py: Python<'py>, answers: Matrix<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let Some(intervals) = &self.record.intervals else {
            return Err(PyValueError::new_err(
                "the intervals were not calibrated: train with intervals=\"always\"",
            ));
        };
        let mut answers = answers.view().to_array();
        for (target, mut column) in answers.columns_mut().into_iter().enumerate() {
            column.mapv_inplace(|answer| intervals.half_width(target, answer).unwrap_or(f64::NAN));
        }
        Ok(answers.into_pyarray(py))
    }

    /// Names of the readings.
    #[getter]
    fn inputs(&self) -> Vec<String> {
        names(&self.record.problem.inputs)
    }

    /// Units of the readings, `None` where unknown.
    #[getter]
    fn input_units(&self) -> Vec<Option<String>> {
        units(&self.record.problem.inputs)
    }

    /// Names of the targets.
    #[getter]
    fn targets(&self) -> Vec<String> {
        names(&self.record.problem.targets)
    }

    /// Units of the targets, `None` where unknown.
    #[getter]
    fn target_units(&self) -> Vec<Option<String>> {
        units(&self.record.problem.targets)
    }

    /// Row-wires with a network each; `None` if one network reads all.
    #[getter]
    fn row_wires(&self) -> Option<Vec<usize>> {
        self.record.row_wires.clone()
    }

    /// Number of hidden nodes of each network.
    #[getter]
    fn hidden(&self) -> usize {
        self.record.networks.at(0).mlp().shape().hidden
    }

    /// Number of weights of all networks.
    #[getter]
    fn weights(&self) -> usize {
        self.record.networks.weights()
    }

    /// `True` if the intervals were calibrated.
    #[getter]
    fn has_intervals(&self) -> bool {
        self.record.intervals.is_some()
    }

    /// Settings, record of the training and scores, as in the network file.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = match &self.file {
            None => serde_json::to_string(&serde_json::json!({ "settings": self.record.settings })),
            Some(file) => serde_json::to_string(&serde_json::json!({
                "program": file.program,
                "source": file.source_name(),
                "settings": file.settings,
                "training": file.training,
                "scores": file.scores,
            })),
        };
        py.import("json")?.call_method1("loads", (text.map_err(value_error)?,))
    }

    /// Scalings and weights of each network, as in the network file.
    #[getter]
    fn networks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(self.record.networks.values()).map_err(value_error)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// Writes the network for another program; returns names and sizes of the files, and the largest deviation.
    #[pyo3(signature = (path, format = "onnx", precision = "f64"))]
    fn export<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        format: &str,
        precision: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let format = BundleFormat::parse(format).map_err(value_error)?;
        let precision = BundlePrecision::parse(precision).map_err(value_error)?;
        let record = &self.record;
        let report = detached(py, || match &self.file {
            Some(file) => export_bundle(file, format, precision, &path),
            None => {
                let row_wires = record.row_wires.clone();
                let (networks, combined, problem) =
                    (&record.networks, record.combined.as_ref(), record.problem.clone());
                let exported = ExportedDecoder::of_networks(networks, combined, record.settings, problem, row_wires);
                export_bundle(exported, format, precision, &path)
            }
        })?;
        let written = PyDict::new(py);
        written.set_item("path", report.path.clone())?;
        written.set_item("files", report.files.clone())?;
        written.set_item("deviation", report.deviation())?;
        written.set_item("limit", report.limit)?;
        written.set_item("remarks", report.remarks)?;
        Ok(written)
    }

    /// Writes the network file that it was read from.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        match &self.file {
            Some(file) => detached(py, || file.save(&path)),
            None => Err(PyValueError::new_err(
                "a network file names the recording: save the estimator with its samples, or pickle it",
            )),
        }
    }

    /// Writes the network file of a fit on `training` samples with its errors on `test` samples, each readings, targets,
    /// row-wires and groups, and the samples next to it.
    fn save_trained<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        training: SampleParts<'py>,
        test: SampleParts<'py>,
    ) -> PyResult<()> {
        let record = &self.record;
        let Some((origin, division)) = record
            .origin
            .as_ref()
            .and_then(|origin| Some((origin, origin.division?)))
        else {
            return Err(PyValueError::new_err(
                "the validation samples were given to fit apart, which a network file cannot describe: fit with \
                 validation_fraction instead, or pickle the estimator",
            ));
        };
        let (training, test) = (samples(&training), samples(&test));
        let split = training.split(division, record.settings.seed)?;
        let all = training.dataset()?;
        let read = all.row_wires_read().unwrap_or_default().to_vec();
        let test = test.dataset()?.among_rows(&read).map_err(value_error)?;
        let saved = Saved {
            networks: &record.networks,
            combined: record.combined.as_ref(),
            settings: record.settings,
            problem: &record.problem,
            origin,
            division,
            intervals: record.intervals.as_ref(),
        };
        detached(py, || saved.save(&path, &all, &split, &test))
    }

    fn __repr__(&self) -> String {
        let (inputs, targets) = (self.record.problem.inputs.len(), self.record.problem.targets.len());
        let networks = match &self.record.row_wires {
            Some(rows) => format!(", one for each of {} row-wires", rows.len()),
            None => String::new(),
        };
        format!("<Network {inputs}-{}-{targets}{networks}>", self.hidden())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let bytes = match &self.file {
            None => serde_json::to_vec(&serde_json::json!({ "Trained": self.record })),
            Some(file) => {
                let text = file.to_text().map_err(value_error)?;
                serde_json::to_vec(&State::File(text))
            }
        };
        let bytes = PyBytes::new(py, &bytes.map_err(value_error)?);
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, PyTuple::new(py, [bytes])?))
    }

    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        match serde_json::from_slice(state).map_err(value_error)? {
            State::Trained(record) => Ok(Self::new(*record, None)),
            State::File(text) => Ok(Self::of_file(NetworkFile::from_text(&text).map_err(value_error)?)),
        }
    }
}

/// Reads a network file.
#[pyfunction]
pub fn load_network(py: Python<'_>, path: PathBuf) -> PyResult<Network> {
    let file = detached(py, || NetworkFile::load(&path))?;
    Ok(Network::of_file(file))
}
