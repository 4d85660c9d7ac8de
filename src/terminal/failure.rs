use std::{
    error::Error as StdError,
    fmt::Display,
    fs,
    io::{self, ErrorKind},
    path::{Path, PathBuf},
};

use decoupler_core::{
    calibration::CalibrationError, dataset::DatasetError, evaluation::RunError, sensor::SensorError,
    training::SettingError,
};
use decoupler_files::{
    export::{DocumentError, SweepFolderError, WriteError, bundle::BundleError, figures::PictureError},
    import::{Cure, ImportError, SetupError},
    live::SessionError,
    machine::system_cause,
};
use thiserror::Error;

use super::interruption;

/// Reason why a command failed.
#[derive(Debug, Error)]
pub(crate) enum Failure {
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
    /// In this file.
    #[error("'{}': {}", .0.display(), .1)]
    At(PathBuf, String),
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    #[error("{}", .0.with_cure(in_arguments))]
    Import(#[from] ImportError),
    #[error(transparent)]
    Setup(SetupError),
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
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("{}", joined(.0))]
    Files(Vec<PictureError>),
    #[error("cannot write to standard output: {}", system_cause(.0))]
    Output(io::Error),
    /// What cannot be done with a path, and the cause.
    #[error("cannot {} '{}': {}", .0, .1.display(), system_cause(.2))]
    Path(&'static str, PathBuf, io::Error),
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

/// The cure of an import error in terms of arguments, of which some are only for recipes.
fn in_arguments(cure: &Cure) -> String {
    let cure = match cure {
        Cure::CallMissing(text) => &format!("correct it, or declare it as missing with --missing \"{text}\""),
        Cure::NameTimes => "name their times with --time and --join-time, or leave out the last rows with --truncate",
        Cure::NameJoinedTime => "name it with --join-time",
        Cure::GiveLimit => "give the limit with --join-limit",
        Cure::GiveJoinedFiles => "give as many --test-join as --join",
        other => return other.to_string(),
    };
    format!("{cure} in a recipe (decoupler inspect --recipe-out)")
}

impl Failure {
    pub(super) fn at(path: &Path, message: impl Display) -> Self {
        Self::At(path.to_owned(), message.to_string())
    }

    pub(super) fn make_folder(path: &Path) -> Result<(), Self> {
        fs::create_dir_all(path).map_err(|error| Self::Path("create the folder", path.to_owned(), error))
    }

    /// Exit status of the program.
    pub(super) fn status(&self) -> u8 {
        match self {
            Self::Arguments(_) | Self::Bundle(BundleError::Choice(_)) | Self::Import(ImportError::Columns(_)) => 2,
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
            Self::Output(error) | Self::Write(WriteError { source: error, .. }) => {
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
