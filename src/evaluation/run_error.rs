use thiserror::Error;

use super::CountError;
use crate::{
    dataset::{FoldsError, SimulationError},
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
    Simulation(#[from] SimulationError),
    /// Folds that cannot be filled.
    #[error(transparent)]
    Folds(#[from] FoldsError),
    /// Samples that cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] ScalingError),
    /// A reading that is no resistance.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// Sets that do not belong together.
    #[error("the {set} set has {found}, the training set {expected}: give sets of one sensor")]
    Sets {
        /// Validation or test.
        set: &'static str,
        /// Its channels, targets or row-wires.
        found: String,
        /// Those of the training set.
        expected: String,
    },
    /// A row-wire is to have a network of its own, and there is nothing to fit it to.
    #[error("row {} has no {set} samples: give some of every row, or train one network for all rows", .row_wire + 1)]
    RowWithoutSamples {
        /// The row-wire, from 0.
        row_wire: usize,
        /// Training, validation or test.
        set: &'static str,
    },
    /// A simulated run on samples that do not know their row-wire.
    #[error(
        "samples of a simulated sensor must know their row-wire: build the set with row-wires, or call it measured"
    )]
    NoRowWires,
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
