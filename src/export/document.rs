use std::{
    fmt, fs,
    io::{self, Read as _},
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::{
    WriteError,
    heading::{Heading, NoHeading},
    limited::read_limited,
};
use crate::dataset::system_cause;

pub(super) const PROGRAM: &str = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));

/// Kinds of JSON files that the program writes and reads again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DocumentKind {
    /// A trained network with its record: [`super::NetworkFile`].
    Network,
    /// A training to be resumed: [`super::CheckpointFile`].
    Checkpoint,
    /// A network trained on measured samples: [`super::MeasuredNetworkFile`].
    MeasuredNetwork,
    /// A training on measured samples to be resumed: [`super::MeasuredCheckpointFile`].
    MeasuredCheckpoint,
    /// A recipe by which measured samples are made of files: [`super::RecipeFile`].
    Recipe,
    /// A sensor model: [`super::SensorFile`].
    Sensor,
    /// A name or choice of the run list: [`super::RunFolder`].
    RunList,
    /// A finished trial of `decoupler sweep`.
    Trial,
    /// The trials of a specification of `decoupler sweep`.
    SweepPlan,
}

impl DocumentKind {
    /// Every kind.
    const ALL: [Self; 9] = [
        Self::Network,
        Self::Checkpoint,
        Self::MeasuredNetwork,
        Self::MeasuredCheckpoint,
        Self::Recipe,
        Self::Sensor,
        Self::RunList,
        Self::Trial,
        Self::SweepPlan,
    ];

    /// Kind of the file at `path` by its beginning; `None` if it is none of them, or cannot be read.
    pub fn of_file(path: &Path) -> Option<Self> {
        /// Number of bytes in which the format is named, however a recipe is laid out by hand.
        const BEGINNING: u64 = 512;
        let mut beginning = Vec::new();
        let file = fs::File::open(path).ok()?;
        file.take(BEGINNING).read_to_end(&mut beginning).ok()?;
        let text = String::from_utf8_lossy(&beginning);
        let (_, rest) = text.trim_start().strip_prefix('{')?.split_once("\"format\"")?;
        let format = rest.trim_start().strip_prefix(':')?.trim_start().strip_prefix('"')?;
        let (format, _) = format.split_once('"')?;
        Self::ALL.into_iter().find(|kind| kind.format() == format)
    }

    /// Text of the field "format".
    pub(super) fn format(self) -> &'static str {
        match self {
            Self::Network => "decoupler network",
            Self::Checkpoint => "decoupler checkpoint",
            Self::MeasuredNetwork => "decoupler measured network",
            Self::MeasuredCheckpoint => "decoupler measured checkpoint",
            Self::Recipe => "decoupler import",
            Self::Sensor => "decoupler sensor",
            Self::RunList => "decoupler run list",
            Self::Trial => "decoupler trial",
            Self::SweepPlan => "decoupler sweep plan",
        }
    }

    /// Versions that can be read, of which the last is written.
    pub(super) fn versions(self) -> RangeInclusive<u64> {
        match self {
            // Version 1 had one network and the paper's scene only, version 3 has a checksum and the ranges of the
            // readings in training.
            Self::Network => 1..=3,
            // Version 1 had the paper's scene only, version 3 has the wall time.
            Self::Checkpoint => 1..=3,
            Self::MeasuredNetwork | Self::MeasuredCheckpoint | Self::Recipe | Self::Sensor => 1..=1,
            Self::RunList | Self::Trial | Self::SweepPlan => 1..=1,
        }
    }

    fn cure(self) -> &'static str {
        match self {
            Self::Network | Self::MeasuredNetwork => "copy or save it again",
            Self::Recipe => "correct it, or write it again with --save-recipe",
            Self::Sensor => "correct it, or calibrate again",
            Self::Checkpoint | Self::MeasuredCheckpoint => "copy it again, or start a new training",
            Self::RunList => "name the run or choose A and B again",
            Self::Trial | Self::SweepPlan => "delete it and run the sweep again",
        }
    }

    /// Reads the file of this kind at `path`, as far as its heading.
    ///
    /// # Errors
    /// The file cannot be read, or is of another kind or a newer version.
    pub(super) fn read(self, path: &Path) -> Result<(Heading, Vec<u8>), DocumentError> {
        let bytes = read_limited(path).map_err(|source| DocumentError::Read {
            path: path.to_owned(),
            source,
        })?;
        Ok((self.heading(path, &bytes)?, bytes))
    }

    /// Reads the heading of the file at `path` from its `bytes`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(super) fn heading(self, path: &Path, bytes: &[u8]) -> Result<Heading, DocumentError> {
        let path = || path.to_owned();
        let other = |reason| DocumentError::Other {
            path: path(),
            kind: self,
            reason,
        };
        let beginning = format!("{{\"format\":\"{}\",", self.format());
        let heading = Heading::read(bytes).map_err(|no_heading| match no_heading {
            NoHeading::NotJson(flaw) if bytes.starts_with(beginning.as_bytes()) => self.damaged(&path(), flaw),
            NoHeading::NotJson(reason) => other(reason),
            NoHeading::CutOff { line, column } => DocumentError::CutOff {
                path: path(),
                kind: self,
                line,
                column,
            },
            NoHeading::Other => other(format!("it has no field \"format\": \"{}\"", self.format())),
        })?;
        if heading.format != self.format() {
            let measured = [Self::MeasuredNetwork, Self::MeasuredCheckpoint];
            let found = measured.into_iter().find(|kind| heading.format == kind.format());
            return Err(other(match found {
                Some(kind) => format!("it is a {kind}, which has no sensor's geometry"),
                None => format!("its format is {}", heading.format),
            }));
        }
        match heading.newer_than(*self.versions().end()) {
            Some(version) => Err(DocumentError::Version {
                path: path(),
                kind: self,
                version,
                program: heading.program(),
            }),
            None => Ok(heading),
        }
    }

    pub(super) fn damaged(self, path: &Path, flaw: String) -> DocumentError {
        let path = path.to_owned();
        DocumentError::Damaged { path, kind: self, flaw }
    }
}

