//! Samples of a simulated array.

use decoupler_core::{
    dataset::{Dataset, Seed},
    evaluation::{Preset, RunSets, RunSettings},
    job::Job,
    scene::{Loading, Movement, Noise, NoisySets, Rows},
    text::Named,
};
use decoupler_files::machine::memory_budget;
use numpy::ToPyArray;
use pyo3::{prelude::*, types::PyDict};

use crate::{
    sensor::Sensor,
    work::{detached, value_error},
};

/// Settings of a simulation, under the names of the arguments in Python; `None` for the value of the preset.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings {
    preset: String,
    samples: Option<usize>,
    validation_samples: Option<usize>,
    test_samples: Option<usize>,
    rows: Option<String>,
    axes: Option<String>,
    loading: Option<String>,
    noise: f64,
    noise_ohm: f64,
    adc_bits: Option<u8>,
    drift: f64,
    noise_in: String,
    seed: u64,
}

impl Settings {
    /// Settings as the program makes them from the same values.
    fn run(&self, sensor: &Sensor) -> PyResult<RunSettings> {
        let noise = Noise {
            relative: self.noise,
            additive_ohm: self.noise_ohm,
            converter_bits: self.adc_bits,
            drift: self.drift,
            sets: match self.noise_in.as_str() {
                "both" => NoisySets::Both,
                "training" => NoisySets::Training,
                "test" => NoisySets::Test,
                other => return Err(value_error(format!("noise_in: '{other}': give both, training or test"))),
            },
        };
        let preset: Preset = Preset::parse(&self.preset).map_err(value_error)?;
        let mut source = preset.simulation_in(noise);
        source.sensor = sensor.0;
        source.samples = self.samples.unwrap_or(source.samples);
        source.validation_samples = self.validation_samples.unwrap_or(source.validation_samples);
        source.test_samples = self.test_samples.unwrap_or(source.test_samples);
        let scene = &mut source.scene;
        if let Some(rows) = &self.rows {
            scene.rows = rows.parse::<Rows>().map_err(value_error)?;
        }
        if let Some(axes) = &self.axes {
            scene.movement = Movement::parse(axes).map_err(value_error)?;
        }
        if let Some(loading) = &self.loading {
            scene.loading = loading.parse::<Loading>().map_err(value_error)?;
        }
        scene.check().map_err(value_error)?;
        Ok(RunSettings {
            source: source.into(),
            seed: Seed(self.seed),
            ..preset.settings_in(noise)
        })
    }
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
    settings: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyDict>, Option<Bound<'py, PyDict>>, Bound<'py, PyDict>, f64)> {
    let settings = settings.extract::<Settings>()?.run(sensor)?;
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
