//! Samples of recordings.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use decoupler_core::{dataset::Seed, problem::Channel};
use decoupler_files::{
    export::RecipeFile,
    import::{ImportError, Recording},
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
    let sets = detached(py, || {
        let mut interrupted = None;
        let sets = plan.sets(
            Path::new(""),
            Seed(seed),
            &mut |_| match Python::attach(|py| py.check_signals()) {
                Ok(()) => ControlFlow::Continue(()),
                Err(signal) => {
                    interrupted = Some(signal);
                    ControlFlow::Break(())
                }
            },
        );
        // A signal is an exception of its own, not an error of the import.
        Ok::<_, ImportError>(interrupted.map_or(Ok(sets), Err))
    })??;
    let sets = sets.map_err(value_error)?;
    let all = of_recording(py, &sets.recording)?;
    all.set_item("training", arrays(py, &sets.split.training)?)?;
    let validation = sets.split.validation.as_ref();
    all.set_item("validation", validation.map(|set| arrays(py, set)).transpose()?)?;
    all.set_item("test", arrays(py, &sets.test)?)?;
    Ok(all)
}

fn of_recording<'py>(py: Python<'py>, recording: &Recording) -> PyResult<Bound<'py, PyDict>> {
    let all = arrays(py, &recording.set)?;
    let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.name.clone()));
    let units = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.unit.clone()));
    all.set_item("inputs", names(&recording.inputs))?;
    all.set_item("input_units", units(&recording.inputs))?;
    all.set_item("targets", names(&recording.targets))?;
    all.set_item("target_units", units(&recording.targets))?;
    all.set_item("times", recording.times.as_ref().map(|times| times.to_pyarray(py)))?;
    all.set_item("warnings", recording.warnings.clone())?;
    let dropped = recording
        .dropped
        .iter()
        .map(|dropped| (dropped.reason.clone(), dropped.rows));
    all.set_item("dropped", Vec::from_iter(dropped))?;
    Ok(all)
}
