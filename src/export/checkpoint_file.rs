use std::{
    io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;
use thiserror::Error;

use super::{
    AtomicFile, WriteError,
    heading::{Heading, NoHeading},
    limited::read_limited,
    network_file::PROGRAM,
    sealed::Sealed,
    soundness::settings_flaw,
};
use crate::{
    dataset::system_cause,
    evaluation::{Run, RunError, SimulatedSettings},
    training::TrainerState,
};

const FORMAT: &str = "decoupler checkpoint";
const VERSION: u64 = 2;
/// Oldest version that can be read, which had the paper's scene only.
const OLDEST_VERSION: u64 = 1;
/// First bytes of every checkpoint, also of a damaged one.
const BEGINNING: &[u8] = br#"{"format":"decoupler checkpoint","#;

/// A run saved at some epoch. A resumed run gives bit-identical results.
///
/// The file is JSON. It does not contain the samples, which follow from the settings. A checksum (CRC-32) detects
/// changes.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run, with the method and stopping rules of that epoch.
    pub settings: SimulatedSettings,
    /// State of every trainer: by start, then, if rows are known, by row.
    pub starts: Vec<TrainerState>,
}

/// Errors of reading or writing a checkpoint.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointFileError {
    /// The operating system refuses to read it.
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The file is not a checkpoint.
    #[error("'{}' is not a checkpoint: {reason}; choose one that train --checkpoint or the window saved", .path.display())]
    NotOurs {
        /// The file.
        path: PathBuf,
        /// Description of the file as found.
        reason: String,
    },
    /// The file ends too early.
    #[error("'{}' is cut off at line {line}, column {column}; copy it again, or begin anew", .path.display())]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Line of the end, counted from 1.
        line: usize,
        /// Column of the end, counted from 1.
        column: usize,
    },
    /// Written in a format unknown to this version.
    #[error("'{}' has version {version} of the checkpoint format, written by {program}; this is {PROGRAM}, which reads versions {OLDEST_VERSION} to {VERSION}: install a newer one", .path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the file.
        version: String,
        /// Program that wrote the file.
        program: String,
    },
    /// The checksum does not match, or a value is impossible.
    #[error("'{}' is damaged: {flaw}; copy it again, or begin anew", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Description of the defect.
        flaw: String,
    },
    /// A run on measured samples, which cannot be drawn again.
    #[error("a training on measured samples has no checkpoint file; keep its states and resume it on the same sets")]
    Measured,
    /// The run has values that could not be read back.
    #[error("'{}' is not saved: the training has numbers that no file can hold ({flaw})", .path.display())]
    Unsound {
        /// The file.
        path: PathBuf,
        /// Description of the defect.
        flaw: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunDocument {
    settings: SimulatedSettings,
    starts: Vec<TrainerState>,
}

impl CheckpointFile {
    /// Takes the present state of `run`.
    ///
    /// # Errors
    /// [`CheckpointFileError::Measured`] if the samples were measured.
    pub fn from_run(run: &Run) -> Result<Self, CheckpointFileError> {
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: run.settings().simulated().ok_or(CheckpointFileError::Measured)?,
            starts: run.states(),
        })
    }

    /// Resumes the run from this epoch: draws its samples again and restores every trainer.
    ///
    /// # Errors
    /// The settings are impossible, or the states do not fit them or each other.
    pub fn resume(self) -> Result<Run, RunError> {
        Run::resume(self.settings, self.starts)
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The run has numbers that JSON cannot hold, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointFileError> {
        let unsound = |error: serde_json::Error| CheckpointFileError::Unsound {
            path: path.to_owned(),
            flaw: error.to_string(),
        };
        let run = to_raw_value(&RunDocument {
            settings: self.settings,
            starts: self.starts.clone(),
        });
        let run = run.map_err(unsound)?;
        // What was written must be readable: a weight that is not finite would be `null`.
        serde_json::from_str::<RunDocument>(run.get()).map_err(unsound)?;
        let sealed = Sealed::new(FORMAT, VERSION, &self.program, &run);
        Ok(sealed.save(path, AtomicFile::commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, CheckpointFileError> {
        let bytes = read_limited(path).map_err(|source| CheckpointFileError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &bytes)
    }

    fn parse(path: &Path, bytes: &[u8]) -> Result<Self, CheckpointFileError> {
        let path = || path.to_owned();
        let damaged = |flaw| CheckpointFileError::Damaged { path: path(), flaw };
        let not_ours = |reason| CheckpointFileError::NotOurs { path: path(), reason };
        let heading = Heading::read(bytes).map_err(|no_heading| match no_heading {
            NoHeading::CutOff { line, column } => CheckpointFileError::CutOff {
                path: path(),
                line,
                column,
            },
            NoHeading::NotJson(flaw) if bytes.starts_with(BEGINNING) => damaged(flaw),
            NoHeading::NotJson(reason) => not_ours(reason),
            NoHeading::Other => not_ours(format!("it has no field \"format\": \"{FORMAT}\"")),
        })?;
        if heading.format != FORMAT {
            return Err(not_ours(format!("its format is {}", heading.format)));
        }
        if let Some(version) = heading.newer_than(VERSION) {
            return Err(CheckpointFileError::Version {
                path: path(),
                version,
                program: heading.program(),
            });
        }
        let sealed = Sealed::read(bytes).map_err(damaged)?;
        if sealed.version < OLDEST_VERSION {
            return Err(damaged(format!("there is no version {}", sealed.version)));
        }
        let run: RunDocument = serde_json::from_str(sealed.run.get()).map_err(|error| damaged(error.to_string()))?;
        if let Some(flaw) = settings_flaw(&run.settings) {
            return Err(damaged(flaw));
        }
        Ok(Self {
            program: sealed.program,
            settings: run.settings,
            starts: run.starts,
        })
    }
}
