//! Training of networks.

use std::sync::{Mutex, PoisonError};

use decoupler_core::{
    dataset::{Dataset, History, Memory, Split, SplitBy},
    evaluation::{
        Intervals, Run, RunError, RunSets, RunSettings, TrainingSize, Workload,
        auto::{AutoChoice, AutoFixed, AutoSamples, choose_settings},
    },
    job::Job,
    network::Quantity,
    problem::{Channel, Problem},
    scene::RowModel,
    settings::Value,
    text::Named,
    training::{EpochRecord, Method},
};
use decoupler_files::machine::memory_budget;
use numpy::{IntoPyArray, PyArray1};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{
    arrays::{Matrix, Samples, parts},
    network::Network,
    saving::{self, Origin, division, samples_crc32},
    settings::{self, Given},
    work::{detached, value_error},
};

/// Settings of a training, under the names of the estimator's parameters.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings {
    /// Settings of network and training, by their names in the table of settings; without `hidden`, settings are chosen by
    /// cross-validation.
    run: Given,
    /// Time constants of a memory, `none` or `auto`.
    memory: Option<Vec<String>>,
    budget: f64,
    method_settings: Option<Vec<(String, f64)>>,
    validation_fraction: Option<f64>,
    split: String,
    inputs: String,
    intervals: String,
    /// Names of the readings, where known.
    input_names: Option<Vec<String>>,
    /// Names of the targets, where known.
    target_names: Option<Vec<String>>,
}

impl Settings {
    /// Settings of a run on measured samples, as the program makes them from the same values.
    fn run(&self, has_row_wires: bool) -> PyResult<RunSettings> {
        let rows = if has_row_wires {
            RowModel::Each
        } else {
            RowModel::Shared
        };
        let mut settings = RunSettings::measured(rows);
        settings::apply(&mut settings, &self.run)?;
        let method = &mut settings.training.method;
        for (name, value) in self.method_settings.iter().flatten() {
            set(method, name, *value)?;
        }
        settings.training.check().map_err(value_error)?;
        settings.inputs.quantity = quantity(&self.inputs)?;
        settings.check_counts().map_err(value_error)?;
        Ok(settings)
    }

    /// Returns `true` if settings are chosen by cross-validation.
    fn is_auto(&self) -> bool {
        self.run.iter().all(|(name, _)| name != "hidden")
    }

    /// Memory that is given, and whether a choice of settings tries some.
    fn memory(&self) -> PyResult<(Option<Memory>, bool)> {
        let words = self.memory.iter().flatten().map(String::as_str);
        match Vec::from_iter(words)[..] {
            [] => Ok((None, false)),
            ["none"] => Ok((Some(Memory::default()), false)),
            ["auto"] if self.is_auto() => Ok((None, true)),
            ["auto"] => Err(value_error(
                "memory: \"auto\" is for hidden=\"auto\"; give time constants",
            )),
            ref spans => {
                let averages = spans
                    .iter()
                    .map(|span| span.parse())
                    .collect::<Result<_, _>>()
                    .map_err(value_error)?;
                let memory = Memory {
                    averages,
                    ..Memory::default()
                };
                Ok((Some(memory), false))
            }
        }
    }

    /// `true` if intervals are to be calibrated.
    fn calibrates(&self) -> PyResult<bool> {
        match self.intervals.as_str() {
            "always" => Ok(true),
            "never" => Ok(false),
            other => Err(value_error(format!(
                "intervals: '{other}' is not a choice: give always or never"
            ))),
        }
    }

    /// Description of the channels by their names, or by numbers where there are none.
    fn problem(&self, set: &Dataset) -> Problem {
        let mut problem = Problem::unnamed(set.channels(), set.outputs());
        let rename = |channels: &mut Vec<Channel>, names: &Option<Vec<String>>| {
            for (channel, name) in channels.iter_mut().zip(names.iter().flatten()) {
                channel.name.clone_from(name);
            }
        };
        rename(&mut problem.inputs, &self.input_names);
        rename(&mut problem.targets, &self.target_names);
        problem
    }
}

