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
    import::{Import, file_name},
    opening::{Opened, Reopened, open_files, reopen, write_sample},
    reading::Reading,
};
use crate::window::{
    job::Wake,
    shared::{
        Effect, FileInUse, FileTask, FileWords, Matter, Notice, Purpose, RecordingDraft, RunsRequest, Shared,
        SourceKind,
    },
    training_worker::RunId,
};
use decoupler_core::{
    evaluation::{RunSettings, Source, TrainingSize},
    scene::RowModel,
};
use decoupler_files::{
    export::RunSummary,
    import::{Meaning, Plan, Setup, Watch},
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
    /// Texts in the fields of options that are not in the plan, by the names of the options, with the reason if they were refused.
    pub(super) typed: BTreeMap<&'static str, (String, Option<String>)>,
    /// True if the user is viewing the columns while there is a run to show.
    pub(super) shows_columns: bool,
    /// The file asked for last, and where its path arrives.
    asked: Option<(Use, Receiver<PathBuf>)>,
    /// True while the recordings of a checkpoint are looked for that the worker could not resume.
    is_refused: bool,
    /// The run that the window knew last.
    run: Option<RunId>,
    /// Share held out for validation that the method needs; `None` if the share of a plan is to be kept.
    held_out: Option<f64>,
}

/// Use of a file that the user is asked for.
#[derive(Clone, Debug)]
pub(super) enum Use {
    /// A recording, or another file to be opened.
    Recording,
    /// Takes the place of this missing file.
    Missing(PathBuf),
    /// A recording of test samples.
    Test,
    /// Positions of the targets.
    Positions,
}

impl RecordingEditor {
    /// Nothing open yet. `wake` is called when there are events.
    pub fn new(wake: &Wake) -> Self {
        Self {
            import: None,
            missing: None,
            changed: Vec::new(),
            reading: Reading::new(Arc::clone(wake)),
            typed: BTreeMap::new(),
            shows_columns: false,
            asked: None,
            is_refused: false,
            run: None,
            held_out: None,
        }
    }

    /// Returns the task of opening a file.
    pub fn open_task(&mut self) -> FileTask {
        self.ask(Use::Recording, FILES, String::new())
    }

    /// Returns the task of asking for the path of a file.
    pub(super) fn ask(&mut self, of: Use, words: FileWords, suggestion: String) -> FileTask {
        let (sender, receiver) = channel();
        self.asked = Some((of, receiver));
        FileTask {
            words,
            suggestion,
            purpose: Purpose::Choose(sender),
        }
    }

    /// Opens files: recordings are added to those that are open; a recipe, a network or a checkpoint takes their place.
    pub fn open(&mut self, paths: Vec<PathBuf>) {
        self.is_refused = false;
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
        self.held_out = None;
        let is_open = self.plan().is_ok_and(|open| *open == *plan);
        let missing = self.missing.as_ref().map(|missing| &missing.recorded.plan);
        if !is_open && missing != Some(plan) {
            let (reopened, name) = (Reopened::from(plan.clone()), file_name(&plan.import.data));
            self.reading.open(name, true, |watch| reopen(reopened, watch));
        } else if self.reading.is_reopening() {
            self.reading.cancel();
        }
    }

    /// Checks the recordings of the checkpoint at `path`, which could not be resumed: they may be missing.
    pub fn look_for_recordings(&mut self, path: PathBuf) {
        self.open(vec![path]);
        self.is_refused = true;
    }

    /// Returns true if no file is open, missing or being opened.
    pub fn is_empty(&self) -> bool {
        self.import.is_none() && self.missing.is_none() && !self.reading.is_opening()
    }

    /// Closes a recording; without the last one there is no import.
    pub(super) fn close(&mut self, number: usize) {
        let Some(import) = &mut self.import else { return };
        if number == 0 && !import.plan.import.append.is_empty() {
            // The next one takes its place, with the files joined to it.
            let recipe = &mut import.edit().import;
            let next = recipe.append.remove(0);
            recipe.data = next.data;
            for (joined, file) in recipe.join.iter_mut().zip(next.join) {
                joined.file = file;
            }
            return self.read_again();
        }
        let mut paths = import.paths();
        paths.remove(number);
        if paths.is_empty() {
            self.close_all();
        } else {
            self.open_files(Vec::new(), paths);
        }
    }

