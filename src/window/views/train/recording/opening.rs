//! Files opened in the background: recordings, recipes, networks and checkpoints.
//!
//! A check of the import in the background: numbers of samples, rows dropped, and warnings.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::{
    dataset::{Dataset, Seed, Simulation},
    evaluation::recorded::{channel_remarks, extrapolation},
};
use decoupler_files::{
    export::{CheckpointFile, DocumentKind, NetworkFile, RecipeFile, describe_positions},
    import::{
        Dropped, FileReport, FileSet, Format, InspectedFile, Joined, Plan, Progress, Recipe, Recording, Watch,
        holds_positions, suggested_plan, suggested_plan_in_order,
    },
};

use super::{
    columns_card::{Renaming, in_window},
    draft::{Draft, file_name, missing},
    files_section::{Reopened, write_sample},
};
use crate::window::job::{Background, JobError, Report, Wake};

/// Files to be opened.
#[derive(Clone, Debug)]
pub(super) enum ToOpen {
    /// Recordings, or a file of this program.
    Files(Files),
    /// Files of a plan.
    Import(Box<Reopened>),
    /// As [`Self::Import`], with the missing file at the first path found at the second.
    Found(Box<Reopened>, PathBuf, PathBuf),
    /// Recordings of a checkpoint that the worker could not resume.
    Missing(PathBuf),
    /// The sample recording, to be written into this folder.
    Sample(PathBuf),
}

/// Recordings to be opened.
#[derive(Clone, Debug, Default)]
pub(super) struct Files {
    /// Files to be opened: one may be a recipe, a network or a checkpoint.
    pub(super) new: Vec<PathBuf>,
    /// Files that are open, to which recordings are added.
    pub(super) open: Vec<PathBuf>,
    /// The import with them, whose choices the new one keeps.
    pub(super) older: Option<Box<Draft>>,
}

/// Contents of a file that was opened.
#[derive(Debug)]
pub(super) enum Opened {
    /// Recordings with the suggested meanings of their columns.
    Recordings(Box<Draft>),
    /// A file with positions of targets, for the recordings that are open.
    Positions(PathBuf),
    /// Import of the recipe of a recording.
    Recipe(Box<Draft>),
    /// Recipe of a simulated array.
    Simulation(Box<Simulation>),
    /// Import of a plan.
    Import(Box<Draft>, Box<Reopened>),
    /// Import of a plan with missing files.
    Missing(Box<Reopened>),
    /// A network, and its import or the reason why there is none; `None` for a simulated array.
    Network(Box<NetworkFile>, Option<Result<Box<Opened>, String>>),
    /// A checkpoint, which is for the worker.
    Checkpoint(PathBuf),
    /// No file is missing.
    Nothing,
}

/// Event of files being opened.
#[derive(Debug)]
pub(super) enum OpeningEvent {
    /// Progress of reading this file.
    Reading(Progress),
    /// The files, or the reason why they cannot be opened.
    Opened(Result<Opened, String>),
}

/// Files under way.
#[derive(Debug)]
pub(super) struct Opening {
    job: Background<OpeningEvent>,
    /// Names of the files under way, and the progress of reading them.
    pub(super) under_way: Option<(String, Option<Progress>)>,
    /// True while the files of a plan are being opened.
    pub(super) is_reopening: bool,
}