/// Parses the quantity computed from each reading.
pub fn quantity(name: &str) -> PyResult<Quantity> {
    if name == "raw" {
        return Ok(Quantity::Raw);
    }
    Quantity::parse(name).map_err(|_| {
        value_error(format!(
            "inputs: '{name}' is not a quantity: give raw, resistance, conductance or log"
        ))
    })
}

/// Changes a setting of a method by its name, with spaces, dashes or underscores.
fn set(method: &mut Method, name: &str, value: f64) -> PyResult<()> {
    let underscored = |name: &str| name.replace([' ', '-'], "_");
    let mut settings = method.settings();
    match settings.find(|setting| setting.word("_") == underscored(name)) {
        Some(setting) => setting.set(method, &Value::Number(value)).map_err(value_error),
        None => Err(value_error(format!(
            "method_settings: {} has no setting '{name}'; it has {}",
            method.short_name(),
            Vec::from_iter(method.settings().map(|setting| setting.word("_"))).join(", ")
        ))),
    }
}

/// Result of a training.
#[pyclass(frozen, module = "decoupler._native")]
pub struct Training {
    /// Best networks.
    #[pyo3(get)]
    network: Py<Network>,
    history: Vec<EpochRecord>,
    /// Number of epochs of the best start.
    #[pyo3(get)]
    epochs: usize,
    /// Epoch of the best network.
    #[pyo3(get)]
    best_epoch: usize,
    /// Reason why the training ended.
    #[pyo3(get)]
    stop_reason: String,
    /// Defect of the training with its remedy, or the reason why there are no intervals.
    #[pyo3(get)]
    warning: Option<String>,
    /// Exception that ended the training: `KeyboardInterrupt`, or one that the callback raised.
    #[pyo3(get)]
    interruption: Option<Py<PyAny>>,
}

#[pymethods]
impl Training {
    /// Training error after each epoch, that of the start first.
    #[getter]
    fn loss_curve<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let losses = self.history.iter().map(|record| record.training_mse);
        Vec::from_iter(losses).into_pyarray(py)
    }

    /// Validation error after each epoch, that of the start first; `None` if nothing is held out.
    #[getter]
    fn validation_loss_curve<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let losses = self.history.iter().map(|record| record.validation_mse);
        Some(losses.collect::<Option<Vec<f64>>>()?.into_pyarray(py))
    }
}

/// Validation samples: readings, targets, and the row-wire of each.
type Validation<'py> = (Matrix<'py>, Matrix<'py>, Option<Vec<usize>>);