    /// Closes all files.
    pub(super) fn close_all(&mut self) {
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
        if let Some(opened) = self.reading.next_opened() {
            let is_refused = std::mem::take(&mut self.is_refused);
            match opened {
                // The window has said why it was refused.
                Err(_) if is_refused => {}
                Ok(opened) if is_refused && !matches!(opened, Opened::Missing(_)) => {}
                Ok(opened) => {
                    effects.push(Effect::Settle(Matter::Recording));
                    self.take(opened, shared, effects);
                }
                Err(reason) => effects.push(failed(reason)),
            }
        }
        let run = shared.run.as_ref().map(|run| run.id);
        if run != self.run {
            (self.run, self.shows_columns) = (run, false);
        }
        let settings = &shared.recording.settings;
        self.follow_method(settings);
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
            effects.push(Effect::Import(plan));
        }
    }

    fn take_chosen(&mut self, is_busy: bool, effects: &mut Vec<Effect>) {
        let Some((of, receiver)) = &self.asked else { return };
        let paths = Vec::from_iter(receiver.try_iter().map(|path| absolute(&path)));
        let (Some(path), false) = (paths.first().cloned(), is_busy) else {
            return;
        };
        match (of.clone(), &mut self.import, &self.missing) {
            (Use::Recording, ..) => self.open(paths),
            (Use::Missing(missing), _, Some(reopened)) => {
                let reopened = Reopened::clone(reopened);
                self.take_found(reopened, missing, path);
            }
            (Use::Test, Some(import), _) => {
                let refused = paths.into_iter().filter_map(|path| import.add_test_file(path).err());
                effects.extend(refused.map(failed));
            }
            (Use::Positions, Some(import), _) => import.edit().import.positions = Some(path),
            _ => {}
        }
    }

    fn take(&mut self, opened: Opened, shared: &Shared, effects: &mut Vec<Effect>) {
        let usual = shared.recording.settings.validation_fraction();
        let holding_out = |mut import: Import| {
            import.edit().division.validation_fraction.get_or_insert(usual);
            Some(import)
        };
        match opened {
            Opened::Recordings(import) => {
                let import = import.keeping(self.import.take().unwrap_or_default());
                (self.import, self.missing) = (holding_out(import), None);
                self.show_columns(effects);
            }
            Opened::Plan(import, reopened) => {
                self.close_all();
                (self.import, self.changed) = (holding_out(*import), reopened.changed);
                if reopened.is_recipe {
                    self.show_columns(effects);
                }
                if let Some(checkpoint) = reopened.checkpoint {
                    let setup = Setup::recording(checkpoint.settings, reopened.recorded.plan);
                    effects.push(Effect::TakeUp(Box::new(setup), checkpoint.starts));
                }
            }
            Opened::Missing(reopened) => {
                self.close_all();
                if let Some(checkpoint) = &reopened.checkpoint {
                    take_settings(checkpoint.settings, effects);
                }
                self.missing = Some(reopened);
            }
            Opened::Simulation(source) => {
                let settings = RunSettings {
                    source: (*source).into(),
                    ..shared.draft
                };
                effects.push(Effect::ChooseSource(SourceKind::Array));
                effects.push(Effect::Configure(Box::new(settings)));
            }
            Opened::Network(file, import) => {
                let summary = RunSummary::of(&file);
                let is_listed = shared.runs.workspace.runs.iter().any(|run| *run.summary == summary);
                match import {
                    None => effects.push(Effect::TakeSetup(Box::new(file.setup()))),
                    Some(import) => {
                        self.held_out = None;
                        take_settings(file.settings, effects);
                        match import {
                            Ok(opened) => self.take(*opened, shared, effects),
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

    /// Shows the columns of files that the user has opened.
    fn show_columns(&mut self, effects: &mut Vec<Effect>) {
        self.changed.clear();
        self.shows_columns = true;
        effects.push(Effect::ChooseSource(SourceKind::Recording));
    }

    /// Sets the share held out for validation when another method needs another share, unless the user has set it.
    fn follow_method(&mut self, settings: &RunSettings) {
        let fraction = settings.validation_fraction();
        let is_new = self.held_out.is_some_and(|before| before != fraction) && !self.reading.is_reopening();
        if let (true, Some(import)) = (is_new, &mut self.import) {
            import.edit().division.validation_fraction = Some(fraction);
        }
        self.held_out = Some(fraction);
    }

    /// Selects one network for all rows if no column contains the row numbers.
    fn follow_row_wires(&self, settings: &RunSettings, effects: &mut Vec<Effect>) {
        if settings.source.row_model() == RowModel::Each && !self.has_row_wires() && !self.reading.is_reopening() {
            effects.push(Effect::ConfigureRecording(Box::new(RunSettings {
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
        match (&self.import, self.obstacle()) {
            (None, _) => Err(RecordingDraft::NOTHING_OPEN.to_owned()),
            (Some(_), _) if self.reading.is_opening() => Err("Files are being opened.".to_owned()),
            (Some(_), Some(obstacle)) => Err(obstacle),
            (Some(import), None) => Ok(Arc::clone(&import.plan)),
        }
    }

    /// Returns the reason why there is nothing to train on yet: a text that was refused, or what the plan lacks.
    pub(super) fn obstacle(&self) -> Option<String> {
        let refused = self.typed.values().find_map(|(_, refusal)| refusal.clone());
        refused.or_else(|| self.import.as_ref()?.obstacle())
    }

    /// Returns the numbers of inputs and targets, once there are both.
    pub fn channels(&self) -> Option<(usize, usize)> {
        let import = self.import.as_ref()?;
        let channels = (import.count(Meaning::Input), import.count(Meaning::Target));
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
        shared.source == SourceKind::Recording && (self.shows_columns || shared.shown_run().is_none())
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

fn take_settings(settings: RunSettings, effects: &mut Vec<Effect>) {
    effects.push(Effect::ChooseSource(SourceKind::Recording));
    effects.push(Effect::ConfigureRecording(Box::new(settings)));
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
