use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::PublishedErrors;
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    network::{InputChoice, LARGEST_HIDDEN},
    scene::{Scene, SceneError},
    sensor::{ArrayScale, SensorModel},
    training::TrainingSettings,
};

/// Everything a run needs; the same settings give the same network, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSettings {
    /// The sensor.
    pub sensor: SensorModel,
    /// What happens to it.
    pub scene: Scene,
    /// What the network is given of the resistances.
    #[serde(default)]
    pub inputs: InputChoice,
    /// Samples that the method fits, of all row-wires read together.
    pub samples: usize,
    /// Samples drawn beside them and held out, to choose the best weights and to stop; 0 for none.
    pub validation_samples: usize,
    /// Samples drawn for the test.
    pub test_samples: usize,
    /// Hidden nodes.
    pub hidden: usize,
    /// Trainings from different random weights, of which the best by its validation error is kept.
    #[serde(default = "one_start")]
    pub starts: usize,
    /// Method, its settings, and when to stop.
    pub training: TrainingSettings,
    /// From which everything random follows.
    pub seed: Seed,
}

/// What a scene came to: nothing that does not vary in it is counted, nor modelled.
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

/// The most starts of one run: enough to know the distribution of its results, and what memory allows.
pub const MOST_STARTS: usize = 100;

/// Files written before there were several starts.
fn one_start() -> usize {
    1
}

/// A number out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what}: {count} is not possible, give from {} to {}", .allowed.start(), .allowed.end())]
pub struct CountError {
    /// What is counted.
    pub what: &'static str,
    /// The number given.
    pub count: usize,
    /// What is possible.
    pub allowed: RangeInclusive<usize>,
}

impl Default for RunSettings {
    /// The paper's main experiment: 10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples.
    fn default() -> Self {
        Self {
            sensor: SensorModel::new(ArrayScale::default()),
            scene: Scene::default(),
            inputs: InputChoice::PAPER,
            samples: 1000,
            validation_samples: 200,
            test_samples: 100,
            hidden: 12,
            starts: 1,
            training: TrainingSettings::default(),
            seed: Seed::default(),
        }
    }
}

impl RunSettings {
    /// Checks the counts; the parts check themselves where they are used.
    ///
    /// # Errors
    /// The first count out of range.
    pub fn check_counts(&self) -> Result<(), CountError> {
        let counts = [
            ("hidden nodes", self.hidden, 1..=LARGEST_HIDDEN),
            ("starts", self.starts, 1..=MOST_STARTS),
            ("training samples", self.samples, 1..=LARGEST_SAMPLES),
            ("validation samples", self.validation_samples, 0..=LARGEST_SAMPLES),
            ("test samples", self.test_samples, 1..=LARGEST_SAMPLES),
        ];
        for (what, count, allowed) in counts {
            if !allowed.contains(&count) {
                return Err(CountError { what, count, allowed });
            }
        }
        Ok(())
    }

    /// What the paper reports for this configuration, if it does.
    pub fn published(&self) -> Option<PublishedErrors> {
        let published = PublishedErrors::of(self.sensor.scale, self.hidden, self.samples);
        published.filter(|_| self.is_papers_scene())
    }

    /// Whether scene and inputs are those of the paper's experiments.
    pub fn is_papers_scene(&self) -> bool {
        self.scene == Scene::default() && self.inputs == InputChoice::PAPER
    }

    /// What is to be found, from what, by how many networks.
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
            networks: if self.scene.rows.are_known() { rows } else { 1 },
        })
    }

    /// The distance a node can travel: the full scale of its deformation.
    pub fn stroke_mm(&self) -> f64 {
        self.scene.stroke_mm(&self.sensor.geometry)
    }
}