impl fmt::Display for DocumentKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Network => "network file",
            Self::Checkpoint => "checkpoint",
            Self::MeasuredNetwork => "network file of measured samples",
            Self::MeasuredCheckpoint => "checkpoint of measured samples",
            Self::Recipe => "recipe of an import",
            Self::Sensor => "sensor file",
            Self::RunList => "part of a run list",
            Self::Trial => "trial",
            Self::SweepPlan => "sweep plan",
        })
    }
}

/// Errors of reading or writing a network file, a checkpoint, a run list or the files of a sweep.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The operating system refuses to read it.
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Not JSON, or JSON of another kind.
    #[error("'{}' is not a {kind}: {reason}; choose one that Decoupler saved", .path.display())]
    Other {
        /// The file.
        path: PathBuf,
        /// Kind that it should have.
        kind: DocumentKind,
        /// Description of the file as found.
        reason: String,
    },
    /// JSON that ends too early.
    #[error("'{}' is cut off at line {line}, column {column}; {}", .path.display(), .kind.cure())]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: DocumentKind,
        /// Line of the end, counted from 1.
        line: usize,
        /// Column of the end, counted from 1.
        column: usize,
    },
    /// Written in a format unknown to this version.
    #[error("'{}' has version {version} of the format, written by {program}; this is {PROGRAM}, which reads versions {} to {}: install a newer one", .path.display(), .kind.versions().start(), .kind.versions().end())]
    Version {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: DocumentKind,
        /// Version of the file.
        version: String,
        /// Program that wrote the file.
        program: String,
    },
    /// The checksum does not match, or a field is missing, of the wrong kind, or does not fit the others.
    #[error("'{}' is damaged: {flaw}; {}", .path.display(), .kind.cure())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: DocumentKind,
        /// Description of the defect, with the field or with line and column.
        flaw: String,
    },
    /// A run on measured samples: the file tells of a simulated sensor, from which samples are drawn again.
    #[error(
        "a run on measured samples has no {0}; save its networks with serde, or its states and samples, and resume it on the same sets"
    )]
    Measured(DocumentKind),
    /// A run on simulated samples, where the file tells of measured ones.
    #[error("a run on simulated samples has no {0}; save it as a network file or checkpoint of its own kind")]
    Simulated(DocumentKind),
    /// The run has values that could not be read back.
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
