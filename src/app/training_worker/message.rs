use std::{
    path::PathBuf,
    sync::{Arc, mpsc::Sender},
    time::Duration,
};

use ndarray::Array2;

use super::export_kind::ExportKind;
use crate::{
    app::{
        job::JobError,
        test_view::{TestView, TestViewError},
    },
    evaluation::{Baselines, Errors, RunFlaw, SimulatedSettings, StartRecord},
    export::NetworkFile,
    network::Networks,
    training::{EpochRecord, Stage, StopReason, TrainerState, TrainingSettings},
};

/// What the window asks of the worker.
#[derive(Debug)]
pub enum Request {
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
    /// Hand over the best networks so far; the answer bears this number.
    Networks(u64),
    /// Write a file about the present training, and tell here how that went.
    Export(ExportKind, PathBuf, Sender<Result<(), String>>),
}

/// What the worker tells the window.
#[derive(Debug)]
pub enum Event {
    /// A training has begun, or why it cannot.
    Began(Result<Box<Began>, TestViewError>),
    /// A saved training stands where it was saved, or why it cannot.
    Opened(Result<Box<Began>, String>),
    /// A training that was cancelled while it was prepared has not begun.
    Abandoned,
    /// The training goes on with these settings, or why it cannot.
    Continued(Result<Box<SimulatedSettings>, String>),
    /// News of the training.
    Progressed(Box<Progress>),
    /// The training on show has ended: what is to be kept of it, or why nothing can be.
    Finished(Result<Box<NetworkFile>, String>),
    /// The best networks so far, or why there are none; with the number of the request.
    Networks(u64, Result<Box<Networks>, String>),
    /// The thread has ended, and why, unless it was to end.
    Died(Option<JobError>),
}

/// What is known when a training begins.
#[derive(Debug)]
pub struct Began {
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

impl Progress {
    /// Takes the place of an older one that nobody saw: its epochs, and how its starts stood, are not lost.
    pub fn replace(&mut self, older: Self) {
        let mut epochs = older.epochs;
        if let Some(first) = self.epochs.first() {
            epochs.retain(|record| record.epoch < first.epoch);
        }
        epochs.append(&mut self.epochs);
        self.epochs = epochs;
        self.starts = self.starts.take().or(older.starts);
    }
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
}
