use std::{
    path::PathBuf,
    sync::{Arc, mpsc::Sender},
};

use crate::{
    app::views::own_data::model::{Trained, Validated},
    evaluation::RunSettings,
    export::MeasuredCheckpointFile,
    import::{Plan, Progress},
    training::TrainingSettings,
};

/// Work for the thread.
#[derive(Debug)]
pub enum Task {
    /// Train a new network.
    Train(Box<Plan>, RunSettings),
    /// Go on from this checkpoint, of the file at this path, once that is asked for.
    Resume(PathBuf, Box<MeasuredCheckpointFile>),
    /// As [`Self::Resume`], from a checkpoint that was made in this window.
    TakeUp(Arc<MeasuredCheckpointFile>),
    /// Test on every sample by cross-validation.
    Validate(Box<Plan>, RunSettings, ValidationChoice),
}

/// Extent of a cross-validation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValidationChoice {
    /// Number of folds.
    pub folds: usize,
    /// True if random folds are tried too, which shows how much they flatter.
    pub compares_random: bool,
}

/// Wishes while it trains.
#[derive(Clone, Debug)]
pub enum Command {
    /// Hold the training.
    Pause,
    /// Go on with it.
    Resume,
    /// End it.
    Stop,
    /// Go on from the present weights with these settings.
    Continue(TrainingSettings),
    /// Hand over its checkpoint.
    Save(Sender<Result<MeasuredCheckpointFile, String>>),
}

/// News from the thread.
#[derive(Debug)]
pub enum TrainingEvent {
    /// Progress of reading a file.
    Reading(Progress),
    /// The training as it stands.
    Progressed(Box<Trained>),
    /// The result of a cross-validation.
    Validated(Box<Validated>),
    /// A wish cannot be granted.
    Refused(String),
    /// The thread has ended, and why unless it was to end.
    Ended(Result<(), String>),
}
