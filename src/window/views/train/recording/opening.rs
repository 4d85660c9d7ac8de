//! Files opened in the background: recordings, recipes, networks and checkpoints are inspected, which results in an import or
//! in a list of missing files.

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use decoupler_core::dataset::Simulation;
use decoupler_files::{
    export::{CheckpointFile, DocumentKind, NetworkFile, RecipeFile, atomic_write},
    import::{
        FileChecksum, FileSet, Format, Joined, Plan, Recorded, Watch, file_crc32, holds_positions, suggested_plan,
        suggested_plan_in_order,
    },
};

use super::{
    checking::in_window,
    import::{Import, file_name},
};

/// Contents of a file that was opened.
#[derive(Debug)]
pub(super) enum Opened {
    /// Recordings with the suggested meanings of their columns.
    Recordings(Box<Import>),
    /// Recordings of a plan.
    Plan(Box<Import>, Box<Reopened>),
    /// A plan with missing files.
    Missing(Box<Reopened>),
    /// Recipe of a simulated array.
    Simulation(Box<Simulation>),
    /// A network, and its import or the reason why there is none; `None` for a simulated array.
    Network(Box<NetworkFile>, Option<Result<Box<Opened>, String>>),
    /// A checkpoint, which is for the worker.
    Checkpoint(PathBuf),
}

/// Opens the files at `new`, of which one may be a recipe, a network or a checkpoint. Recordings are added to those at `open`,
/// which are those of the `older` import.
pub(super) fn open_files(
    new: Vec<PathBuf>,
    open: Vec<PathBuf>,
    older: &Import,
    watch: Watch<'_>,
) -> Result<Opened, String> {
    let of_folder = |path: PathBuf| {
        if !path.is_dir() {
            return Ok(vec![path]);
        }
        let found = Format::tables_in(&path).map_err(|error| format!("cannot read '{}': {error}", path.display()))?;
        let refusal = || format!("'{}' is a folder without tables: open a file", path.display());
        Some(found).filter(|found| !found.is_empty()).ok_or_else(refusal)
    };
    let new = new
        .into_iter()
        .map(of_folder)
        .collect::<Result<Vec<_>, String>>()?
        .concat();
    let document = new.iter().find_map(|path| Some((path, DocumentKind::of_file(path)?)));
    match (document, new.len()) {
        (None, _) => {}
        (Some((path, kind)), 1) => return open_document(kind, path, watch),
        (Some((path, kind)), _) => {
            return Err(format!("'{}' is a {kind}: open it without other files", path.display()));
        }
    }
    let (positions, recordings): (Vec<PathBuf>, Vec<PathBuf>) = new.into_iter().partition(|path| holds_positions(path));
    let has_recording = !(open.is_empty() && recordings.is_empty());
    if let Some(path) = positions.first().filter(|_| positions.len() > 1 || !has_recording) {
        let path = path.display();
        return Err(format!(
            "'{path}' has positions of targets: open one such file, with its recording or after it"
        ));
    }
    // The file with the readings is guessed only if the set of files changes.
    let has_new = !recordings.is_empty();
    let appended = &older.plan.import.append;
    let mut paths = open;
    let further = appended.iter().flat_map(FileSet::files).filter(|_| has_new);
    for path in further.chain(&recordings) {
        if !paths.contains(path) {
            paths.push(path.clone());
        }
    }
    let time = older.plan.import.time.clone();
    let time = time.filter(|_| !older.plan.import.derive.is_empty());
    let mut inspect = |plan: &Plan| {
        let mut import = older.merged(plan.clone()).import;
        import.time = import.time.or_else(|| time.clone());
        let inspected = import.inspect(Path::new(""), &older.used(), watch);
        inspected.map_err(|error| in_window(&error))
    };
    let mut plan = Plan::default();
    let mut in_order = paths.iter().cloned();
    plan.import.data = in_order.next().unwrap_or_default();
    let joined = in_order.map(|file| Joined {
        file,
        ..Joined::default()
    });
    plan.import.join = joined.collect();
    let inspected = inspect(&plan)?;
    plan = if has_new {
        suggested_plan(&inspected)
    } else {
        suggested_plan_in_order(&inspected)
    };
    if !has_new {
        plan.import.append = appended.iter().filter_map(|set| older.matching(set, &paths)).collect();
    }
    plan.import.positions = positions.into_iter().next();
    let inspected = inspect(&plan)?;
    Ok(Opened::Recordings(Box::new(Import::suggested(plan, inspected))))
}

fn open_document(kind: DocumentKind, path: &Path, watch: Watch<'_>) -> Result<Opened, String> {
    match kind {
        DocumentKind::Recipe => match RecipeFile::load(path).map_err(|error| error.to_string())? {
            RecipeFile::Recording(plan) => reopen(Reopened::from(plan.absolute()), watch),
            RecipeFile::Simulated(simulation) => Ok(Opened::Simulation(Box::new(simulation))),
        },
        DocumentKind::Network => {
            let file = NetworkFile::load(path).map_err(|error| error.to_string())?;
            let recorded = file.recorded.clone();
            let import = recorded.map(|recorded| reopen(Reopened::from(recorded), watch).map(Box::new));
            Ok(Opened::Network(Box::new(file), import))
        }
        DocumentKind::Checkpoint => {
            // The worker reports an error in the file.
            if let Ok(file) = CheckpointFile::load(path)
                && let Some(recorded) = file.recorded.clone()
                && !recorded.missing().is_empty()
            {
                let mut reopened = Reopened::from(recorded);
                reopened.checkpoint = Some(Box::new(file));
                return reopen(reopened, watch);
            }
            Ok(Opened::Checkpoint(path.to_owned()))
        }
        other => Err(format!(
            "'{}' is a {other}: open a recording (CSV, .npy, .npz or .mat), a recipe, a network or a checkpoint",
            path.display()
        )),
    }
}

