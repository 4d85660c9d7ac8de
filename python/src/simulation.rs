//! Samples of a simulated array.

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Preset, RunSets, RunSettings},
    job::Job,
    text::Named,
};
use decoupler_files::machine::memory_budget;
use numpy::ToPyArray;
use pyo3::{prelude::*, types::PyDict};

use crate::{
    sensor::Sensor,
    settings::{self, Given},
    work::{detached, value_error},
};

/// Settings of a simulation of `sensor`, with what is given in Python; the rest is that of the preset at this noise.
fn settings_of(sensor: &Sensor, preset: &str, given: &Given) -> PyResult<RunSettings> {
    let preset: Preset = Preset::parse(preset).map_err(value_error)?;
    let with = |base: RunSettings| {
        let mut settings = base;
        if let Some(simulation) = settings.simulation_mut() {
            simulation.sensor = sensor.0;
        }
        settings::apply(&mut settings, given)?;
        Ok::<_, PyErr>(settings)
    };
    // As many samples as the noise requires.
    let noise = with(preset.settings())?
        .simulation()
        .map(|simulation| simulation.scene.noise);
    let settings = with(preset.settings_in(noise.unwrap_or_default()))?;
    if let Some(simulation) = settings.simulation() {
        simulation.scene.check().map_err(value_error)?;
    }
    Ok(settings)
}

/// Arrays of a set: readings, targets, row-wires and snapshots, both from 0.
pub fn arrays<'py>(py: Python<'py>, set: &Dataset) -> PyResult<Bound<'py, PyDict>> {
    let arrays = PyDict::new(py);
    arrays.set_item("X", set.readings().to_pyarray(py))?;
    arrays.set_item("y", set.targets().to_pyarray(py))?;
    let row_wires: Option<Vec<i64>> = (0..set.samples())
        .map(|sample| set.row_wire(sample).map(|row_wire| row_wire as i64))
        .collect();
    arrays.set_item("rows", row_wires.map(|row_wires| row_wires.to_pyarray(py)))?;
    let groups = Vec::from_iter(set.groups().iter().map(|&group| group as i64));
    arrays.set_item("groups", groups.to_pyarray(py))?;
    Ok(arrays)
}

/// Draws the sets of a run: training, validation (or `None`) and test samples.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "the parts of a Python tuple")]
pub fn simulate<'py>(
    py: Python<'py>,
    sensor: &Sensor,
    preset: &str,
    settings: Given,
) -> PyResult<(Bound<'py, PyDict>, Option<Bound<'py, PyDict>>, Bound<'py, PyDict>, f64)> {
    let settings = settings_of(sensor, preset, &settings)?;
    let stroke_mm = settings.drawn().map_err(value_error)?.stroke_mm();
    let sets = detached(py, || RunSets::draw(&settings, memory_budget(), &Job::UNINTERRUPTED))?;
    let validation = sets.split.validation.as_ref();
    Ok((
        arrays(py, &sets.split.training)?,
        validation.map(|set| arrays(py, set)).transpose()?,
        arrays(py, &sets.test)?,
        stroke_mm,
    ))
}
