use std::{
    collections::HashSet,
    fs, io,
    io::Write as _,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use thiserror::Error;

use super::{
    NetworkFile, WriteError, atomic_write,
    heading::{Heading, NoHeading},
    limited::{LARGEST_BYTES, read_limited, too_large},
    network_file::PROGRAM,
};
use crate::dataset::system_cause;

const FORMAT: &str = "decoupler workspace";
const VERSION: u64 = 1;

/// Contents of the workspace file, kept between sessions: the finished trainings, and the two that are compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Workspace {
    /// The runs in the order in which they were finished.
    pub runs: Vec<KeptRun>,
    /// [`KeptRun::id`] of the two runs that are compared.
    pub pinned: [Option<u64>; 2],
}

/// A finished training.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptRun {
    /// Number of the run, unique in the workspace.
    pub id: u64,
    /// Name given by the user.
    pub name: String,
    /// Settings, network, training record and errors.
    pub file: Arc<NetworkFile>,
}

/// A workspace as it was found.
#[derive(Debug)]
pub struct FoundWorkspace {
    /// The part of the file that could be read.
    pub workspace: Workspace,
    /// A sentence about what could not be read, and where the old file is kept.
    pub warning: Option<String>,
}

/// Errors of loading a workspace. The file is then left unchanged, and must not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WorkspaceError {
    /// The operating system refuses to read it.
    #[error("cannot read the run list '{}': {}; runs of this session are not kept", .path.display(), system_cause(.source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A newer program wrote it.
    #[error("the run list '{}' is of {program}, which is newer than this program: update it; until then runs are not kept", .path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Program that wrote the file.
        program: String,
    },
    /// The file is damaged, and cannot be copied.
    #[error("the run list '{}' is damaged ({flaw}) and cannot be put aside: {}; runs of this session are not kept", .path.display(), system_cause(.source))]
    Aside {
        /// The file.
        path: PathBuf,
        /// Description of the defect.
        flaw: String,
        /// The error of the operating system.
        source: io::Error,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    program: String,
    runs: Vec<RunDocument>,
    pinned: [Option<u64>; 2],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunDocument {
    id: u64,
    name: String,
    network: Box<RawValue>,
}

impl KeptRun {
    fn document(&self) -> Result<RunDocument, String> {
        Ok(RunDocument {
            id: self.id,
            name: self.name.clone(),
            network: self.file.to_raw()?,
        })
    }
}

impl Workspace {
    /// Writes the file whole or not at all; its folder is made if it is not there. Runs that could not be read back are
    /// left out.
    ///
    /// # Errors
    /// The path cannot be written; the old file, if there was one, is untouched then.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|source| WriteError::io(folder, source))?;
        }
        let document = Document {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: PROGRAM.to_owned(),
            runs: self.runs.iter().filter_map(|run| run.document().ok()).collect(),
            pinned: self.pinned,
        };
        let bytes = document
            .runs
            .iter()
            .map(|run| run.network.get().len() as u64)
            .sum::<u64>();
        atomic_write(path, |writer| {
            if bytes > LARGEST_BYTES {
                return Err(too_large());
            }
            serde_json::to_writer(&mut *writer, &document)?;
            writeln!(writer)
        })
    }

    /// Loads the workspace at `path`; an empty one if there is no file. A damaged file, or one with damaged runs,
    /// is first copied under another name beside it, and the part that can be read is loaded.
    ///
    /// # Errors
    /// The file can be neither read nor copied.
    pub fn load(path: &Path) -> Result<FoundWorkspace, WorkspaceError> {
        let bytes = match read_limited(path) {
            Ok(bytes) => bytes,
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => {
                return Ok(FoundWorkspace {
                    workspace: Self::default(),
                    warning: None,
                });
            }
            Err(source) => {
                let path = path.to_owned();
                return Err(WorkspaceError::Read { path, source });
            }
        };
        if let Ok(heading) = Heading::read(&bytes)
            && heading.format == FORMAT
            && let Some(version) = heading.newer_than(VERSION)
        {
            return Err(WorkspaceError::Newer {
                path: path.to_owned(),
                program: format!("{}, file version {version}", heading.program()),
            });
        }
        let (workspace, flaw) = match Self::parse(path, &bytes) {
            Ok((workspace, flaws)) => (workspace, flaws.first().cloned()),
            Err(flaw) => (Self::default(), Some(flaw)),
        };
        let Some(flaw) = flaw else {
            return Ok(FoundWorkspace {
                workspace,
                warning: None,
            });
        };
        let aside = put_aside(path, &bytes).map_err(|source| WorkspaceError::Aside {
            path: path.to_owned(),
            flaw: flaw.clone(),
            source,
        })?;
        let kept = match workspace.runs.len() {
            0 => "a new list was begun".to_owned(),
            1 => "one run could be read".to_owned(),
            count => format!("{count} runs could be read"),
        };
        let (path, aside) = (path.display(), aside.display());
        Ok(FoundWorkspace {
            workspace,
            warning: Some(format!(
                "The run list '{path}' is damaged ({flaw}): {kept}, and the damaged file is kept as '{aside}'."
            )),
        })
    }

    /// Splits the runs into those that can be read and the defects of the others.
    fn parse(path: &Path, bytes: &[u8]) -> Result<(Self, Vec<String>), String> {
        let heading = Heading::read(bytes).map_err(|no_heading| match no_heading {
            NoHeading::NotJson(reason) => reason,
            NoHeading::CutOff { line, column } => format!("it ends after line {line}, column {column}"),
            NoHeading::Other => "it is not a run list".to_owned(),
        })?;
        if heading.format != FORMAT {
            return Err("it is not a run list".to_owned());
        }
        let document: Document = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        let mut ids = HashSet::new();
        let (mut runs, mut flaws) = (Vec::new(), Vec::new());
        for run in document.runs {
            let read = NetworkFile::parse(path, run.network.get().as_bytes());
            match read {
                Err(_) => flaws.push(format!("run '{}' cannot be read", run.name)),
                Ok(_) if !ids.insert(run.id) => flaws.push(format!("two runs have the number {}", run.id)),
                Ok(file) => runs.push(KeptRun {
                    id: run.id,
                    name: run.name,
                    file: Arc::new(file),
                }),
            }
        }
        let pinned = document.pinned.map(|id| id.filter(|id| ids.contains(id)));
        Ok((Self { runs, pinned }, flaws))
    }
}

/// Copies the file to its folder under a name that is not taken yet.
fn put_aside(path: &Path, bytes: &[u8]) -> io::Result<PathBuf> {
    let mut number = 1;
    loop {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".damaged-{number}"));
        let aside = path.with_file_name(name);
        match fs::File::create_new(&aside) {
            Ok(mut file) => {
                file.write_all(bytes)?;
                file.sync_all()?;
                return Ok(aside);
            }
            Err(taken) if taken.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(error),
        }
    }
}
