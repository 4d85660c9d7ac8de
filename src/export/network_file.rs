use std::{
    io,
    path::{Path, PathBuf},
};

use serde_json::value::to_raw_value;
use thiserror::Error;

use super::{
    AtomicFile, WriteError,
    heading::{Heading, NoHeading},
    limited::read_limited,
    network_document::{RunDocument, UnsealedDocument},
    sealed::{Commit, Sealed},
    soundness::flaw,
};
use crate::{
    dataset::system_cause,
    evaluation::{Baselines, Errors, Run, SimulatedSettings, StartRecord},
    network::Networks,
    training::{EpochRecord, Stage, StopReason},
};

const FORMAT: &str = "decoupler network";
const VERSION: u64 = 3;
/// First version with a checksum, and with the ranges of the readings in training.
const SEALED_VERSION: u64 = 3;
/// Oldest version that can be read, which had one network and the paper's scene only.
const OLDEST_VERSION: u64 = 1;
pub(super) const PROGRAM: &str = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));

/// A trained network with its settings, the record of its training, and its errors.
/// The file is JSON; a network that is read back gives bit-identical results.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Version of the format in which the file was found, or will be written.
    pub version: u64,
    /// Settings of the run: sensor, scene, samples, method, stopping rules, seed.
    pub settings: SimulatedSettings,
    /// Best network of the training, or best network of each row-wire.
    pub network: Networks,
    /// Record of the training.
    pub training: TrainingRecord,
    /// Errors of the network on the test set.
    pub errors: Errors,
    /// Errors of the baselines on the same test set.
    pub baselines: Baselines,
}

/// Record of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingRecord {
    /// Reason for which training ended; `None` while it runs.
    pub stop_reason: Option<StopReason>,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Training time on one thread in seconds, summed over the networks of all rows.
    pub seconds: f64,
    /// Record of every epoch, from the initial weights on.
    pub history: Vec<EpochRecord>,
    /// Training methods in the order in which they were used.
    pub stages: Vec<Stage>,
    /// All starts of the run, of which the best gave the network. Empty in files of versions that had one start
    /// only.
    pub starts: Vec<StartRecord>,
}

