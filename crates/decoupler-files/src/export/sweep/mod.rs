//! Files of the folder that a sweep fills: `TRIAL.json`, the result of a trial, named by a hash of its options. It never
//! changes, so any number of programs may write to one folder. `TRIAL.claim` is locked by the program that trains the trial.

mod options;
mod row;
mod trial_file;

use std::{
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
};

use super::DocumentError;
use crate::machine::system_cause;

pub(super) use self::row::flatten;
pub use self::{
    options::{decoders_in_order, recording_options, sweep_specification, train_options},
    row::{MergedSweep, SweepFolderError, SweepRow, SweepTableFormat},
    trial_file::{Trial, TrialId, TrialOptions},
};

/// Files of the trials in a folder.
#[derive(Debug, PartialEq, Eq)]
pub struct SweepFiles {
    pub(crate) trials: Vec<PathBuf>,
    /// Claims on trials without a result.
    pub(crate) unfinished: Vec<PathBuf>,
}

impl SweepFiles {
    /// Lists the files of `folder`, in the order of their names.
    pub fn list(folder: &Path) -> Result<Self, DocumentError> {
        let error = |source: io::Error| DocumentError::Read {
            path: folder.to_owned(),
            source: io::Error::other(system_cause(&source)),
        };
        let mut files = Self {
            trials: Vec::new(),
            unfinished: Vec::new(),
        };
        for entry in fs::read_dir(folder).map_err(error)? {
            let path = entry.map_err(error)?.path();
            let name = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
            if !TrialId::is_written(name) {
                continue;
            }
            match path.extension().and_then(OsStr::to_str) {
                Some("json") => files.trials.push(path),
                // A program that was killed after its result leaves its claim next to it.
                Some("claim") if !path.with_extension("json").exists() => files.unfinished.push(path),
                _ => {}
            }
        }
        files.trials.sort_unstable();
        files.unfinished.sort_unstable();
        Ok(files)
    }
}
