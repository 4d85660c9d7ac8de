use std::{path::PathBuf, sync::Arc};

use decoupler_core::{
    evaluation::{RunSettings, SimulatedSettings},
    training::TrainerState,
};
use decoupler_files::{
    export::NetworkFile,
    figure::Figure,
    import::{Plan, Setup},
};

use super::{FileTask, Look, SourceKind};

/// Request of a view to the window, which carries all of them out in one place once everything is drawn.
#[derive(Clone, Debug)]
pub enum Effect {
    /// Change the settings of the next training.
    Configure(Box<SimulatedSettings>),
    /// Change the settings of the next training on a recording.
    ConfigureRecording(Box<RunSettings>),
    /// Train on this plan of an import from now on, or say what it lacks.
    Import(Result<Arc<Plan>, String>),
    /// Train on a source of this kind from now on.
    ChooseSource(SourceKind),
    /// Show the setup of another run as that of the next training.
    TakeSetup(Box<Setup>),
    /// Show the view that trains.
    ShowTraining,
    /// Begin training.
    Train,
    /// Take up the training saved in this checkpoint.
    OpenTraining(PathBuf),
    /// Show the training that has these settings and whose starts stand so.
    TakeUp(Box<Setup>, Vec<TrainerState>),
    /// Hold the training.
    Pause,
    /// Go on with it.
    Resume,
    /// End it.
    Stop,
    /// Go on from the current weights with the method and the epochs of the settings.
    Continue,
    /// Look at all surfaces so.
    Look(Look),
    /// Show this snapshot of the results to come.
    Watch(usize),
    /// Ask for the path of a file.
    ChooseFile(FileTask),
    /// Ask for the path in the window itself.
    TypePath(FileTask),
    /// Put this text on the clipboard, and tell so.
    Copy {
        /// The text.
        text: String,
        /// Sentence that reports so.
        notice: String,
    },
    /// Put this picture on the clipboard, and tell so.
    CopyPicture {
        /// The picture.
        figure: Box<Figure>,
        /// Sentence that reports so.
        notice: String,
    },
    /// Keep the run of a network file that was opened.
    KeepRun(Box<NetworkFile>),
    /// Call the kept run with this number so.
    RenameRun(u64, String),
    /// Show the kept run with this number in one of the two places, or nothing.
    PinRun(usize, Option<u64>),
    /// Keep the run with this number no longer.
    RemoveRun(u64),
    /// Tell the user.
    Tell(Matter, Notice),
    /// Withdraw the failures said about this, which have been assigned with.
    Settle(Matter),
}

/// Something to tell the user, once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// It worked.
    Done(String),
    /// It did not, and what to do.
    Failed(String),
}

/// Subject of a notice. Work that succeeds takes the failures of the same subject along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matter {
    /// The current training, or one that was to be shown.
    Training,
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
    /// The view with the paper's tables and sweeps.
    Experiments,
    /// The view of what the readings determine.
    Identifiability,
    /// The view with what each way of decoding costs.
    TradeOff,
    /// Frames decoded as they come.
    Live,
    /// Files of the recording that is trained on.
    Recording,
    /// The file by which the next window opens as this one was left.
    Memory,
}