/// Trains networks on readings (samples × channels) and targets (samples × outputs).
#[pyfunction]
#[pyo3(signature = (readings, targets, settings, *, row_wires = None, groups = None, validation = None, callback = None))]
#[allow(clippy::too_many_arguments, reason = "one for each argument in Python")]
pub fn train(
    py: Python<'_>,
    readings: Matrix<'_>,
    targets: Matrix<'_>,
    settings: &Bound<'_, PyAny>,
    row_wires: Option<Vec<usize>>,
    groups: Option<Vec<usize>>,
    validation: Option<Validation<'_>>,
    callback: Option<Bound<'_, PyAny>>,
) -> PyResult<Training> {
    let settings: Settings = settings.extract()?;
    let run_settings = settings.run(row_wires.is_some())?;
    let calibrates = settings.calibrates()?;
    let by: SplitBy = SplitBy::parse(&settings.split).map_err(value_error)?;
    if by == SplitBy::Group && groups.is_none() && validation.is_none() {
        return Err(PyValueError::new_err(
            "split=\"group\": give the group of each sample with groups",
        ));
    }
    let samples = Samples {
        readings: readings.view(),
        targets: targets.view(),
        row_wires,
        groups,
    };
    let usual = run_settings.validation_fraction();
    let division = division(by, settings.validation_fraction.unwrap_or(usual));
    let (given, tries_memory) = settings.memory()?;
    let is_auto = settings.is_auto();
    if (is_auto || given.is_some()) && (validation.is_some() || samples.row_wires.is_some()) {
        return Err(PyValueError::new_err(
            "hidden=\"auto\" and memory are for one network, without validation samples given apart: leave out rows \
             and validation",
        ));
    }
    let all = if is_auto || given.is_some() {
        Some(samples.dataset()?)
    } else {
        None
    };
    let history = all.as_ref().map(|all| past(all, samples.groups.is_some()));
    let fixed = AutoFixed {
        memory: given,
        tries_memory,
        ..AutoFixed::default()
    };
    let choice = match (&all, &history) {
        (Some(all), Some(history)) if is_auto => {
            Some(choose(py, &run_settings, &fixed, (all, history, by), settings.budget)?)
        }
        _ => None,
    };
    let memory = choice.as_ref().map(|choice| choice.memory.clone()).or(fixed.memory);
    let memory = memory.filter(|memory| !memory.is_empty());
    let run_settings = choice.as_ref().map_or(run_settings, |choice| choice.settings);
    let division = match is_auto {
        true => saving::division(by, 0.0),
        false => division,
    };
    let split = match &validation {
        None => samples.split(division, run_settings.seed)?,
        Some((readings, targets, row_wires)) => {
            let held_out = Samples {
                readings: readings.view(),
                targets: targets.view(),
                row_wires: row_wires.clone(),
                groups: None,
            };
            let training = samples.dataset()?;
            let read = training.row_wires_read().unwrap_or_default();
            Split {
                validation: Some(held_out.dataset()?.among_rows(read).map_err(value_error)?),
                training,
            }
        }
    };
    let row_wires = split.training.row_wires_read().map(<[usize]>::to_vec);
    let mut problem = settings.problem(&split.training);
    let crc32 = samples_crc32(&split.training);
    let split = match (&memory, &history, &all) {
        (Some(memory), Some(history), Some(all)) => {
            let memory = history.checked(memory).map_err(value_error)?;
            let features = all.with_readings(history.features(&memory).map_err(value_error)?);
            problem.memory = Some(memory);
            let (training, held_out) = parts(&features, division, run_settings.seed)?;
            Split {
                training: features.select(&training),
                validation: (!held_out.is_empty()).then(|| features.select(&held_out)),
            }
        }
        _ => split,
    };
    let calibration = calibrates.then(|| split.training.clone());
    let size = TrainingSize::of(&run_settings, &split.training);
    Workload::of(&run_settings, size)
        .check_memory(memory_budget())
        .map_err(value_error)?;
    let mut run = detached(py, move || {
        Run::new(run_settings, RunSets::without_test(split), None, &Job::UNINTERRUPTED)
    })?;
    let mut interruption = step_to_the_end(py, &mut run, callback.as_ref());
    run.stop();
    let mut warning = run.defect();
    let chosen = choice.as_ref().filter(|_| calibrates).zip(all.as_ref());
    let chosen = chosen.map(|(choice, all)| Intervals::calibrate(all, choice.answers.view(), by));
    let calibrated = calibration
        .filter(|_| interruption.is_none() && choice.is_none())
        .map(|set| calibrate(py, &run_settings, &set, by));
    let intervals = match calibrated {
        None => chosen,
        Some(Ok(Ok(intervals))) => Some(intervals),
        Some(Ok(Err(reason))) => {
            warning.get_or_insert_with(|| format!("no prediction intervals: {reason}"));
            None
        }
        Some(Err(error)) => {
            interruption = Some(error);
            None
        }
    };
    let origin = Origin::of(&run, validation.is_none().then_some(division), crc32);
    let combined = choice.map(|choice| choice.combined).filter(|_| interruption.is_none());
    let network = Network::trained(
        (run.network(), combined),
        row_wires,
        problem,
        run_settings,
        intervals,
        origin,
    );
    let leader = run.leader();
    Ok(Training {
        network: Py::new(py, network)?,
        history: leader.history().to_vec(),
        epochs: leader.latest().epoch,
        best_epoch: leader.best_epoch(),
        stop_reason: run.stop_reason().map_or_else(String::new, |reason| reason.to_string()),
        warning,
        interruption: interruption.map(|error| error.into_value(py).into_any()),
    })
}

