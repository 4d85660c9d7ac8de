use std::sync::Arc;

use ndarray::Array2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{CountError, Errors, RunSettings};
use crate::{
    dataset::{Dataset, DatasetError, Split, Stream, hold_out},
    decoupling::{Decoupler, LinearMap, TrainingMean},
    network::{DecouplingNetwork, MinMax, ScalingError, Shape, nguyen_widrow},
    scene::SceneError,
    sensor::SensorError,
    training::{Examples, Problem, Trainer, TrainingError},
};

/// A run: the sets drawn, the training in progress, and what its network is worth. Step it by its trainer.
pub struct Run {
    settings: RunSettings,
    test: Arc<Dataset>,
    inputs: MinMax,
    outputs: MinMax,
    trainer: Trainer,
    baselines: Baselines,
}

/// What stands beside a network in every table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines {
    /// Always answering the mean of the training set.
    pub mean: Errors,
    /// The best affine map on resistance.
    pub linear: Errors,
}

/// Why a run cannot be prepared.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RunError {
    /// A number out of range.
    #[error(transparent)]
    Count(#[from] CountError),
    /// An impossible sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// An impossible scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Samples that cannot be drawn.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Samples that cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] ScalingError),
    /// A training that cannot begin.
    #[error(transparent)]
    Training(#[from] TrainingError),
}

impl Run {
    /// Draws the sets, scales them, starts the network and measures the baselines.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn prepare(settings: RunSettings) -> Result<Self, RunError> {
        settings.check_counts()?;
        settings.training.check().map_err(TrainingError::from)?;
        let test = Self::test_set(&settings)?;
        let RunSettings {
            sensor, scene, seed, ..
        } = settings;
        let rows = sensor.scale.rows();
        let held_out = settings.validation_samples.div_ceil(rows);
        let drawn = (settings.samples.div_ceil(rows) + held_out) * rows;
        let drawn = Dataset::simulate(&sensor, &scene, drawn, &mut seed.rng(Stream::Training))?;
        let split = hold_out(drawn, held_out, &mut seed.rng(Stream::Split));
        Self::with_sets(settings, split, test)
    }

    /// The test set of these settings: what the window shows before anything is trained.
    ///
    /// # Errors
    /// An impossible sensor, scene, or number of samples.
    pub fn test_set(settings: &RunSettings) -> Result<Dataset, RunError> {
        settings.sensor.check()?;
        settings.scene.check()?;
        let mut rng = settings.seed.rng(Stream::Test);
        Ok(Dataset::simulate(
            &settings.sensor,
            &settings.scene,
            settings.test_samples,
            &mut rng,
        )?)
    }

    fn with_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        let Split { training, validation } = split;
        let stroke_mm = settings.stroke_mm();
        let score = |decoupler: &dyn Decoupler| {
            Errors::measure(&test, &decoupler.decouple(test.resistances_ohm.view()), stroke_mm)
        };
        let baselines = Baselines {
            mean: score(&TrainingMean::fit(&training)),
            linear: score(&LinearMap::fit(&training)?),
        };
        let inputs = MinMax::fit(training.resistances_ohm.view())?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let examples = |set: &Dataset| {
            let scaled = inputs.scale(set.resistances_ohm.view());
            Examples::new(scaled.view(), outputs.scale(set.coordinates_mm.view()).view())
        };
        let problem = Problem {
            training: examples(&training),
            validation: validation.as_ref().map(examples),
            test: Some(examples(&test)),
        };
        // They are in `problem`, scaled: large sets need not be held twice.
        drop((training, validation));
        let shape = Shape {
            inputs: problem.training.inputs(),
            hidden: settings.hidden,
            outputs: problem.training.outputs(),
        };
        let start = nguyen_widrow(shape, &mut settings.seed.rng(Stream::Start));
        let trainer = Trainer::new(start, problem, settings.training)?;
        Ok(Self {
            settings,
            test: Arc::new(test),
            inputs,
            outputs,
            trainer,
            baselines,
        })
    }

    /// What was asked for.
    pub fn settings(&self) -> &RunSettings {
        &self.settings
    }

    /// The training in progress.
    pub fn trainer(&self) -> &Trainer {
        &self.trainer
    }

    /// The training in progress, to be stepped or stopped.
    pub fn trainer_mut(&mut self) -> &mut Trainer {
        &mut self.trainer
    }

    /// The test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
    }

    /// The baselines on the test set.
    pub fn baselines(&self) -> &Baselines {
        &self.baselines
    }

    /// The best network so far, ready to read resistances.
    pub fn network(&self) -> DecouplingNetwork {
        DecouplingNetwork::new(self.inputs.clone(), self.trainer.best().clone(), self.outputs.clone())
    }

    /// What the best network so far makes of the test set: coordinates in millimetres (samples × 3·M2) and their
    /// errors.
    pub fn decouple_test(&self) -> (Array2<f64>, Errors) {
        let decoupled_mm = self.network().decouple(self.test.resistances_ohm.view());
        let errors = Errors::measure(&self.test, &decoupled_mm, self.settings.stroke_mm());
        (decoupled_mm, errors)
    }
}
