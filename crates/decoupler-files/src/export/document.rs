use std::{
    fmt, fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use decoupler_core::{evaluation::Run, text::in_one_line};
use thiserror::Error;

use super::{
    WriteError,
    atomic::read_limited,
    tables::{Heading, NoHeading},
};
use crate::{import::Recorded, machine::system_cause};

pub(super) const PROGRAM: &str = concat!("decoupler ", env!("CARGO_PKG_VERSION"));

/// Kinds of JSON files that the program writes and reads back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DocumentKind {
    /// A trained network with its record: [`super::NetworkFile`].
    Network,
    /// A training to be resumed: [`super::CheckpointFile`].
    Checkpoint,
    /// The source of the samples of a run: [`super::RecipeFile`].
    Recipe,
    /// A sensor model: [`super::SensorFile`].
    Sensor,
    /// A name or choice of the run list: [`super::RunFolder`].
    RunList,
    /// A finished trial of `decoupler sweep`.
    Trial,
}

impl DocumentKind {
    const ALL: [Self; 6] = [
        Self::Network,
        Self::Checkpoint,
        Self::Recipe,
        Self::Sensor,
        Self::RunList,
        Self::Trial,
    ];

    /// Returns the kind of the file at `path`, determined by its beginning; `None` if it is of no kind or cannot be
    /// read.
    pub fn of_file(path: &Path) -> Option<Self> {
        /// Number of bytes within which the format is named, even in a recipe formatted by hand.
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

    /// Value of the field `format`.
    pub(super) fn format(self) -> &'static str {
        match self {
            Self::Network => "decoupler network",
            Self::Checkpoint => "decoupler checkpoint",
            Self::Recipe => "decoupler recipe",
            Self::Sensor => "decoupler sensor",
            Self::RunList => "decoupler run list",
            Self::Trial => "decoupler trial",
        }
    }

    /// Version of the format, the only one that can be read.
    pub(super) fn version(self) -> u64 {
        match self {
            Self::Network | Self::Checkpoint => 4,
            Self::Recipe | Self::Sensor | Self::RunList | Self::Trial => 1,
        }
    }

    /// Returns the origin of the samples of `run` for its file: `recorded`, or `None` if they are simulated.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and no plan is given.
    pub(super) fn recorded_of(self, run: &Run, recorded: Option<&Recorded>) -> Result<Option<Recorded>, DocumentError> {
        if run.settings().simulation().is_some() {
            return Ok(None);
        }
        recorded.map_or(Err(DocumentError::NoPlan(self)), |recorded| Ok(Some(recorded.clone())))
    }

    fn cure(self) -> &'static str {
        match self {
            Self::Network => "copy or save it again",
            Self::Recipe => "correct it, or write it again with --save-recipe",
            Self::Sensor => "correct it, or calibrate again",
            Self::Checkpoint => "copy it again, or start a new training",
            Self::RunList => "name the run or choose A and B again",
            Self::Trial => "delete it and run the sweep again",
        }
    }

    /// Reads the bytes of the file of this kind at `path` and checks their heading.
    ///
    /// # Errors
    /// The file cannot be read, or is of another kind or version.
    pub(super) fn read(self, path: &Path) -> Result<Vec<u8>, DocumentError> {
        let bytes = read_limited(path).map_err(|source| DocumentError::Read {
            path: path.to_owned(),
            source,
        })?;
        self.check_heading(path, &bytes)?;
        Ok(bytes)
    }

    fn check_heading(self, path: &Path, bytes: &[u8]) -> Result<(), DocumentError> {
        let path = || path.to_owned();
        let other = |reason: String| DocumentError::Other {
            path: path(),
            kind: self,
            reason: in_one_line(&reason),
        };
        let beginning = format!("{{\"format\":\"{}\",", self.format());
        let heading = Heading::read(bytes).map_err(|no_heading| match no_heading {
            NoHeading::NotJson(defect) if bytes.starts_with(beginning.as_bytes()) => self.damaged(&path(), defect),
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
            return Err(other(format!("its format is {}", heading.format)));
        }
        match heading.version_other_than(self.version()) {
            Some(version) => Err(DocumentError::Version {
                path: path(),
                kind: self,
                version,
                program: heading.program(),
            }),
            None => Ok(()),
        }
    }

    pub(super) fn damaged(self, path: &Path, defect: String) -> DocumentError {
        let path = path.to_owned();
        DocumentError::Damaged {
            path,
            kind: self,
            defect: in_one_line(&defect),
        }
    }
}

impl fmt::Display for DocumentKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Network => "network file",
            Self::Checkpoint => "checkpoint",
            Self::Recipe => "recipe",
            Self::Sensor => "sensor file",
            Self::RunList => "part of a run list",
            Self::Trial => "trial",
        })
    }
}

/// Errors of reading or writing a network file, a checkpoint, a run list or the files of a sweep.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The operating system cannot read it.
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
    #[error("'{}' has version {version} of the format, written by {program}; this is {PROGRAM}, which reads version {}: open it with the program that wrote it", .path.display(), .kind.version())]
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
    #[error("'{}' is damaged: {defect}; {}", .path.display(), .kind.cure())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: DocumentKind,
        /// Description of the defect, with the field or with line and column.
        defect: String,
    },
    /// The samples are recorded, and no plan is given.
    #[error(
        "a {0} of recorded samples names the recording: give the plan that reads it, or save the networks with serde"
    )]
    NoPlan(DocumentKind),
    /// A recording is needed.
    #[error("'{}' is the recipe of a simulated array: give the recipe of a recording", .0.display())]
    SimulatedRecipe(PathBuf),
    /// The run has values that could not be read back.
    #[error("'{}' is not saved: {defect}; train again with other settings", .path.display())]
    Unsound {
        /// The file.
        path: PathBuf,
        /// Description of the defect, with the field.
        defect: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