impl Opening {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Background::prompt("opening", wake),
            under_way: None,
            is_reopening: false,
        }
    }

    /// Opens files; those still being opened are abandoned.
    pub(super) fn start(&mut self, to_open: ToOpen) {
        let paths = match &to_open {
            ToOpen::Files(files) if files.new.is_empty() => files.open.clone(),
            ToOpen::Files(files) => files.new.clone(),
            ToOpen::Import(reopened) | ToOpen::Found(reopened, ..) => vec![reopened.recorded.plan.import.data.clone()],
            ToOpen::Missing(path) => vec![path.clone()],
            ToOpen::Sample(_) => vec![PathBuf::from("sample recording")],
        };
        self.is_reopening = matches!(to_open, ToOpen::Import(_) | ToOpen::Found(..) | ToOpen::Missing(_));
        let names: Vec<String> = paths.iter().map(|path| file_name(path)).collect();
        self.under_way = Some((names.join(", "), None));
        self.job.start(
            move |report| open(to_open, report),
            |opened: Result<_, JobError>| OpeningEvent::Opened(opened.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Cancels opening files.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        (self.under_way, self.is_reopening) = (None, false);
    }

    /// Returns the contents of the files once they are read.
    pub(super) fn next_opened(&mut self) -> Option<Result<Opened, String>> {
        while let Some(event) = self.job.next_event() {
            match event {
                OpeningEvent::Reading(progress) => {
                    if let Some((_, latest)) = &mut self.under_way {
                        *latest = Some(progress);
                    }
                }
                OpeningEvent::Opened(opened) => {
                    (self.under_way, self.is_reopening) = (None, false);
                    return Some(opened);
                }
            }
        }
        None
    }
}

fn open(to_open: ToOpen, report: &Report<OpeningEvent>) -> Result<Opened, String> {
    let mut watch = |progress| {
        report.progress(OpeningEvent::Reading(progress), |_, _| ());
        if report.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let files = match to_open {
        ToOpen::Import(reopened) => return reopen(*reopened, &mut watch),
        ToOpen::Found(mut reopened, missing, found) => {
            reopened.relocate(&missing, &found)?;
            return reopen(*reopened, &mut watch);
        }
        // The window has reported the error in the file.
        ToOpen::Missing(path) => return Ok(missing_of_checkpoint(&path).unwrap_or(Opened::Nothing)),
        ToOpen::Sample(folder) => Files {
            new: vec![write_sample(&folder)?],
            ..Files::default()
        },
        ToOpen::Files(mut files) => {
            files.new = with_tables_of_folders(files.new)?;
            files
        }
    };
    for path in &files.new {
        match (DocumentKind::of_file(path), files.new.len()) {
            (None, _) => {}
            (Some(kind), 1) => return open_document(kind, path, &mut watch),
            (Some(kind), _) => {
                return Err(format!("'{}' is a {kind}: open it without other files", path.display()));
            }
        }
    }
    let of_test = files.older.as_ref().and_then(|older| older.tests().next());
    let is_test = |path: &&PathBuf| of_test.is_some_and(|(_, test)| test == *path);
    if let Some(path) = files.new.iter().find(is_test) {
        return Err(format!(
            "'{}' is a file for the test, so it cannot be trained on: close it under “Files” first",
            path.display()
        ));
    }
    let (positions, recordings): (Vec<PathBuf>, Vec<PathBuf>) =
        files.new.into_iter().partition(|path| holds_positions(path));
    let positions = match (&positions[..], files.open.is_empty() && recordings.is_empty()) {
        ([], _) => None,
        ([path], false) => Some(path.clone()),
        ([path, ..], true) => {
            let path = path.display();
            return Err(format!(
                "'{path}' has positions of targets: open their recording first, or with it"
            ));
        }
        ([one, other, ..], _) => {
            let (one, other) = (one.display(), other.display());
            return Err(format!(
                "'{one}' and '{other}' both have positions of targets: open one of them"
            ));
        }
    };
    if let (Some(path), []) = (&positions, &recordings[..]) {
        return Ok(Opened::Positions(path.clone()));
    }
    let is_same_files = recordings.is_empty();
    let appended = files.older.as_ref().map(|older| older.plan.import.append.clone());
    let appended = appended.unwrap_or_default();
    let mut paths = files.open;
    if !is_same_files {
        paths.extend(appended.iter().flat_map(FileSet::files).cloned());
    }
    for path in recordings {
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    let recipe = to_look_at(paths, files.older.as_deref());
    let variables = files
        .older
        .as_ref()
        .map(|older| older.variable_names(&recipe))
        .unwrap_or_default();
    let inspected_files = recipe.inspect(Path::new(""), &variables, &mut watch);
    let inspected_files = inspected_files.map_err(|error| in_window(&error))?;
    // The file with the readings is guessed only if the set of files has changed.
    let mut plan = if is_same_files {
        let mut plan = suggested_plan_in_order(&inspected_files);
        plan.import.append = appended;
        plan
    } else {
        suggested_plan(&inspected_files)
    };
    plan.import.dialect = recipe.dialect;
    plan.import.derive.clone_from(&recipe.derive);
    plan.import.missing = match &files.older {
        Some(older) => {
            let stems = plan.import.stems();
            let joined = plan.import.join.iter().zip(&stems);
            let joined = joined.map(|(joined, stem)| (joined.file.as_path(), Some(stem.as_str())));
            let all = std::iter::once((plan.import.data.as_path(), None)).chain(joined);
            missing(&Renaming::new(&older.files, all).missing(&older.missing))
        }
        None => recipe.missing,
    };
    plan.import.positions = positions;
    let variables = files
        .older
        .map(|older| older.variable_names(&plan.import))
        .unwrap_or_default();
    Ok(Opened::Recordings(inspected(plan, &variables, Draft::new, &mut watch)?))
}

/// Replaces folders by the tables in them.
fn with_tables_of_folders(paths: Vec<PathBuf>) -> Result<Vec<PathBuf>, String> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            let found = Format::tables_in(&path);
            let mut found = found.map_err(|error| format!("cannot read '{}': {error}", path.display()))?;
            if found.is_empty() {
                return Err(format!("'{}' is a folder without tables: open a file", path.display()));
            }
            files.append(&mut found);
        } else {
            files.push(path);
        }
    }
    Ok(files)
}

