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
