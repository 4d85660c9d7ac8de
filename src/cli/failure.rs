use std::{
    error::Error as StdError,
    io::{self, ErrorKind},
    path::PathBuf,
};

use thiserror::Error;

use crate::{
    dataset::{DatasetError, ReadError},
    evaluation::RunError,
    export::{NetworkFileError, WriteError},
    training::SettingError,
};

/// Why a command did not do its work.
#[derive(Debug, Error)]
pub(super) enum Failure {
    #[error("{0}")]
    Arguments(String),
    #[error("this build has no window; use decoupler train, decode or simulate, or --help")]
    NoWindow,
    #[error("{0}")]
    Window(Box<dyn StdError>),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error(transparent)]
    Network(#[from] NetworkFileError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("cannot write to standard output: {0}")]
    Output(io::Error),
    #[error("cannot open '{}': {source}", .path.display())]
    Open { path: PathBuf, source: io::Error },
    #[error("'{}': {source}", .path.display())]
    Resistances { path: PathBuf, source: ReadError },
    #[error("'{}': line {line}: resistances so far from the training range that the network has no answer", .path.display())]
    NoAnswer { path: PathBuf, line: u64 },
}

impl From<SettingError> for Failure {
    fn from(error: SettingError) -> Self {
        Self::Arguments(error.to_string())
    }
}

impl Failure {
    /// The exit status that says so.
    pub(super) fn status(&self) -> u8 {
        match self {
            Self::Arguments(_) => 2,
            _ => 1,
        }
    }

    /// Whether only the reader of our output went away, which is its right.
    pub(super) fn is_broken_pipe(&self) -> bool {
        match self {
            Self::Output(error) | Self::Write(WriteError::Io { source: error, .. }) => {
                error.kind() == ErrorKind::BrokenPipe
            }
            _ => false,
        }
    }
}