/// Returns the recipe for the first inspection of recordings, with the layout and stems of an older import. Missing-cell
/// markers of single columns are left out, because the names of columns may change.
fn to_look_at(paths: Vec<PathBuf>, older: Option<&Draft>) -> Recipe {
    let of_older = |file: &PathBuf| {
        let mut joined = older.iter().flat_map(|older| &older.plan.import.join);
        joined.find(|joined| joined.file == *file)?.stem.clone()
    };
    let missing = older.map(|older| missing(&older.missing)).unwrap_or_default();
    let mut paths = paths.into_iter();
    Recipe {
        data: paths.next().unwrap_or_default(),
        join: paths
            .map(|file| Joined {
                stem: of_older(&file),
                file,
                ..Joined::default()
            })
            .collect(),
        dialect: older.map(|older| older.plan.import.dialect).unwrap_or_default(),
        derive: older.map(|older| older.plan.import.derive.clone()).unwrap_or_default(),
        time: older.and_then(|older| older.made_plan().ok()?.import.time),
        missing: missing.into_iter().filter(|missing| missing.column.is_none()).collect(),
        ..Recipe::default()
    }
}

/// Inspects the files of a plan.
fn inspected(
    plan: Plan,
    variables: &[String],
    draft: fn(Plan, Vec<InspectedFile>) -> Draft,
    watch: Watch<'_>,
) -> Result<Box<Draft>, String> {
    let files = plan.import.inspect(Path::new(""), variables, watch);
    Ok(Box::new(draft(plan, files.map_err(|error| in_window(&error))?)))
}

/// Opens the files of an import again, if all are there.
fn reopen(mut reopened: Reopened, watch: Watch<'_>) -> Result<Opened, String> {
    if !reopened.missing().is_empty() {
        return Ok(Opened::Missing(Box::new(reopened)));
    }
    reopened.compare()?;
    let draft = inspected(reopened.recorded.plan.clone(), &[], Draft::of_recipe, watch)?;
    Ok(Opened::Import(draft, Box::new(reopened)))
}

fn open_document(kind: DocumentKind, path: &Path, watch: Watch<'_>) -> Result<Opened, String> {
    match kind {
        DocumentKind::Recipe => {
            let plan = match RecipeFile::load(path).map_err(|error| error.to_string())? {
                RecipeFile::Recording(plan) => plan,
                RecipeFile::Simulated(simulation) => return Ok(Opened::Simulation(Box::new(simulation))),
            };
            match reopen(Reopened::from(plan), watch)? {
                Opened::Import(draft, _) => Ok(Opened::Recipe(draft)),
                opened => Ok(opened),
            }
        }
        DocumentKind::Network => {
            let file = NetworkFile::load(path).map_err(|error| error.to_string())?;
            let recorded = file.recorded.clone();
            let import = recorded.map(|recorded| reopen(Reopened::from(recorded), watch).map(Box::new));
            Ok(Opened::Network(Box::new(file), import))
        }
        DocumentKind::Checkpoint => match missing_of_checkpoint(path) {
            Ok(opened @ Opened::Missing(_)) => Ok(opened),
            // The worker reports the error in the file.
            _ => Ok(Opened::Checkpoint(path.to_owned())),
        },
        other => Err(format!(
            "'{}' is a {other}: open a recording (CSV, .npy, .npz or .mat), a recipe, a network or a checkpoint",
            path.display()
        )),
    }
}

