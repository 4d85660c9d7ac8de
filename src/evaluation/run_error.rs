use thiserror::Error;

use super::CountError;
use crate::{
    dataset::{DatasetError, FoldsError},
    decoupling::DecodeError,
    network::ScalingError,
    scene::SceneError,
    sensor::SensorError,
    training::{ResumeError, TrainingError},
};

/// Why a run cannot be prepared.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
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
    /// Folds that cannot be filled.
    #[error(transparent)]
    Folds(#[from] FoldsError),
    /// Samples that cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] ScalingError),
    /// A reading that is no resistance.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A training that cannot begin.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The method's equations of all starts would take too much memory.
    #[error(
        "{starts} starts of this network would take {:.1} GB with this method: use fewer starts, fewer hidden nodes, \
         or the scaled conjugate gradient (scg)",
        *.bytes as f64 * 1e-9
    )]
    TooManyStarts {
        /// How many were asked for.
        starts: usize,
        /// How many bytes they would take.
        bytes: usize,
    },
    /// A saved training that cannot be resumed.
    #[error("start {}: {source}", .start + 1)]
    Resume {
        /// Which start, from 0.
        start: usize,
        /// What is wrong with it.
        source: ResumeError,
    },
    /// Not as many saved trainings as the settings ask for.
    #[error("{found} saved trainings, but the settings ask for {expected}: starts times networks")]
    Starts {
        /// Trainings found.
        found: usize,
        /// Trainings asked for.
        expected: usize,
    },
}
