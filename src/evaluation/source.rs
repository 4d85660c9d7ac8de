use serde::{Deserialize, Serialize};

use crate::{
    scene::{RowModel, Scene, SceneError},
    sensor::{ArrayScale, SensorModel},
};

/// Where the samples of a run come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// Drawn from a model of the sensor.
    Simulated(Simulation),
    /// Given as sets that were measured.
    Measured(Measured),
}

/// A simulated sensor, what happens to it, and how many samples are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// The sensor.
    pub sensor: SensorModel,
    /// The scene.
    pub scene: Scene,
    /// Samples that the method fits, of all row-wires read together.
    pub samples: usize,
    /// Samples drawn beside them and held out, to choose the best weights and to stop; 0 for none.
    pub validation_samples: usize,
    /// Samples drawn for the test.
    pub test_samples: usize,
}

/// Measured samples. Nothing is known of the sensor but its readings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// One network for every row-wire, or one for each; without row-wires there is one either way.
    pub rows: RowModel,
}

/// What a scene comes to: nothing that does not vary in it is counted, nor modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelSize {
    /// Row-wires read.
    pub rows: usize,
    /// Coordinates to be found in a frame, all rows read at one moment.
    pub unknowns: usize,
    /// Resistances read in a frame.
    pub equations: usize,
    /// Networks: one, or one for each known row.
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
    /// The simulation, if it is one.
    pub fn simulation(&self) -> Option<&Simulation> {
        match self {
            Self::Simulated(simulation) => Some(simulation),
            Self::Measured(_) => None,
        }
    }

    /// One network for every row-wire, or one for each.
    pub fn row_model(&self) -> RowModel {
        match self {
            Self::Simulated(simulation) => simulation.scene.rows.model(),
            Self::Measured(measured) => measured.rows,
        }
    }
}

impl Default for Simulation {
    /// The paper's main experiment: 10×10_5×30, 1000 training and 100 test samples.
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
    /// Number of unknowns, equations and networks.
    ///
    /// # Errors
    /// A row that the array does not have.
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

    /// The distance a node can travel: the full scale of its deformation.
    pub fn stroke_mm(&self) -> f64 {
        self.scene.stroke_mm(&self.sensor.geometry)
    }
}
