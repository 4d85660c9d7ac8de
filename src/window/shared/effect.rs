use std::{path::PathBuf, sync::Arc};

use decoupler_core::{evaluation::RunSettings, training::TrainerState};
use decoupler_files::import::{Plan, Setup};

use super::{Command, Exporting, FileTask, Look, RunsRequest, SourceKind, ToCopy};

/// Request of a view to the window, which applies all of them in one place once everything is drawn.
#[derive(Clone, Debug)]
pub enum Effect {
    /// Change the settings of the next training on their source.
    Configure(Box<RunSettings>),
    /// Choose the settings of a training on a recording automatically, or not.
    ChooseAutomatically(bool),
    /// Use this plan of an import for the next training, or show what it lacks.
    Import(Result<Arc<Plan>, String>),
    /// Select the kind of source to train on.
    ChooseSource(SourceKind),
    /// Use the setup of another run for the next training.
    TakeSetup(Box<Setup>),
    /// Carry out this command.
    Do(Command),
    /// Show the run of the list with this number in the Train view, with its settings.
    OpenRun(u64),
    /// Open the training saved in this checkpoint.
    OpenTraining(PathBuf),
    /// Show the training with this setup and these states of its starts.
    TakeUp(Box<Setup>, Vec<TrainerState>),
    /// Answer with ridge regression in place of the network of the ended training.
    UseRidge,
    /// Set the look of all surfaces.
    Look(Look),
    /// Ask for the path of a file.
    ChooseFile(FileTask),
    /// Let the user choose the form of an export.
    Export(Box<Exporting>),
    /// Put this on the clipboard; then the text tells the user.
    Copy(ToCopy, String),
    /// Change the run list.
    ChangeRuns(RunsRequest),
    /// Show a notice to the user.
    Notify(Matter, Notice),
    /// Withdraw the failures of this subject, which have been resolved.
    Settle(Matter),
}

/// Notice to the user, shown once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// Success.
    Done(String),
    /// A file was written at this path.
    Saved(String, PathBuf),
    /// Failure, with what to do.
    Failed(String),
}

/// Subject of a notice. A success also withdraws the failures of the same subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matter {
    /// The current training, or one that was to be shown.
    Training,
    /// A training that was cut short when the program ended.
    CutShort,
    /// Settings with which no training can begin.
    Settings,
    /// The test set of the settings.
    Preview,
    /// A file that the user has saved.
    File,
    /// Text on the clipboard.
    Clipboard,
    /// The run list.
    RunList,
    /// The Study view.
    Study,
    /// The Live view.
    Live,
    /// Files of the recording that is trained on.
    Recording,
    /// The file of the state restored at the next start.
    Memory,
}
