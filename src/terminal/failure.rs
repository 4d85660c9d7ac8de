use std::{
    error::Error as StdError,
    io::{self, ErrorKind},
    path::PathBuf,
};

use decoupler_core::{
    calibration::CalibrationError, dataset::DatasetError, evaluation::RunError, sensor::SensorError,
    training::SettingError,
};
use decoupler_files::{
    export::{DocumentError, SweepFolderError, WriteError, bundle::BundleError, figures::PictureError},
    import::{Cure, ImportError, ReadError, SetupError},
    live::SessionError,
    machine::system_cause,
};
use thiserror::Error;

use super::interruption;

/// Reason why a command failed.
#[derive(Debug, Error)]
pub(super) enum Failure {
    #[error("{0}")]
    Arguments(String),
    #[error("{0}")]
    Window(Box<dyn StdError>),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error(transparent)]
    Bundle(#[from] BundleError),
    #[error("'{}': {source}", .path.display())]
    Resume { path: PathBuf, source: RunError },
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    #[error("'{}': line {line}: {source} (--where)", .path.display())]
    Press {
        path: PathBuf,
        line: u64,
        source: CalibrationError,
    },
    #[error("{}", .0.with_cure(in_arguments))]
    Import(#[from] ImportError),
    #[error(transparent)]
    Setup(SetupError),
    #[error("'{}': its recording '{}' is missing; give its new path with --data FILE", .checkpoint.display(), .recording.display())]
    MissingRecording { checkpoint: PathBuf, recording: PathBuf },
    #[error("'{}' is the network of a recording: {reason}", .path.display())]
    NoArray { path: PathBuf, reason: &'static str },
    /// By Ctrl-C, SIGTERM or SIGHUP.
    #[error("interrupted{0}")]
    Interrupted(String),
    #[error("{place}: {cause}; only earlier results are printed")]
    TradeOff { place: String, cause: Box<Failure> },
    #[error("{failed} of {trials} trials failed, for the reasons above; the others are kept")]
    FailedTrials { failed: usize, trials: usize },
    #[error(transparent)]
    SweepFolder(#[from] SweepFolderError),
    #[error("'{}' lacks trials: {missing} missing, {conflicting} conflicting, {unreadable} files unreadable; run the sweep again for missing ones, and delete the wrong file of those that conflict", .out.display())]
    IncompleteSweep {
        missing: usize,
        conflicting: usize,
        unreadable: usize,
        out: PathBuf,
    },
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error(transparent)]
    Sensor(SensorError),
    #[error("cannot create the folder '{}': {}", .path.display(), system_cause(.source))]
    MakeFolder { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("{}", joined(.0))]
    Files(Vec<PictureError>),
    #[error("cannot write to standard output: {}", system_cause(.0))]
    Output(io::Error),
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read { path: PathBuf, source: io::Error },
    #[error("cannot open '{}': {}", .path.display(), system_cause(.source))]
    Open { path: PathBuf, source: io::Error },
    #[error("'{}': {source}", .path.display())]
    Resistances { path: PathBuf, source: ReadError },
    #[error("'{}': line {line}: there is no network for row {row}; train with samples of it", .path.display())]
    UnknownRow { path: PathBuf, line: u64, row: usize },
    #[error("'{}': it has no column '{column}' with the row number of each line, which is needed because each row has its own network; add it", .path.display())]
    NoRowWires { path: PathBuf, column: String },
    #[error("'{}': {lines} lines are not a multiple of {rows} rows: each snapshot needs one line per row-wire; add the missing lines, or a column named row with the row number of each line", .path.display())]
    PartOfSnapshot { path: PathBuf, lines: usize, rows: usize },
    #[error("'{}': line {line}: the resistances are so far outside the training range that the network's output is not a finite number; check them", .path.display())]
    NoAnswer { path: PathBuf, line: u64 },
}

fn joined(errors: &[PictureError]) -> String {
    let messages: Vec<_> = errors.iter().map(ToString::to_string).collect();
    messages.join("; ")
}

impl From<SettingError> for Failure {
    fn from(error: SettingError) -> Self {
        Self::Arguments(error.to_string())
    }
}

impl From<SetupError> for Failure {
    fn from(error: SetupError) -> Self {
        match error {
            SetupError::Import(error) => error.into(),
            SetupError::Run(error) => error.into(),
            error => Self::Setup(error),
        }
    }
}

/// The cure of an import error in terms of arguments.
fn in_arguments(cure: &Cure) -> String {
    match cure {
        Cure::CallMissing(text) => format!("correct it, or declare it as missing with --missing \"{text}\""),
        Cure::NameTimes => "name the columns of their times with --time and --join-time".to_owned(),
        Cure::NameJoinedTime => "name it with --join-time".to_owned(),
        Cure::GiveLimit => "give the limit with --join-limit".to_owned(),
        Cure::GiveJoinedFiles => "give as many --test-join as --join".to_owned(),
        other => other.to_string(),
    }
}

impl Failure {
    /// Exit status of the program.
    pub(super) fn status(&self) -> u8 {
        match self {
            Self::Arguments(_) | Self::Bundle(BundleError::Choice(_)) => 2,
            Self::Import(
                ImportError::Unknown { .. }
                | ImportError::Ambiguous { .. }
                | ImportError::Range(_)
                | ImportError::TwoMeanings { .. }
                | ImportError::NoColumns(_)
                | ImportError::Condition { .. },
            ) => 2,
            // A division or a memory that does not fit the samples is an argument; their shape is not.
            Self::Import(ImportError::Dataset(
                DatasetError::Empty { .. } | DatasetError::Length { .. } | DatasetError::RowWire { .. },
            )) => 1,
            Self::Import(ImportError::Dataset(_)) => 2,
            Self::Run(error) if is_argument_error(error) => 2,
            Self::Dataset(DatasetError::Count(_) | DatasetError::Scene(_)) => 2,
            Self::Interrupted(_) => interruption::status(),
            _ => 1,
        }
    }

    /// Returns `true` if the reader of the output has closed it, which is not a failure.
    pub(super) fn is_broken_pipe(&self) -> bool {
        match self {
            Self::Output(error) | Self::Write(WriteError::Io { source: error, .. }) => {
                error.kind() == ErrorKind::BrokenPipe
            }
            _ => false,
        }
    }
}

/// Returns `true` for arguments that are valid individually but not together.
fn is_argument_error(error: &RunError) -> bool {
    matches!(
        error,
        RunError::Count { .. }
            | RunError::TooManySamples { .. }
            | RunError::Scene(_)
            | RunError::Training(_)
            | RunError::Memory { .. }
            | RunError::Division(_)
    ) && !matches!(error, RunError::Division(DatasetError::Sensor { .. }))
}
