//! Samples of recordings.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use decoupler_core::{dataset::Seed, problem::Channel};
use decoupler_files::{
    export::RecipeFile,
    import::{ImportError, Plan, Recording},
};
use numpy::ToPyArray;
use pyo3::{prelude::*, types::PyDict};

use crate::{
    simulation::arrays,
    work::{detached, value_error},
};

/// Imports the recording of a recipe; returns all samples and the sets into which the program would divide them.
#[pyfunction]
pub fn import_recording<'py>(py: Python<'py>, recipe: PathBuf, seed: u64) -> PyResult<Bound<'py, PyDict>> {
    let plan = detached(py, || RecipeFile::load_recording(&recipe))?;
    divided(py, &plan, seed)
}

/// Imports a recording; `plan` is the JSON that a recipe has under `recording`, with paths relative to the working folder.
#[pyfunction]
pub fn read_recording<'py>(py: Python<'py>, plan: &str, seed: u64) -> PyResult<Bound<'py, PyDict>> {
    let plan: Plan = serde_json::from_str(plan).map_err(value_error)?;
    divided(py, &plan, seed)
}

fn divided<'py>(py: Python<'py>, plan: &Plan, seed: u64) -> PyResult<Bound<'py, PyDict>> {
    let recordings = detached(py, || {
        let mut interrupted = None;
        let recordings = plan.recordings(Path::new(""), &mut |_| match Python::attach(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(signal) => {
                interrupted = Some(signal);
                ControlFlow::Break(())
            }
        });
        // A signal is an exception of its own, not an error of the import.
        Ok::<_, ImportError>(interrupted.map_or(Ok(recordings), Err))
    })??;
    let (recording, test) = recordings.map_err(value_error)?;
    let divided = plan.divide(&recording, test.as_ref(), Seed(seed));
    let (split, test) = divided.map_err(value_error)?;
    let all = of_recording(py, &recording)?;
    all.set_item("training", arrays(py, &split.training)?)?;
    let validation = split.validation.as_ref();
    all.set_item("validation", validation.map(|set| arrays(py, set)).transpose()?)?;
    all.set_item("test", arrays(py, &test)?)?;
    Ok(all)
}

fn of_recording<'py>(py: Python<'py>, recording: &Recording) -> PyResult<Bound<'py, PyDict>> {
    let all = arrays(py, &recording.set)?;
    let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.name.clone()));
    let units = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.unit.clone()));
    all.set_item("inputs", names(&recording.problem.features()))?;
    all.set_item("input_units", units(&recording.problem.features()))?;
    all.set_item("targets", names(&recording.problem.targets))?;
    all.set_item("target_units", units(&recording.problem.targets))?;
    all.set_item("times", recording.times.as_ref().map(|times| times.to_pyarray(py)))?;
    all.set_item("warnings", recording.warnings.clone())?;
    let dropped = recording
        .dropped
        .iter()
        .map(|dropped| (dropped.reason.clone(), dropped.rows));
    all.set_item("dropped", Vec::from_iter(dropped))?;
    Ok(all)
}