/// Opens the files of a plan again, if all are there, and notes which have changed.
pub(super) fn reopen(mut reopened: Reopened, watch: Watch<'_>) -> Result<Opened, String> {
    let missing = reopened.recorded.missing();
    reopened.missing = missing.into_iter().map(PathBuf::from).collect();
    if !reopened.missing.is_empty() {
        return Ok(Opened::Missing(Box::new(reopened)));
    }
    for file in &reopened.recorded.files {
        if !has_checksum(&file.path, &file.crc32)? {
            reopened.changed.push(file_name(&file.path));
        }
    }
    if let (Some(_), Some(name)) = (&reopened.checkpoint, reopened.changed.first()) {
        return Err(format!(
            "{name} has changed since the training was saved, so the training cannot be resumed with it. Use the original \
             file."
        ));
    }
    let plan = reopened.recorded.plan.clone();
    let files = plan.import.inspect(Path::new(""), &[], watch);
    let import = Import::of_recipe(plan, files.map_err(|error| in_window(&error))?);
    Ok(Opened::Plan(Box::new(import), Box::new(reopened)))
}

/// A plan whose files are to be opened again, and what is known of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Reopened {
    /// Plan with absolute paths, and checksums; an empty checksum is not known.
    pub(super) recorded: Recorded,
    /// Training to be resumed once all files are found.
    pub(super) checkpoint: Option<Box<CheckpointFile>>,
    /// Files that no longer exist.
    pub(super) missing: Vec<PathBuf>,
    /// Names of files whose contents differ from those at the time of the run.
    pub(super) changed: Vec<String>,
}

impl From<Recorded> for Reopened {
    fn from(recorded: Recorded) -> Self {
        Self {
            recorded,
            ..Self::default()
        }
    }
}

impl From<Plan> for Reopened {
    /// Returns a plan without known checksums.
    fn from(plan: Plan) -> Self {
        let unknown = |path| FileChecksum {
            path,
            ..FileChecksum::default()
        };
        Self::from(Recorded {
            files: plan.files().into_iter().map(unknown).collect(),
            plan,
            ..Recorded::default()
        })
    }
}

impl Reopened {
    /// Replaces a missing file by `found`, and other missing files by those of the same name next to it.
    pub(super) fn relocate(&mut self, missing: &Path, found: &Path) {
        let folder = found.parent().unwrap_or(Path::new(""));
        self.recorded = self.recorded.relocated(missing, found).within(folder);
    }
}

/// Returns true if the file has this checksum, or the checksum is not known, as that of a pipe.
fn has_checksum(path: &Path, crc32: &str) -> Result<bool, String> {
    if crc32.is_empty() || !path.is_file() {
        return Ok(true);
    }
    let found = file_crc32(path, &mut |_| ControlFlow::Continue(()));
    Ok(found.map_err(|error| error.to_string())? == crc32)
}

/// Name and contents of the sample: made by `examples/soft_skin.rs`.
const NAME: &str = "soft_skin.csv";
const TEXT: &str = include_str!("../../../../../assets/samples/soft_skin.csv");

/// Writes the sample recording into `folder`, and returns its path.
///
/// # Errors
/// If it cannot be written.
pub(super) fn write_sample(folder: &Path) -> Result<PathBuf, String> {
    let path = folder.join(NAME);
    let written = fs::create_dir_all(folder).map_err(|error| error.to_string());
    let write = |()| atomic_write(&path, |file| file.write_all(TEXT.as_bytes())).map_err(|error| error.to_string());
    let written = written.and_then(write);
    written.map_err(|error| format!("the sample recording cannot be written: {error}"))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_is_found_with_its_neighbours_and_changed_contents_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [("sensor.csv", "1\n"), ("states.csv", "2\n"), ("other.csv", "3\n")] {
            fs::write(at(name), text).unwrap();
        }
        let gone = |name: &str| PathBuf::from("/gone").join(name);
        let mut plan = Plan::default();
        plan.import.data = gone("sensor.csv");
        plan.import.join = vec![decoupler_files::import::Joined {
            file: gone("states.csv"),
            ..Default::default()
        }];
        let mut reopened = Reopened::from(plan);
        for file in &mut reopened.recorded.files {
            file.crc32 = file_crc32(&at(&file_name(&file.path)), &mut |_| ControlFlow::Continue(())).unwrap();
        }
        let open = |reopened: &Reopened| reopen(reopened.clone(), &mut |_| ControlFlow::Continue(())).unwrap();
        let Opened::Missing(mut reopened) = open(&reopened) else {
            panic!("nothing is missing");
        };
        assert_eq!(reopened.missing, [gone("sensor.csv"), gone("states.csv")]);

        let mut found = reopened.clone();
        found.relocate(&gone("sensor.csv"), &at("sensor.csv"));
        let Opened::Plan(import, found) = open(&found) else {
            panic!("the other file is next to it");
        };
        assert_eq!(import.plan.import.join[0].file, at("states.csv"));
        assert!(found.changed.is_empty());

        reopened.relocate(&gone("sensor.csv"), &at("other.csv"));
        let Opened::Plan(_, reopened) = open(&reopened) else {
            panic!("the other file is found");
        };
        assert_eq!(reopened.changed, ["other.csv"]);
    }
}
