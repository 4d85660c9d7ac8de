use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
};

use super::{
    files_section::FILES,
    fixes::Fix,
    import::{Import, file_name},
    opening::{Opened, Reopened, open_files, reopen, write_sample},
    reading::Reading,
};
use crate::window::{
    job::Jobs,
    shared::{Effect, FileInUse, FileTask, Matter, Notice, RecordingDraft, RunsRequest, Shared, SourceKind},
    training_worker::RunId,
};
use decoupler_core::{
    evaluation::{RunSettings, Source, TrainingSize},
    scene::RowModel,
};
use decoupler_files::{
    export::RunSummary,
    import::{FileSet, Plan, Setup, Watch},
};

/// Editor of the recording that is trained on: its files, the meaning of their columns, and the division of the samples.
///
/// It reports the plan of the import by [`Effect::Import`] whenever that changes.
#[derive(Debug)]
pub struct RecordingEditor {
    /// The import, once files are open.
    pub(super) import: Option<Import>,
    /// A plan with missing files.
    pub(super) missing: Option<Box<Reopened>>,
    /// Names of files that have changed since the run with this import.
    pub(super) changed: Vec<String>,
    pub(super) reading: Reading,
    /// Problems of the import that was reported, the most urgent first.
    pub fixes: Vec<Fix>,
    /// What was open, missing and changed before all files were closed.
    pub(super) cleared: Option<Cleared>,
    /// Texts in the fields of options that are not in the plan, by the names of the options, with the reason if they were refused.
    pub(super) typed: BTreeMap<&'static str, (String, Option<String>)>,
    /// The run in whose place the user is viewing the columns.
    pub(super) hidden: Option<RunId>,
    /// The file asked for last, and where its path arrives.
    asked: Option<(Use, Receiver<PathBuf>)>,
}

/// The import or the plan with missing files, and the names of changed files.
type Cleared = (Option<Import>, Option<Box<Reopened>>, Vec<String>);

/// Use of a file that the user is asked for.
#[derive(Clone, Debug)]
pub(super) enum Use {
    /// A recording, or another file to be opened.
    Recording,
    /// Takes the place of this missing file.
    Missing(PathBuf),
    /// A recording of test samples.
    Test,
}