/// Errors of reading or writing a network file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NetworkFileError {
    /// The operating system refuses to read it.
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Not JSON.
    #[error("'{}' is not a network file: {reason}; choose one that Decoupler saved", .path.display())]
    NotJson {
        /// The file.
        path: PathBuf,
        /// The parser's message, with line and column.
        reason: String,
    },
    /// JSON that ends too early.
    #[error("'{}' is cut off at line {line}, column {column}; copy or save it again", .path.display())]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Line of the end, counted from 1.
        line: usize,
        /// Column of the end, counted from 1.
        column: usize,
    },
    /// JSON of another program.
    #[error("'{}' is not a network file: it has no field \"format\": \"{FORMAT}\"; choose one that Decoupler saved", .path.display())]
    NotOurs {
        /// The file.
        path: PathBuf,
    },
    /// Written in a format unknown to this version.
    #[error("'{}' has version {version} of the format, written by {program}; this is {PROGRAM}, which reads versions {OLDEST_VERSION} to {VERSION}: install a newer one", .path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the file.
        version: String,
        /// Program that wrote the file.
        program: String,
    },
    /// A field that is missing, of the wrong kind, or does not fit the others.
    #[error("'{}' is damaged: {flaw}; copy or save it again", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Description of the defect, with the field or with line and column.
        flaw: String,
    },
    /// A network of measured samples: the file tells of a simulated sensor.
    #[error("a network of measured samples has no network file; write the networks themselves instead")]
    Measured,
    /// The network has values that could not be read back.
    #[error("'{}' is not saved: {flaw}; train again with other settings", .path.display())]
    Unsound {
        /// The file.
        path: PathBuf,
        /// Description of the defect, with the field.
        flaw: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl NetworkFile {
    /// Takes the best network of `run` so far, with its record and errors.
    ///
    /// # Errors
    /// [`NetworkFileError::Measured`] if the samples were measured.
    pub fn from_run(run: &Run) -> Result<Self, NetworkFileError> {
        let simulated = run.settings().simulated().zip(run.node_scores());
        let (settings, scores) = simulated.ok_or(NetworkFileError::Measured)?;
        let trainer = run.leader();
        Ok(Self {
            program: PROGRAM.to_owned(),
            version: VERSION,
            settings,
            network: run.network(),
            training: TrainingRecord {
                stop_reason: run.stop_reason(),
                best_epoch: trainer.best_epoch(),
                seconds: trainer.elapsed().as_secs_f64(),
                history: trainer.history().to_vec(),
                stages: trainer.stages().to_vec(),
                starts: run.starts(),
            },
            errors: scores.network,
            baselines: scores.baselines,
        })
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The network has values that could not be read back, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), NetworkFileError> {
        self.save_by(path, AtomicFile::commit)
    }

    /// As [`Self::save`]; `commit` puts the file in its place.
    pub(super) fn save_by(&self, path: &Path, commit: Commit) -> Result<(), NetworkFileError> {
        let unsound = |flaw: String| NetworkFileError::Unsound {
            path: path.to_owned(),
            flaw,
        };
        if let Some(flaw) = flaw(self) {
            return Err(unsound(flaw));
        }
        let run = to_raw_value(&RunDocument::of(self)).map_err(|error| unsound(error.to_string()))?;
        Ok(Sealed::new(FORMAT, VERSION, &self.program, &run).save(path, commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, NetworkFileError> {
        let bytes = read_limited(path).map_err(|source| NetworkFileError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &bytes)
    }

    /// Describes the first defect that would keep the file from being read back.
    pub fn flaw(&self) -> Option<String> {
        flaw(self)
    }

    /// Tells what cannot be noticed because an old version of the program wrote the file.
    pub fn old_version_warning(&self) -> Option<String> {
        (self.version < SEALED_VERSION).then(|| {
            format!(
                "the file has version {} of the format, without a checksum and without the range of the readings in \
                 training: neither damage nor readings outside that range are noticed; train again to have both",
                self.version
            )
        })
    }

    pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Self, NetworkFileError> {
        let path = || path.to_owned();
        let heading = Heading::read(bytes).map_err(|no_heading| match no_heading {
            NoHeading::NotJson(reason) => NetworkFileError::NotJson { path: path(), reason },
            NoHeading::CutOff { line, column } => NetworkFileError::CutOff {
                path: path(),
                line,
                column,
            },
            NoHeading::Other => NetworkFileError::NotOurs { path: path() },
        })?;
        if heading.format != FORMAT {
            return Err(NetworkFileError::NotOurs { path: path() });
        }
        if let Some(version) = heading.newer_than(VERSION) {
            return Err(NetworkFileError::Version {
                path: path(),
                version,
                program: heading.program(),
            });
        }
        let damaged = |flaw| NetworkFileError::Damaged { path: path(), flaw };
        let is_sealed = heading.version.as_u64() >= Some(SEALED_VERSION);
        let read = if is_sealed {
            Self::read_sealed(bytes)
        } else {
            Self::read_unsealed(bytes)
        };
        let file = read.map_err(damaged)?;
        match flaw(&file) {
            Some(flaw) => Err(damaged(flaw)),
            None => Ok(file),
        }
    }

    fn read_sealed(bytes: &[u8]) -> Result<Self, String> {
        let Sealed {
            version, program, run, ..
        } = Sealed::read(bytes)?;
        let run: RunDocument = serde_json::from_str(run.get()).map_err(|error| error.to_string())?;
        run.into_file(program, version)
    }

    fn read_unsealed(bytes: &[u8]) -> Result<Self, String> {
        let document: UnsealedDocument = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if document.version < OLDEST_VERSION {
            return Err(format!("version: there is no version {}", document.version));
        }
        let (program, version) = (document.program.clone(), document.version);
        RunDocument::from(document).into_file(program, version)
    }
}