/// Returns the recordings that are missing for the training in the checkpoint at `path`.
fn missing_of_checkpoint(path: &Path) -> Result<Opened, String> {
    let file = CheckpointFile::load(path).map_err(|error| error.to_string())?;
    let reopened = file.recorded.clone().map(|recorded| Reopened {
        checkpoint: Some(Box::new(file)),
        ..Reopened::from(recorded)
    });
    Ok(match reopened {
        Some(reopened) if !reopened.missing().is_empty() => Opened::Missing(Box::new(reopened)),
        _ => Opened::Nothing,
    })
}

/// Outcome of an import.
#[derive(Clone, Debug)]
pub(super) struct Checked {
    /// Number of samples for training, validation and test.
    pub(super) samples: [usize; 3],
    /// Numbers of inputs, with those from the past, and targets.
    pub(super) channels: (usize, usize),
    /// Number of rows of the files, dropped ones included.
    pub(super) rows: usize,
    /// Rows that are not samples, by reason.
    pub(super) dropped: Vec<Dropped>,
    /// The files, and how they are joined.
    pub(super) files: Vec<FileReport>,
    /// Positions of targets, as text.
    pub(super) positions: Option<String>,
    /// Warnings for the user.
    pub(super) warnings: Vec<String>,
}

#[derive(Debug)]
struct CheckingEvent(Result<Box<Checked>, String>);

/// Current check, and the outcome of the last one.
#[derive(Debug)]
pub(super) struct Checking {
    job: Background<CheckingEvent>,
    asked: Option<(Arc<Plan>, Seed)>,
    /// Its outcome, once it is known.
    pub(super) checked: Option<Result<Box<Checked>, String>>,
}

impl Checking {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Background::new("import", wake),
            asked: None,
            checked: None,
        }
    }

    /// Checks this plan, unless that is done or under way; `None` if there is nothing to check.
    pub(super) fn follow(&mut self, planned: Option<Arc<Plan>>, seed: Seed) {
        let wanted = planned.map(|planned| (planned, seed));
        let is_same = match (&wanted, &self.asked) {
            (None, None) => true,
            (Some((wanted, seed)), Some((asked, before))) => {
                seed == before && (Arc::ptr_eq(wanted, asked) || wanted == asked)
            }
            _ => false,
        };
        self.asked.clone_from(&wanted);
        if !is_same {
            self.checked = None;
            match wanted {
                None => self.job.abandon(),
                Some((plan, seed)) => self.job.start(
                    move |report| check(&plan, seed, report),
                    |checked: Result<_, JobError>| {
                        CheckingEvent(checked.unwrap_or_else(|error| Err(error.to_string())))
                    },
                ),
            }
        }
        while let Some(CheckingEvent(checked)) = self.job.next_event() {
            self.checked = Some(checked);
        }
    }

    /// Returns true while an import is being checked.
    pub(super) fn is_under_way(&self) -> bool {
        self.asked.is_some() && self.checked.is_none()
    }
}

fn check(plan: &Plan, seed: Seed, report: &Report<CheckingEvent>) -> Result<Box<Checked>, String> {
    let mut watch = |_| {
        if report.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let imported = plan.recordings(Path::new(""), &mut watch);
    let (recording, test_recording) = imported.map_err(|error| in_window(&error))?;
    let divided = plan.divide(&recording, test_recording.as_ref(), seed);
    let (split, test) = divided.map_err(|error| in_window(&error))?;
    let recordings = || std::iter::once(&recording).chain(&test_recording);
    let mut warnings = Recording::warnings_of(recordings());
    let (inputs, targets) = (recording.problem.features(), &recording.problem.targets);
    warnings.extend(channel_remarks(&recording.set, plan.division.by, &inputs, targets));
    warnings.extend(extrapolation(&split.training, &test, &inputs, targets).1);
    let validation = split.validation.as_ref().map_or(0, Dataset::samples);
    Ok(Box::new(Checked {
        samples: [split.training.samples(), validation, test.samples()],
        channels: (split.training.readings().ncols(), split.training.targets().ncols()),
        rows: recordings().map(|recording| recording.rows).sum(),
        dropped: recordings()
            .flat_map(|recording| recording.dropped.iter().cloned())
            .collect(),
        files: recordings()
            .flat_map(|recording| recording.files.iter().cloned())
            .collect(),
        positions: describe_positions(&recording.problem.positions),
        warnings,
    }))
}