/// The samples as a recording, whose groups do not continue each other.
fn past(all: &Dataset, has_groups: bool) -> History {
    let groups = Vec::from_iter(all.groups().iter().map(|group| *group as u64));
    let samples = (0..all.samples()).collect();
    History::new(
        all.readings().to_owned(),
        has_groups.then_some(&groups[..]),
        None,
        None,
        samples,
    )
}

/// Chooses settings by cross-validation.
fn choose(
    py: Python<'_>,
    settings: &RunSettings,
    fixed: &AutoFixed,
    (all, history, by): (&Dataset, &History, SplitBy),
    budget_s: f64,
) -> PyResult<AutoChoice> {
    let samples = AutoSamples {
        set: all,
        past: Some((history, history.samples())),
        by,
    };
    interruptible(py, |job| {
        choose_settings(settings, fixed, &samples, (budget_s, memory_budget()), job, &mut |_| ())
    })?
    .map_err(value_error)
}

/// Runs `work` without the interpreter, until a signal cancels it, which is then raised.
fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&Job<'_>) -> T + Send) -> PyResult<T> {
    let interruption = Mutex::new(None);
    let done = detached(py, || {
        let is_cancelled = || {
            let signal = Python::attach(|py| py.check_signals()).err();
            let mut interruption = interruption.lock().unwrap_or_else(PoisonError::into_inner);
            if interruption.is_none() {
                *interruption = signal;
            }
            interruption.is_some()
        };
        Ok::<_, RunError>(work(&Job::new(&is_cancelled)))
    })?;
    match interruption.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(signal) => Err(signal),
        None => Ok(done),
    }
}

/// Trains to the end, to a signal, or until the callback asks for the end. Returns the exception that ended it, if any;
/// the run keeps its best networks.
fn step_to_the_end(py: Python<'_>, run: &mut Run, callback: Option<&Bound<'_, PyAny>>) -> Option<PyErr> {
    while run.stop_reason().is_none() {
        let stepped = detached(py, || {
            run.step();
            Ok::<_, String>(())
        });
        if let Err(error) = stepped.and_then(|()| py.check_signals()) {
            return Some(error);
        }
        match callback.map(|callback| report(run, callback)).transpose() {
            Err(error) => return Some(error),
            Ok(Some(true)) => return None,
            Ok(_) => {}
        }
    }
    None
}

/// Calls `callback(epoch, losses)` with the errors of the best start. Returns `true` if it asks for the end.
fn report(run: &Run, callback: &Bound<'_, PyAny>) -> PyResult<bool> {
    let latest = run.leader().latest();
    let losses = PyDict::new(callback.py());
    losses.set_item("training", latest.training_mse)?;
    losses.set_item("validation", latest.validation_mse)?;
    callback.call1((latest.epoch, losses))?.is_truthy()
}

/// Calibrates prediction intervals by cross-validation of the training samples. Returns the reason if the samples do not
/// suffice.
fn calibrate(
    py: Python<'_>,
    settings: &RunSettings,
    set: &Dataset,
    by: SplitBy,
) -> PyResult<Result<Intervals, RunError>> {
    let calibrated = interruptible(py, |job| Intervals::cross_validate(settings, set, by, job))?;
    match calibrated {
        Err(error)
            if !matches!(
                error,
                RunError::NoIntervals | RunError::Division(_) | RunError::Cancelled(_)
            ) =>
        {
            Err(value_error(error))
        }
        calibrated => Ok(calibrated),
    }
}
