use thiserror::Error;

use super::CountError;
use crate::{
    dataset::{DivisionError, FoldsError, SimulationError},
    decoupling::DecodeError,
    network::ScalingError,
    scene::SceneError,
    sensor::SensorError,
    training::{MachineMemory, ResumeError, TrainingError},
};

/// Error in preparing a run.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RunError {
    /// A number is out of range.
    #[error(transparent)]
    Count(#[from] CountError),
    /// More samples than a run can hold.
    #[error(
        "{training} training and {validation} validation samples, held together as whole snapshots of {rows} rows, are \
         {total}: the limit is {most}; give fewer for validation"
    )]
    TooManySamples {
        /// Training samples that are held.
        training: usize,
        /// Validation samples given.
        validation: usize,
        /// Row-wires of a snapshot.
        rows: usize,
        /// Samples of the whole snapshots.
        total: usize,
        /// Largest number possible.
        most: usize,
    },
    /// The sensor is invalid.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Samples cannot be drawn.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Folds cannot be filled.
    #[error(transparent)]
    Folds(#[from] FoldsError),
    /// Samples cannot be divided.
    #[error(transparent)]
    Division(#[from] DivisionError),
    /// Samples cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] ScalingError),
    /// A reading is not a resistance.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The sets do not belong together.
    #[error("the {set} set has {found}, the training set {expected}: give sets of one sensor")]
    Sets {
        /// Name of the set: validation or test.
        set: &'static str,
        /// Channels, targets or row-wires of the set.
        found: String,
        /// Channels, targets or row-wires of the training set.
        expected: String,
    },
    /// The samples are not such as the networks decode.
    #[error(
        "the {set} set has {found}, the networks have {expected}: give samples of the sensor they were trained for"
    )]
    Networks {
        /// Name of the set: training or validation.
        set: &'static str,
        /// Channels, targets or row-wires of the set.
        found: String,
        /// Their number in the networks.
        expected: usize,
    },
    /// A row-wire that needs its own network has no samples.
    #[error("row {} has no {set} samples: give some of every row, or train one network for all rows", .row_wire + 1)]
    RowWithoutSamples {
        /// Row-wire, from 0.
        row_wire: usize,
        /// Name of the set: training, validation or test.
        set: &'static str,
    },
    /// The samples of a simulated run have no row-wires.
    #[error(
        "samples of a simulated sensor must know their row-wire: build the set with row-wires, or call it measured"
    )]
    NoRowWires,
    /// A training cannot begin.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The run would take more memory than the machine has.
    #[error(
        "this would take about {:.1} GB of memory, and {memory}: use fewer samples, hidden nodes or starts, or the scaled \
         conjugate gradient (scg)",
        *.bytes as f64 * 1e-9
    )]
    Memory {
        /// Memory needed, in bytes.
        bytes: u64,
        /// Memory that there is.
        memory: MachineMemory,
    },
    /// A saved training cannot be resumed.
    #[error("start {}: {source}", .start + 1)]
    Resume {
        /// Index of the start, from 0.
        start: usize,
        /// Reason given by the trainer.
        source: ResumeError,
    },
    /// The number of saved trainings does not match the settings.
    #[error("{found} saved trainings, but the settings ask for {expected}: starts times networks")]
    Starts {
        /// Number of trainings found.
        found: usize,
        /// Number of trainings expected.
        expected: usize,
    },
}
