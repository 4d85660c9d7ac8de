//! Files of the folder that a sweep fills: `TRIAL.json`, the result of a trial, and `sweep-PLAN.json`, the trials to be
//! trained. Both are named by a hash of the options of their trials and never change, so any number of programs may
//! write to one folder.

mod plan_file;
mod row;
mod trial_file;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};
use serde_json::value::to_raw_value;

use super::{AtomicFile, DocumentError, DocumentKind, WriteError, network_file::Sealed};
use crate::machine::system_cause;

pub use self::{
    plan_file::{PlanAxis, SweepPlan},
    row::SweepRow,
    trial_file::{Trial, TrialOptions},
};
pub use plan_file::{decoders_in_order, recording_options, sweep_specification, train_options};
pub use row::{MergedSweep, SweepFolderError, SweepTableFormat};
pub use trial_file::TrialId;

/// Trial and plan files of a folder.
#[derive(Debug, PartialEq, Eq)]
pub struct SweepFiles {
    pub(crate) trials: Vec<PathBuf>,
    pub(crate) plans: Vec<PathBuf>,
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
            plans: Vec::new(),
        };
        for entry in fs::read_dir(folder).map_err(error)? {
            let path = entry.map_err(error)?.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let Some(stem) = name.strip_suffix(".json") else {
                continue;
            };
            let is_plan = stem.strip_prefix(plan_file::PREFIX).is_some_and(TrialId::is_written);
            if TrialId::is_written(stem) {
                files.trials.push(path);
            } else if is_plan {
                files.plans.push(path);
            }
        }
        files.trials.sort_unstable();
        files.plans.sort_unstable();
        Ok(files)
    }
}

/// Writes a file of this kind unless it exists already; returns true if it was written.
fn save_new(kind: DocumentKind, program: &str, value: &impl Serialize, path: &Path) -> Result<bool, WriteError> {
    let value = to_raw_value(value).map_err(|error| WriteError::io(path, error.into()))?;
    match Sealed::new(kind, program, &value).save(path, AtomicFile::commit_new) {
        Err(error) if error.is_taken() => Ok(false),
        saved => saved.map(|()| true),
    }
}

/// Reads a file of this kind, with the program that wrote it.
fn load<T: DeserializeOwned>(kind: DocumentKind, path: &Path) -> Result<(String, T), DocumentError> {
    let bytes = kind.read(path)?;
    let read = Sealed::read(&bytes).and_then(|sealed| {
        let value = serde_json::from_str(sealed.run.get()).map_err(|error| error.to_string())?;
        Ok((sealed.program, value))
    });
    read.map_err(|defect| kind.damaged(path, defect))
}
