//! Files of the folder in which runs are kept: `run-N.json`, the network file of run N, written once; `run-N.name.json`,
//! its name; `pinned.json`, the two runs that are compared.

use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use decoupler_core::text::clean_name;
use serde::{Serialize, de::DeserializeOwned};

use super::{AtomicFile, DocumentError, DocumentKind, NetworkFile, WriteError, document::PROGRAM};
use crate::{import::Setup, machine::system_cause};

/// The finished trainings, and the two that are compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptRuns {
    /// The runs in the order in which they were finished.
    pub runs: Vec<KeptRun>,
    /// [`KeptRun::id`] of the two runs that are compared.
    pub pinned: [Option<u64>; 2],
}

/// A finished training.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptRun {
    /// Number of the run, unique in its folder: microseconds from 1970 to its end.
    pub id: u64,
    /// Name given by the user.
    pub name: String,
    /// What a list shows of it.
    pub summary: Arc<RunSummary>,
    /// Settings, network, training record and errors; `None` while they are only in its file. The records of a few
    /// hundred runs would take more memory than the rest of the program.
    pub file: Option<Arc<NetworkFile>>,
}

/// What a list shows of a finished training.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSummary {
    /// Settings, and the plan of a recording.
    pub setup: Setup,
    /// `true` if the targets are nodes of an array: [`Problem::has_nodes`](decoupler_core::problem::Problem).
    pub has_nodes: bool,
    /// Error on the test set in percent.
    pub percent: Option<f64>,
    /// Training time in seconds.
    pub seconds: f64,
}

impl RunSummary {
    /// Summary of the run in a network file.
    pub fn of(file: &NetworkFile) -> Self {
        Self {
            setup: file.setup(),
            has_nodes: file.problem.has_nodes(),
            percent: file.scores.network.percent(),
            seconds: file.training.seconds,
        }
    }
}

