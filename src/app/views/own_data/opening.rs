//! Files opened in the background: recordings, recipes, networks and checkpoints alike.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use super::{
    draft::{Draft, file_name, missing},
    model::{Positions, Tested, Trained},
    remarks::in_window,
    renaming::Renaming,
};
use crate::{
    app::job::{Job, JobError, Report, Wake},
    export::{DocumentKind, MeasuredCheckpointFile, MeasuredNetworkFile, RecipeFile},
    import::{InspectedFile, Joined, Plan, Progress, Recipe, holds_positions, suggested_plan, suggested_plan_in_order},
};

/// Files to be opened.
#[derive(Clone, Debug)]
pub(super) enum ToOpen {
    /// Recordings, or a file of this program.
    Files(Files),
    /// Files of a plan.
    Plan(Box<Plan>),
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
    /// Recordings with guesses of what they mean.
    Recordings(Box<Draft>),
    /// A file with positions of targets, beside recordings that are open.
    Positions(PathBuf),
    /// A recipe, or the files of a plan.
    Import(Box<Draft>),
    /// A network, and its import if the recording is still there.
    Network(Box<Trained>, Option<Box<Draft>>),
    /// A checkpoint, which is for the trainer, and its import if the recording is still there.
    Checkpoint(PathBuf, Box<MeasuredCheckpointFile>, Option<Box<Draft>>),
}

/// News of files being opened.
#[derive(Debug)]
pub(super) enum OpeningEvent {
    /// Progress of reading this file.
    Reading(Progress),
    /// The files are open, or why not.
    Opened(Result<Opened, String>),
}

/// Files under way.
#[derive(Debug)]
pub(super) struct Opening {
    job: Job<OpeningEvent>,
    /// Names of the files under way, and how far they are read.
    pub(super) under_way: Option<(String, Option<Progress>)>,
}

impl Opening {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Job::prompt("opening", wake),
            under_way: None,
        }
    }

    /// Opens files; those still being opened are let go.
    pub(super) fn start(&mut self, to_open: ToOpen) {
        let paths = match &to_open {
            ToOpen::Files(files) if files.new.is_empty() => files.open.clone(),
            ToOpen::Files(files) => files.new.clone(),
            ToOpen::Plan(plan) => vec![plan.import.data.clone()],
        };
        let names: Vec<String> = paths.iter().map(|path| file_name(path)).collect();
        self.under_way = Some((names.join(", "), None));
        self.job.start(
            move |report| open(to_open, report),
            |opened: Result<_, JobError>| OpeningEvent::Opened(opened.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Opens them no longer.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.under_way = None;
    }

    /// The contents that were opened, once they are.
    pub(super) fn next_opened(&mut self) -> Option<Result<Opened, String>> {
        while let Some(event) = self.job.next_event() {
            match event {
                OpeningEvent::Reading(progress) => {
                    if let Some((_, latest)) = &mut self.under_way {
                        *latest = Some(progress);
                    }
                }
                OpeningEvent::Opened(opened) => {
                    self.under_way = None;
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
        ToOpen::Plan(plan) => return Ok(Opened::Import(inspected(*plan, Draft::of_recipe, &mut watch)?)),
        ToOpen::Files(files) => files,
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
    let mut paths = files.open;
    for path in recordings {
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    let recipe = to_look_at(paths, files.older.as_deref());
    let inspected_files = recipe.inspect(Path::new(""), &mut watch);
    let inspected_files = inspected_files.map_err(|error| in_window(&error))?;
    // Which file has the readings is guessed only where there are others than before.
    let mut plan = if is_same_files {
        suggested_plan_in_order(&inspected_files)
    } else {
        suggested_plan(&inspected_files)
    };
    plan.import.dialect = recipe.dialect;
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
    Ok(Opened::Recordings(inspected(plan, Draft::new, &mut watch)?))
}

/// The recipe by which recordings are looked at for the first time: laid out as those of an older import, whose stems they
/// keep. Cells that mean missing in a column are left out, as its name may change.
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
        missing: missing.into_iter().filter(|missing| missing.column.is_none()).collect(),
        ..Recipe::default()
    }
}

/// The import of a plan.
fn inspected(
    plan: Plan,
    draft: fn(Plan, Vec<InspectedFile>) -> Draft,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Box<Draft>, String> {
    let files = plan.import.inspect(Path::new(""), watch);
    Ok(Box::new(draft(plan, files.map_err(|error| in_window(&error))?)))
}

fn open_document(
    kind: DocumentKind,
    path: &Path,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Opened, String> {
    match kind {
        DocumentKind::Recipe => {
            let plan = RecipeFile::load_recording(path).map_err(|error| error.to_string())?;
            Ok(Opened::Import(inspected(plan, Draft::of_recipe, watch)?))
        }
        DocumentKind::MeasuredNetwork => {
            let file = MeasuredNetworkFile::load(path).map_err(|error| error.to_string())?;
            let draft = inspected(file.plan.clone(), Draft::of_recipe, watch).ok();
            let trained = opened_network(file, watch);
            Ok(Opened::Network(Box::new(trained), draft))
        }
        DocumentKind::MeasuredCheckpoint => {
            let file = MeasuredCheckpointFile::load(path).map_err(|error| error.to_string())?;
            let draft = inspected(file.plan.clone(), Draft::of_recipe, watch).ok();
            Ok(Opened::Checkpoint(path.to_owned(), Box::new(file), draft))
        }
        DocumentKind::Network => Err(format!(
            "'{}' has a network of a simulated sensor: open it in the Live view, which decodes with it",
            path.display()
        )),
        DocumentKind::Checkpoint => Err(format!(
            "'{}' is a training on a simulated sensor: open it in the Train view",
            path.display()
        )),
        other => Err(format!(
            "'{}' is a {other}: give a recording (CSV, .npy, .npz or .mat), a recipe, or a network of own data",
            path.display()
        )),
    }
}

/// The network of a file, with its answers to the test samples if the recording can be read again.
fn opened_network(file: MeasuredNetworkFile, watch: &mut dyn FnMut(Progress) -> ControlFlow<()>) -> Trained {
    let sets = file.plan.sets(Path::new(""), file.settings.seed, watch);
    let tested = sets.map_err(|error| in_window(&error)).and_then(|sets| {
        if (sets.test.channels(), sets.test.outputs()) != (file.inputs.len(), file.targets.len()) {
            return Err("it has other columns now".to_owned());
        }
        let answers = file.network.decouple(&sets.test);
        let tested = Tested::new(sets.test, answers, Positions::of(&sets.recording), &file.targets);
        if tested.errors() == file.errors {
            Ok(tested)
        } else {
            Err("its test samples are others now".to_owned())
        }
    });
    let (tested, remark) = match tested {
        Ok(tested) => (Some(tested), None),
        Err(reason) => (
            None,
            Some(format!(
                "The errors are those in the file. There are no charts of test samples, for the recording cannot be used \
                 again: {reason}."
            )),
        ),
    };
    Trained {
        remarks: Vec::from_iter(remark),
        tested: tested.map(Into::into),
        ..Trained::of_file(file.into())
    }
}
