use serde::{Deserialize, Serialize};

use crate::{
    scene::{RowModel, Scene, SceneError},
    sensor::{ArrayScale, SensorModel},
};

/// Source of the samples of a run.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one a run, and a box would cost the settings their `Copy`"
)]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Samples drawn from a model of the sensor.
    Simulated(Simulation),
    /// Sets of measured samples.
    Measured(Measured),
}

/// A simulated sensor, its scene, and the numbers of samples to draw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulation {
    /// Model of the sensor.
    pub sensor: SensorModel,
    /// Rows, axes, loading and noise that are modelled.
    pub scene: Scene,
    /// Number of training samples, of all row-wires read together. A run holds up to 100 000; further ones are drawn again
    /// whenever the training walks over them.
    pub samples: usize,
    /// Number of held-out samples, drawn in addition to choose the best weights and to stop the training; 0 for none.
    pub validation_samples: usize,
    /// Number of test samples.
    pub test_samples: usize,
}

/// Measured samples; only the readings of the sensor are known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// One network shared by all row-wires or one per row-wire; without row-wires both are the same.
    pub rows: RowModel,
}

/// Size of the model of a scene; coordinates that do not vary are not counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelSize {
    /// Number of row-wires read.
    pub rows: usize,
    /// Number of unknown coordinates in a frame, over all rows.
    pub unknowns: usize,
    /// Number of resistances in a frame.
    pub equations: usize,
    /// Number of networks: one, or one per known row.
    pub networks: usize,
}

impl From<Simulation> for Source {
    fn from(simulation: Simulation) -> Self {
        Self::Simulated(simulation)
    }
}

impl From<Measured> for Source {
    fn from(measured: Measured) -> Self {
        Self::Measured(measured)
    }
}

impl Source {
    /// Returns the simulation, if there is one.
    pub fn simulation(&self) -> Option<&Simulation> {
        match self {
            Self::Simulated(simulation) => Some(simulation),
            Self::Measured(_) => None,
        }
    }

    /// Returns the row model: one network shared by all row-wires, or one per row-wire.
    pub fn row_model(&self) -> RowModel {
        match self {
            Self::Simulated(simulation) => simulation.scene.rows.model(),
            Self::Measured(measured) => measured.rows,
        }
    }
}

impl Default for Simulation {
    /// Returns the paper's main experiment: 10×10_5×30, 1000 training and 100 test samples.
    fn default() -> Self {
        Self {
            sensor: SensorModel::new(ArrayScale::default()),
            scene: Scene::default(),
            samples: 1000,
            validation_samples: 200,
            test_samples: 100,
        }
    }
}

impl Simulation {
    /// Counts the unknowns, equations and networks.
    ///
    /// # Errors
    /// If the array lacks a row of the scene.
    pub fn model_size(&self) -> Result<ModelSize, SceneError> {
        let scale = self.sensor.scale;
        let rows = self.scene.rows.read(scale.rows())?.len();
        Ok(ModelSize {
            rows,
            unknowns: rows * self.scene.unknowns_per_row(scale),
            equations: rows * scale.columns(),
            networks: match self.scene.rows.model() {
                RowModel::Shared => 1,
                RowModel::Each => rows,
            },
        })
    }

    /// Largest travel of a node in millimetres, the full scale of its deformation.
    pub fn stroke_mm(&self) -> f64 {
        self.scene.stroke_mm(&self.sensor.geometry)
    }
}