impl KeptRun {
    /// The run in a network file, which stays in its file, with a name that none of `others` has: source, hidden nodes and
    /// method, numbered if there is such a name.
    fn new(id: u64, file: &NetworkFile, others: &[Self]) -> Self {
        let summary = Arc::new(RunSummary::of(file));
        let settings = summary.setup.settings();
        let method = settings.training.method.short_name();
        let name = format!("{} h{} {method}", summary.setup.source_name(), settings.hidden);
        let is_taken = |name: &String| others.iter().any(|run| run.name == *name);
        let numbered = (2..).map(|number| format!("{name} ({number})"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        Self {
            id,
            name: names.find(|name| !is_taken(name)).unwrap_or(name),
            summary,
            file: None,
        }
    }

    /// Returns the run, which is read from its file in `folder` if it is not in memory.
    ///
    /// # Errors
    /// The file cannot be read or is damaged.
    pub fn load(&self, folder: &Path) -> Result<Arc<NetworkFile>, DocumentError> {
        match &self.file {
            Some(file) => Ok(Arc::clone(file)),
            None => NetworkFile::load(&run_path(folder, self.id)).map(Arc::new),
        }
    }
}

/// The run list and the folder that keeps it.
///
/// Each run is a separate network file, which is written once and never changed. Its name is another small file, and so
/// is the pair that is compared; each is written when it changes. Several programs can therefore share a folder without
/// locks: no two write the same run, the last name given counts, and [`Self::look`] finds the changes made by others.
///
/// In memory are the runs that cannot be written, and those that [`Self::load_used`] reads.
#[derive(Debug, Default)]
pub struct RunFolder {
    /// `None` if runs are not kept.
    path: Option<PathBuf>,
    kept: KeptRuns,
    /// Runs that exist only in memory.
    unwritten: BTreeSet<u64>,
    /// Problems that [`Self::look`] has returned.
    reported: BTreeSet<String>,
}

impl RunFolder {
    /// Opens the folder at `path`, which is created if it is missing, and reads its runs.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn open(path: &Path) -> Result<(Self, Vec<String>), DocumentError> {
        fs::create_dir_all(path).map_err(|source| WriteError::io(path, source))?;
        let mut folder = Self {
            path: Some(path.to_owned()),
            ..Self::default()
        };
        let problems = folder.look();
        Ok((folder, problems))
    }

    /// Folder in which the runs are kept, if they are.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The list as of the last look.
    pub fn runs(&self) -> &KeptRuns {
        &self.kept
    }

    /// Number of runs that exist only in memory, since they could not be written.
    pub fn unwritten(&self) -> usize {
        self.unwritten.len()
    }

    /// Reads what other programs have changed: new runs, names, the pair that is compared, removals. Returns the files
    /// that cannot be read, each once; they are left as they are. Runs that could not be written are tried again.
    pub fn look(&mut self) -> Vec<String> {
        let Some(path) = &self.path else { return Vec::new() };
        let KeptRuns { runs, pinned } = &mut self.kept;
        let unwritten = &mut self.unwritten;
        for run in &*runs {
            let is_written = || write_run(path, run).is_ok() || run_path(path, run.id).exists();
            if unwritten.contains(&run.id) && is_written() {
                unwritten.remove(&run.id);
            }
        }
        let mut problems = Vec::new();
        let ids = match ids(path) {
            Ok(ids) => ids,
            Err(error) => {
                let (path, cause) = (path.display(), system_cause(&error));
                return self.untold(vec![format!("cannot read the run list '{path}': {cause}")]);
            }
        };
        runs.retain(|run| ids.contains(&run.id) || unwritten.contains(&run.id));
        for id in ids {
            let Err(place) = runs.binary_search_by_key(&id, |run| run.id) else {
                continue;
            };
            match NetworkFile::load(&run_path(path, id)) {
                Ok(file) => runs.insert(place, KeptRun::new(id, &file, runs)),
                // Another program has removed it just now.
                Err(_) if !run_path(path, id).exists() => {}
                Err(error) => problems.push(left_out(&error)),
            }
        }
        for KeptRun { id, name, .. } in &mut *runs {
            match read::<String>(&name_path(path, *id)) {
                Ok(found) => *name = found.map_or_else(|| name.clone(), |found| clean_name(&found)),
                Err(defect) => problems.push(format!("the name of a run cannot be read: {defect}; rename '{name}'")),
            }
        }
        match read(&pinned_path(path)) {
            Ok(found) => *pinned = found.unwrap_or(*pinned),
            Err(defect) => problems.push(format!(
                "the runs compared cannot be read: {defect}; choose A and B again"
            )),
        }
        *pinned = pinned.map(|id| id.filter(|id| runs.iter().any(|run| run.id == *id)));
        self.untold(problems)
    }

    /// Reads the runs into memory that are compared, and the newest; releases the others. Returns the files that cannot
    /// be read, each once; their runs leave the list.
    pub fn load_used(&mut self) -> Vec<String> {
        let Some(folder) = &self.path else { return Vec::new() };
        let KeptRuns { runs, pinned } = &mut self.kept;
        let mut problems = Vec::new();
        let mut newest = true;
        // From the newest: if it cannot be read, the one before it is the newest.
        for place in (0..runs.len()).rev() {
            let run = &mut runs[place];
            let is_used = newest || pinned.contains(&Some(run.id));
            if self.unwritten.contains(&run.id) {
                newest = false;
            } else if !is_used {
                run.file = None;
            } else {
                match run.load(folder) {
                    Ok(file) => (run.file, newest) = (Some(file), false),
                    Err(error) => {
                        problems.push(left_out(&error));
                        runs.remove(place);
                    }
                }
            }
        }
        self.untold(problems)
    }

    fn untold(&mut self, mut problems: Vec<String>) -> Vec<String> {
        problems.retain(|problem| self.reported.insert(problem.clone()));
        problems
    }

    /// Adds a finished training under a new name: source, hidden nodes and method.
    ///
    /// # Errors
    /// Its file cannot be written; it is then in the list until the program ends.
    pub fn keep(&mut self, file: Arc<NetworkFile>) -> Result<(), DocumentError> {
        let runs = &mut self.kept.runs;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut run = KeptRun::new(u64::try_from(now.as_micros()).unwrap_or(0), &file, runs);
        run.file = Some(file);
        // A unique id, even while other programs write runs to the folder.
        let written = loop {
            if runs.iter().all(|other| other.id != run.id) {
                match self.path.as_ref().map_or(Ok(true), |folder| write_run(folder, &run)) {
                    Ok(false) => {}
                    written => break written.map(drop),
                }
            }
            run.id = run.id.wrapping_add(1);
        };
        let id = run.id;
        runs.insert(runs.partition_point(|other| other.id < id), run);
        if self.folder_of(id).is_none() {
            self.unwritten.insert(id);
        }
        written
    }

    /// Renames run `id`.
    ///
    /// # Errors
    /// The name cannot be written; it then lasts until the next look.
    pub fn rename(&mut self, id: u64, name: &str) -> Result<(), WriteError> {
        let Some(run) = self.kept.runs.iter_mut().find(|run| run.id == id) else {
            return Ok(());
        };
        name.clone_into(&mut run.name);
        match self.folder_of(id) {
            Some(folder) => write(&name_path(folder, id), &name),
            None => Ok(()),
        }
    }

    /// Chooses the two runs that are compared.
    ///
    /// # Errors
    /// The choice cannot be written; it then lasts until the next look.
    pub fn pin(&mut self, pinned: [Option<u64>; 2]) -> Result<(), WriteError> {
        self.kept.pinned = pinned;
        match &self.path {
            Some(folder) => write(&pinned_path(folder), &pinned),
            None => Ok(()),
        }
    }

    /// Removes run `id` permanently.
    ///
    /// # Errors
    /// Its file cannot be removed; the next look finds it again.
    pub fn remove(&mut self, id: u64) -> Result<(), WriteError> {
        let removed = match self.folder_of(id) {
            Some(folder) => {
                let path = run_path(folder, id);
                // A name without a run is harmless.
                let _ = fs::remove_file(name_path(folder, id));
                fs::remove_file(&path).map_err(|source| WriteError::io(&path, source))
            }
            None => Ok(()),
        };
        self.kept.runs.retain(|run| run.id != id);
        self.unwritten.remove(&id);
        self.kept.pinned = self.kept.pinned.map(|pinned| pinned.filter(|pinned| *pinned != id));
        removed
    }

    /// Returns the folder if it has the file of run `id`.
    fn folder_of(&self, id: u64) -> Option<&Path> {
        self.path().filter(|folder| run_path(folder, id).exists())
    }
}

/// Writes a run and its name; returns `false` if there is a run with its id. A name that cannot be written is an error of the
/// run, which is nevertheless there.
fn write_run(folder: &Path, run: &KeptRun) -> Result<bool, DocumentError> {
    let Some(file) = &run.file else { return Ok(false) };
    let is_new = file.save_by(&run_path(folder, run.id), AtomicFile::commit_new)?;
    if is_new {
        write(&name_path(folder, run.id), &run.name)?;
    }
    Ok(is_new)
}

fn left_out(error: &DocumentError) -> String {
    format!("a run is left out of the list: {error}")
}

const KIND: DocumentKind = DocumentKind::RunList;

/// Network file of run `id`.
fn run_path(folder: &Path, id: u64) -> PathBuf {
    folder.join(format!("run-{id}.json"))
}

/// File with the name of run `id`.
fn name_path(folder: &Path, id: u64) -> PathBuf {
    folder.join(format!("run-{id}.name.json"))
}

/// File with the ids of the two runs that are compared.
fn pinned_path(folder: &Path) -> PathBuf {
    folder.join("pinned.json")
}

/// Returns the ids of all runs in `folder`, in ascending order.
fn ids(folder: &Path) -> io::Result<Vec<u64>> {
    let mut ids = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().and_then(OsStr::to_str);
        let id = name.and_then(|name| name.strip_prefix("run-")?.strip_suffix(".json")?.parse().ok());
        // No program writes "run-007.json", and opening a pipe would wait for a program that writes to it.
        ids.extend(id.filter(|id| path == run_path(folder, *id) && path.is_file()));
    }
    ids.sort_unstable();
    Ok(ids)
}

/// Writes a small value, sealed with a checksum.
fn write(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    KIND.save(PROGRAM, value, path, AtomicFile::commit)
}

/// Reads what [`write`] has written; `None` if there is no file.
///
/// # Errors
/// The file cannot be read, is of another kind or version, or is damaged.
fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, DocumentError> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() => Err(KIND.damaged(path, "it is not a file")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        _ => KIND.load(path).map(|(_, value)| Some(value)),
    }
}
