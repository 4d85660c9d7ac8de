use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use ndarray::Array2;

use crate::{
    app::test_view::{TestView, TestViewError},
    evaluation::{Baselines, Errors, Run, RunFlaw, SimulatedSettings, StartRecord},
    export::NetworkFile,
    network::Networks,
    training::{EpochRecord, Stage, StopReason, TrainerState, TrainingSettings},
};

/// What the window asks of the worker.
#[derive(Debug)]
pub enum Request {
    /// Draw the test set of these settings, to be looked at before training. Only the newest one counts.
    Preview(Box<SimulatedSettings>),
    /// Measure what will stand beside the network of these settings. Only the newest one counts.
    Baselines(Box<SimulatedSettings>),
    /// Begin a training; one in progress is dropped.
    Train(Box<SimulatedSettings>),
    /// Take up the training saved in this file and hold it; one in progress is dropped.
    Open(PathBuf),
    /// Take up the training whose starts stand so, and hold it; one in progress is dropped.
    TakeUp(Box<SimulatedSettings>, Vec<TrainerState>),
    /// Go on from the present weights with this method and this many epochs more.
    Continue(TrainingSettings),
    /// Step no further until told to resume.
    Pause,
    /// Go on.
    Resume,
    /// End the training; its network stays.
    Stop,
    /// Write a file about this training, so long as no other has taken its place.
    Export(RunId, WriteRun, PathBuf),
}

/// What the worker tells the window.
#[derive(Debug)]
pub enum Event {
    /// The test set of these settings.
    Previewed(Box<SimulatedSettings>, Result<TestView, TestViewError>),
    /// What will stand beside the network of these settings; none where that takes long or is impossible, which a
    /// training would explain.
    Compared(Box<SimulatedSettings>, Option<Baselines>),
    /// A training has begun, or why it cannot.
    Began(Result<Box<Began>, TestViewError>),
    /// A saved training stands where it was saved, or why it cannot.
    Opened(Result<Box<Began>, String>),
    /// The training goes on with these settings, or why it cannot.
    Continued(Result<Box<SimulatedSettings>, String>),
    /// News of the training.
    Progressed(Box<Progress>),
    /// The training on show has ended: what is to be kept of it, or why nothing can be.
    Finished(Result<Box<NetworkFile>, String>),
    /// A file was written, or why not.
    Exported(Result<PathBuf, String>),
}

/// Writes a file about a training, or says why not.
pub type WriteRun = fn(&Run, &Path) -> Result<(), String>;

/// Tells trainings apart, also those of a worker that died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunId(u64);

impl RunId {
    /// That of no other training.
    pub(super) fn new() -> Self {
        static BEGUN: AtomicU64 = AtomicU64::new(0);
        Self(BEGUN.fetch_add(1, Ordering::Relaxed))
    }
}

/// What is known when a training begins.
#[derive(Debug)]
pub struct Began {
    /// Which it is.
    pub id: RunId,
    /// What was asked for.
    pub settings: SimulatedSettings,
    /// Weights and biases of the network.
    pub weights: usize,
    /// The test set.
    pub test: TestView,
    /// What stands beside the network.
    pub baselines: Baselines,
}

/// How a training stands.
#[derive(Debug)]
pub struct Progress {
    /// Epochs of the leader since the last report, or all where another start has taken the lead.
    pub epochs: Vec<EpochRecord>,
    /// The methods that the leader went through.
    pub stages: Vec<Stage>,
    /// How each start stands, where there are several; now and then only.
    pub starts: Option<Vec<StartRecord>>,
    /// What the training has come to.
    pub result: RunResult,
    /// Why the training has ended, if it has.
    pub stop_reason: Option<StopReason>,
}

/// What the best network so far makes of the test set, and what it cost.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Coordinates: samples × 3·M2.
    pub decoupled_mm: Arc<Array2<f64>>,
    /// Their errors.
    pub errors: Errors,
    /// The epoch of the network.
    pub best_epoch: usize,
    /// Defect of its training, once that has ended.
    pub flaw: Option<RunFlaw>,
    /// Epochs run by the start that is furthest.
    pub epochs_run: usize,
    /// How many starts have ended.
    pub starts_ended: usize,
    /// Time spent in training.
    pub elapsed: Duration,
    /// Time to decode one snapshot; measured when the training pauses or ends.
    pub frame_time: Option<Duration>,
    /// The networks; there when the training pauses or ends.
    pub networks: Option<Arc<Networks>>,
}