impl RecordingEditor {
    /// Nothing open yet.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            import: None,
            missing: None,
            changed: Vec::new(),
            reading: Reading::new(jobs),
            fixes: Vec::new(),
            cleared: None,
            typed: BTreeMap::new(),
            hidden: None,
            asked: None,
        }
    }

    /// Returns the task of opening a file.
    pub fn open_task(&mut self) -> FileTask {
        self.ask(Use::Recording, String::new())
    }

    /// Returns the task of asking for the path of a file.
    pub(super) fn ask(&mut self, of: Use, suggestion: String) -> FileTask {
        let (sender, receiver) = channel();
        self.asked = Some((of, receiver));
        FileTask::choose(FILES, suggestion, sender)
    }

    /// Opens files: recordings are added to those that are open; a recipe, a network or a checkpoint takes their place.
    pub fn open(&mut self, paths: Vec<PathBuf>) {
        let paths = Vec::from_iter(paths.iter().map(|path| absolute(path)));
        if let (Some(reopened), [path]) = (&self.missing, &paths[..]) {
            let mut missing = reopened.missing.iter();
            if let Some(missing) = missing.find(|missing| missing.file_name() == path.file_name()) {
                let (reopened, missing) = (reopened.clone(), missing.clone());
                return self.take_found(*reopened, missing, path.clone());
            }
        }
        let open = self.import.as_ref().map(Import::paths).unwrap_or_default();
        self.open_files(paths, open);
    }

    /// Opens the files of `plan`, whose paths are absolute, unless they are open.
    pub fn open_plan(&mut self, plan: &Plan) {
        let is_open = self.plan().is_ok_and(|open| *open == *plan);
        let missing = self.missing.as_ref().map(|missing| &missing.recorded.plan);
        if !is_open && missing != Some(plan) {
            let (reopened, name) = (Reopened::from(plan.clone()), file_name(&plan.import.data));
            self.reading.open(name, true, |watch| reopen(reopened, watch));
        } else if self.reading.is_reopening() {
            self.reading.cancel();
        }
    }

    /// Returns true if no file is open, missing or being opened.
    pub fn is_empty(&self) -> bool {
        self.import.is_none() && self.missing.is_none() && !self.reading.is_opening()
    }

    /// Closes a file; without the last recording there is no import.
    pub(super) fn close(&mut self, path: &Path) {
        let Some(import) = &mut self.import else { return };
        let plan = import.edit();
        let recipe = &mut plan.import;
        let is_of_test = plan.test.iter().flat_map(FileSet::files).any(|file| file == path);
        let appended = recipe.append.iter().position(|set| set.data == path);
        if is_of_test {
            plan.test = None;
        } else if recipe.positions.as_deref() == Some(path) {
            recipe.positions = None;
        } else if let Some(number) = appended {
            recipe.append.remove(number);
            import.write_meanings(true);
        } else if recipe.data == path && !recipe.append.is_empty() {
            // The next one takes its place, with the files joined to it.
            let next = recipe.append.remove(0);
            recipe.data = next.data;
            for (joined, file) in recipe.join.iter_mut().zip(next.join) {
                joined.file = file;
            }
            self.read_again();
        } else {
            let mut paths = import.paths();
            paths.retain(|other| other != path);
            match paths.is_empty() {
                true => self.clear(),
                false => self.open_files(Vec::new(), paths),
            }
        }
    }

    /// Closes all files, and keeps their names and meanings for [`Self::undo_clear`].
    pub(super) fn clear(&mut self) {
        let changed = std::mem::take(&mut self.changed);
        self.cleared = Some((self.import.take(), self.missing.take(), changed));
        self.close_all();
    }

    /// Brings back the files that [`Self::clear`] has closed.
    pub(super) fn undo_clear(&mut self) {
        if let Some(cleared) = self.cleared.take() {
            (self.import, self.missing, self.changed) = cleared;
        }
    }

    fn close_all(&mut self) {
        self.reading.cancel();
        (self.import, self.missing) = (None, None);
        self.changed.clear();
        self.typed.clear();
    }

    /// Reads the files again, in the way that the plan says now.
    pub(super) fn read_again(&mut self) {
        if let Some(import) = &self.import {
            self.open_files(Vec::new(), import.paths());
        }
    }

    fn open_files(&mut self, new: Vec<PathBuf>, open: Vec<PathBuf>) {
        let older = self.import.clone().unwrap_or_default();
        let names = if new.is_empty() { &open } else { &new };
        let names = Vec::from_iter(names.iter().map(|path| file_name(path))).join(", ");
        self.reading
            .open(names, false, move |watch| open_files(new, open, &older, watch));
    }

    /// Opens the sample recording, which is written into `folder`.
    pub(super) fn open_sample(&mut self, folder: PathBuf) {
        let open = move |watch: Watch<'_>| {
            let new = vec![write_sample(&folder)?];
            open_files(new, Vec::new(), &Import::default(), watch)
        };
        self.reading.open("sample recording".to_owned(), false, open);
    }

    /// Opens the file at `found` in the place of a missing one.
    fn take_found(&mut self, mut reopened: Reopened, missing: PathBuf, found: PathBuf) {
        let name = file_name(&found);
        let open = move |watch: Watch<'_>| {
            reopened.relocate(&missing, &found);
            reopen(reopened, watch)
        };
        self.reading.open(name, true, open);
    }

    /// Takes events of the threads and paths chosen, and reports the plan if it has changed.
    pub fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.take_chosen(shared.phase.is_busy(), effects);
        let is_by_user = !self.reading.is_reopening();
        match self.reading.next_opened() {
            Some(Ok(opened)) => {
                effects.push(Effect::Settle(Matter::Recording));
                self.take(opened, is_by_user, shared, effects);
            }
            Some(Err(reason)) => effects.push(failed(reason)),
            None => {}
        }
        let settings = &shared.recording.settings;
        let plan = self.plan();
        // Training needs the processor.
        if !shared.phase.is_busy() {
            if plan.is_ok() {
                self.follow_row_wires(settings, effects);
            }
            self.reading.check(plan.clone().ok(), settings.seed);
        }
        let is_reported = match (&plan, &shared.recording.plan) {
            (Ok(plan), Ok(reported)) => Arc::ptr_eq(plan, reported),
            (Err(reason), Err(reported)) => reason == reported,
            _ => false,
        };
        if !self.reading.is_reopening() && !is_reported {
            let import = self.import.as_ref().filter(|_| plan.is_ok());
            self.fixes = import.map(Fix::all).unwrap_or_default();
            effects.push(Effect::Import(plan));
        }
    }

    fn take_chosen(&mut self, is_busy: bool, effects: &mut Vec<Effect>) {
        let Some((of, receiver)) = &self.asked else { return };
        let (Ok(path), false) = (receiver.try_recv(), is_busy) else {
            return;
        };
        let path = absolute(&path);
        match (of.clone(), &mut self.import, &self.missing) {
            (Use::Recording, ..) => self.open(vec![path]),
            (Use::Missing(missing), _, Some(reopened)) => {
                let reopened = Reopened::clone(reopened);
                self.take_found(reopened, missing, path);
            }
            (Use::Test, Some(import), _) => effects.extend(import.set_test_file(path).err().map(failed)),
            _ => {}
        }
    }

    /// Takes what was opened; shows the columns if the user has opened it.
    fn take(&mut self, opened: Opened, is_by_user: bool, shared: &Shared, effects: &mut Vec<Effect>) {
        let usual = shared.recording.settings.validation_fraction();
        let holding_out = |mut import: Import| {
            import.edit().division.validation_fraction.get_or_insert(usual);
            Some(import)
        };
        let shown = shared.run.as_ref().map(|run| run.id);
        match opened {
            Opened::Recordings(import) => {
                let import = import.keeping(self.import.take().unwrap_or_default());
                (self.import, self.missing) = (holding_out(import), None);
                self.changed.clear();
                effects.push(Effect::ChooseSource(SourceKind::Recording));
                self.hidden = shown;
            }
            Opened::Plan(import, reopened) => {
                self.close_all();
                (self.import, self.changed) = (holding_out(*import), reopened.changed);
                if is_by_user {
                    effects.push(Effect::ChooseSource(SourceKind::Recording));
                    self.hidden = shown;
                }
                if let Some(checkpoint) = reopened.checkpoint {
                    let setup = Setup::recording(checkpoint.settings, reopened.recorded.plan);
                    effects.push(Effect::TakeUp(Box::new(setup), checkpoint.starts));
                }
            }
            Opened::Missing(reopened) => {
                self.close_all();
                effects.extend(reopened.checkpoint.iter().flat_map(|saved| configured(saved.settings)));
                self.missing = Some(reopened);
            }
            Opened::Simulation(source) => {
                let settings = RunSettings {
                    source: (*source).into(),
                    ..shared.draft
                };
                effects.push(Effect::TakeSetup(Box::new(settings.into())));
            }
            Opened::Network(file, import) => {
                let summary = RunSummary::of(&file);
                let is_listed = shared.runs.workspace.runs.iter().any(|run| *run.summary == summary);
                match import {
                    None => effects.push(Effect::TakeSetup(Box::new(file.setup()))),
                    Some(import) => {
                        effects.extend(configured(file.settings));
                        match import {
                            Ok(opened) => self.take(*opened, is_by_user, shared, effects),
                            Err(reason) => effects.push(failed(reason)),
                        }
                    }
                }
                let name = file.source_name();
                let text = format!("The settings of {name} are set. Its run is listed in Compare.");
                effects.push(Effect::Notify(Matter::Recording, Notice::Done(text)));
                effects.extend((!is_listed).then(|| Effect::ChangeRuns(RunsRequest::Keep(file))));
            }
            Opened::Checkpoint(path) => effects.push(Effect::OpenTraining(path)),
        }
    }

    /// Sets the share held out for validation if the method of the new settings of a recording needs another one.
    pub fn follow_method(&mut self, before: &RunSettings, settings: &RunSettings) {
        let (fraction, is_recording) = (settings.validation_fraction(), settings.simulation().is_none());
        if let (true, Some(import)) = (
            is_recording && fraction != before.validation_fraction(),
            &mut self.import,
        ) {
            import.edit().division.validation_fraction = Some(fraction);
        }
    }

    /// Selects one network for all rows if no column contains the row numbers.
    fn follow_row_wires(&self, settings: &RunSettings, effects: &mut Vec<Effect>) {
        if settings.source.row_model() == RowModel::Each && !self.has_row_wires() && !self.reading.is_reopening() {
            effects.push(Effect::Configure(Box::new(RunSettings {
                source: Source::Measured { rows: RowModel::Shared },
                ..*settings
            })));
        }
    }

    /// Returns the plan of the import, or what is missing and what to do.
    fn plan(&self) -> Result<Arc<Plan>, String> {
        if let Some(missing) = self.missing.as_ref().and_then(|missing| missing.missing.first()) {
            let name = file_name(missing);
            return Err(format!(
                "{name} is missing: find it under “Files”, or open another recording."
            ));
        }
        match &self.import {
            None => Err(RecordingDraft::NOTHING_OPEN.to_owned()),
            Some(_) if self.reading.is_opening() => Err("Files are being opened.".to_owned()),
            Some(import) => import.obstacle().map_or_else(|| Ok(Arc::clone(&import.plan)), Err),
        }
    }

    /// Returns the numbers of inputs and targets, once there are both.
    pub fn channels(&self) -> Option<(usize, usize)> {
        let recipe = &self.import.as_ref()?.plan.import;
        let channels = (recipe.inputs.len(), recipe.targets.len());
        Some(channels).filter(|channels| channels.0 > 0 && channels.1 > 0)
    }

    /// Returns the size of a training with one network, once the import is checked.
    pub fn training_size(&self, settings: &RunSettings) -> Option<TrainingSize> {
        let checked = self.reading.checked()?;
        (settings.source.row_model() == RowModel::Shared).then_some(checked.size)
    }

    /// Returns true if a column contains the row numbers.
    pub fn has_row_wires(&self) -> bool {
        self.import
            .as_ref()
            .is_some_and(|import| import.plan.import.row_wire.is_some())
    }

    /// Returns true if the columns take the place of the results in the middle of the view.
    pub fn is_on_show(&self, shared: &Shared) -> bool {
        let run = shared.shown_run().map(|run| run.id);
        shared.source == SourceKind::Recording && (run.is_none() || run == self.hidden)
    }

    /// Returns the files of the import, which must not be overwritten.
    pub fn files_in_use(&self) -> Vec<FileInUse> {
        let files = self.import.iter().flat_map(|import| import.plan.files());
        files.map(FileInUse::Recording).collect()
    }
}

fn failed(reason: String) -> Effect {
    Effect::Notify(Matter::Recording, Notice::Failed(reason))
}

/// Effects that make these the settings of the next training on a recording.
fn configured(settings: RunSettings) -> [Effect; 2] {
    let configure = Effect::Configure(Box::new(settings));
    [Effect::ChooseSource(SourceKind::Recording), configure]
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
