use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
};

use super::{
    draft::{Draft, file_name},
    files_section::Reopened,
    opening::{Checking, Files, Opened, Opening, ToOpen},
};
use crate::window::{
    job::Wake,
    shared::{Effect, FileInUse, FileTask, FileWords, Matter, Notice, RecordingDraft, Shared, SourceKind},
    training_worker::RunId,
};
use decoupler_core::{
    evaluation::{RunSettings, Source, TrainingSize},
    scene::RowModel,
};
use decoupler_files::{
    export::{NetworkFile, RunSummary},
    import::{Meaning, Plan, Setup},
};

/// Editor of the recording that is trained on: its files, the meaning of their columns, and the division of the samples.
///
/// It reports the plan of the import by [`Effect::Import`] whenever that changes.
#[derive(Debug)]
pub struct RecordingEditor {
    /// The import, once files are open.
    pub(super) draft: Option<Draft>,
    /// An import with missing files.
    pub(super) missing: Option<Box<Reopened>>,
    /// Names of files that have changed since the run with this import.
    pub(super) changed: Vec<String>,
    pub(super) opening: Opening,
    pub(super) checking: Checking,
    /// Paths of recordings that the user chooses, in dialogs or by typing.
    pub(super) recordings: ChosenPaths,
    /// Paths of files of test samples.
    pub(super) tests: ChosenPaths,
    /// Paths of files with positions of targets.
    pub(super) positions: ChosenPaths,
    /// Missing file to be found, and the path that the user chooses.
    pub(super) finding: Option<(PathBuf, ChosenPaths)>,
    /// True if the user is viewing the columns while there is a run to show.
    pub(super) shows_columns: bool,
    /// The run that the window knew last.
    run: Option<RunId>,
    /// Share held out for validation that the method needs; `None` if the share of a plan is to be kept.
    held_out: Option<f64>,
}

/// Paths that the user chooses for one purpose.
#[derive(Debug)]
pub(super) struct ChosenPaths {
    sender: Sender<PathBuf>,
    receiver: Receiver<PathBuf>,
}

impl Default for ChosenPaths {
    fn default() -> Self {
        let (sender, receiver) = channel();
        Self { sender, receiver }
    }
}

impl ChosenPaths {
    /// Returns the task of asking for a path.
    pub(super) fn task(&self, words: FileWords, suggestion: String) -> FileTask {
        FileTask::choose(words, suggestion, self.sender.clone())
    }

    fn take(&self) -> Vec<PathBuf> {
        self.receiver.try_iter().collect()
    }
}

impl RecordingEditor {
    /// Nothing open yet. `wake` is called when there are events.
    pub fn new(wake: &Wake) -> Self {
        Self {
            draft: None,
            missing: None,
            changed: Vec::new(),
            opening: Opening::new(Arc::clone(wake)),
            checking: Checking::new(Arc::clone(wake)),
            recordings: ChosenPaths::default(),
            tests: ChosenPaths::default(),
            positions: ChosenPaths::default(),
            finding: None,
            shows_columns: false,
            run: None,
            held_out: None,
        }
    }

    /// Opens files: recordings are added to those that are open; a recipe, a network or a checkpoint takes their place.
    pub fn open(&mut self, paths: Vec<PathBuf>) {
        if let (Some(missing), [path]) = (&self.missing, &paths[..]) {
            let is_it = |missing: &&Path| missing.file_name() == path.file_name();
            if let Some(found) = missing.missing().into_iter().find(is_it).map(Path::to_owned) {
                return self.take_found(found, path.clone());
            }
        }
        let open = self.draft.as_ref().map(Draft::paths).unwrap_or_default();
        self.open_with(paths, open);
    }

    /// Opens the files of `plan`, whose paths are absolute, unless they are open.
    pub fn open_plan(&mut self, plan: &Plan) {
        self.held_out = None;
        let is_open = self.planned().is_some_and(|planned| *planned == *plan);
        let is_missing = self
            .missing
            .as_ref()
            .is_some_and(|missing| missing.recorded.plan == *plan);
        if !is_open && !is_missing {
            let reopened = Box::new(Reopened::from(plan.clone()));
            self.opening.start(ToOpen::Import(reopened));
        } else if self.opening.is_reopening {
            self.opening.cancel();
        }
    }

    /// Checks the recordings of the checkpoint at `path`, which could not be resumed: they may be missing.
    pub fn look_for_recordings(&mut self, path: PathBuf) {
        self.opening.start(ToOpen::Missing(path));
    }

    /// Returns true if no file is open, missing or being opened.
    pub fn is_empty(&self) -> bool {
        self.draft.is_none() && self.missing.is_none() && self.opening.under_way.is_none()
    }

    /// Opens the sample recording, which is written into `folder`.
    pub(super) fn open_sample(&mut self, folder: PathBuf) {
        self.opening.start(ToOpen::Sample(folder));
    }

    /// Opens the file at `found` in the place of a missing one.
    pub(super) fn take_found(&mut self, missing: PathBuf, found: PathBuf) {
        if let Some(reopened) = self.missing.clone() {
            self.opening.start(ToOpen::Found(reopened, missing, found));
        }
    }

    /// Closes a recording; without the last one there is no import.
    pub(super) fn close(&mut self, file: usize) {
        let Some(draft) = &mut self.draft else { return };
        let mut paths = draft.paths();
        paths.remove(file);
        let append = &mut draft.plan.import.append;
        if file == 0 && !append.is_empty() {
            paths = append.remove(0).files().cloned().collect();
        } else if let Some(joined) = file.checked_sub(1) {
            append.iter_mut().for_each(|set| drop(set.join.remove(joined)));
        }
        if paths.is_empty() {
            self.close_all();
        } else {
            self.open_with(Vec::new(), paths);
        }
    }

    /// Closes all files.
    pub(super) fn close_all(&mut self) {
        self.opening.cancel();
        (self.draft, self.missing, self.finding) = (None, None, None);
        self.changed.clear();
    }

    /// Reads the files again, with the layout and the missing cells of the draft.
    pub(super) fn read_again(&mut self) {
        if let Some(draft) = &self.draft {
            self.open_with(Vec::new(), draft.paths());
        }
    }

    fn open_with(&mut self, new: Vec<PathBuf>, open: Vec<PathBuf>) {
        let older = self.draft.clone().map(Box::new);
        self.opening.start(ToOpen::Files(Files { new, open, older }));
    }

    /// Takes events of the threads and paths chosen, and reports the plan if it has changed.
    pub fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.take_chosen(shared.phase.is_busy(), effects);
        if let Some(opened) = self.opening.next_opened() {
            match opened {
                Ok(opened) => {
                    effects.push(Effect::Settle(Matter::Recording));
                    self.take(opened, shared, effects);
                }
                Err(reason) => effects.push(failed(&reason)),
            }
        }
        let run = shared.run.as_ref().map(|run| run.id);
        if run != self.run {
            (self.run, self.shows_columns) = (run, false);
        }
        self.follow_method(&shared.recording.settings);
        let plan = self.plan();
        // Training needs the processor.
        if !shared.phase.is_busy() {
            if plan.is_ok() {
                self.follow_row_wires(&shared.recording.settings, effects);
            }
            self.checking.follow(plan.clone().ok(), shared.recording.settings.seed);
        }
        if !self.opening.is_reopening && plan != shared.recording.plan {
            effects.push(Effect::Import(plan));
        }
    }

    fn take_chosen(&mut self, is_busy: bool, effects: &mut Vec<Effect>) {
        let (recordings, tests) = (self.recordings.take(), self.tests.take());
        let positions = self.positions.take().pop();
        let found = self.finding.as_ref();
        let found = found.and_then(|(missing, paths)| Some((missing.clone(), paths.take().pop()?)));
        if is_busy {
            return;
        }
        if !recordings.is_empty() {
            self.open(recordings);
        }
        if let Some((missing, found)) = found {
            self.take_found(missing, found);
        }
        let Some(draft) = &mut self.draft else { return };
        let refused = tests.into_iter().filter_map(|path| draft.add_test_file(path).err());
        effects.extend(refused.map(|reason| failed(&reason)));
        if positions.is_some() {
            draft.plan.import.positions = positions;
        }
    }

    fn take(&mut self, opened: Opened, shared: &Shared, effects: &mut Vec<Effect>) {
        match opened {
            Opened::Recordings(draft) => {
                let draft = match &self.draft {
                    Some(older) => draft.keeping(older),
                    None => draft.holding_out(shared.recording.settings.validation_fraction()),
                };
                self.show_import(draft, effects);
            }
            Opened::Positions(path) => {
                if let Some(draft) = &mut self.draft {
                    draft.plan.import.positions = Some(path);
                }
            }
            Opened::Recipe(draft) => {
                let usual = shared.recording.settings.validation_fraction();
                self.show_import(draft.holding_out(usual), effects);
            }
            Opened::Simulation(source) => {
                let settings = RunSettings {
                    source: (*source).into(),
                    ..shared.draft
                };
                effects.push(Effect::ChooseSource(SourceKind::Array));
                effects.push(Effect::Configure(Box::new(settings)));
            }
            Opened::Import(draft, reopened) => {
                self.close_all();
                self.draft = Some(draft.holding_out(shared.recording.settings.validation_fraction()));
                self.changed = reopened.changed;
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
            Opened::Network(file, import) => self.take_network(*file, import, shared, effects),
            Opened::Checkpoint(path) => effects.push(Effect::OpenTraining(path)),
            Opened::Nothing => {}
        }
    }

    /// Shows the columns of files that the user has opened.
    fn show_import(&mut self, draft: Draft, effects: &mut Vec<Effect>) {
        (self.draft, self.missing) = (Some(draft), None);
        self.changed.clear();
        self.shows_columns = true;
        effects.push(Effect::ChooseSource(SourceKind::Recording));
    }

    fn take_network(
        &mut self,
        file: NetworkFile,
        import: Option<Result<Box<Opened>, String>>,
        shared: &Shared,
        effects: &mut Vec<Effect>,
    ) {
        let summary = RunSummary::of(&file);
        let is_listed = shared.runs.workspace.runs.iter().any(|run| *run.summary == summary);
        match import {
            None => effects.push(Effect::TakeSetup(Box::new(file.setup()))),
            Some(import) => {
                self.held_out = None;
                take_settings(file.settings, effects);
                match import {
                    Ok(opened) => self.take(*opened, shared, effects),
                    Err(reason) => effects.push(failed(&reason)),
                }
            }
        }
        let text = format!(
            "The settings of {} are set. Its run is listed in Compare.",
            file.source_name()
        );
        effects.push(Effect::Notify(Matter::Recording, Notice::Done(text)));
        if !is_listed {
            effects.push(Effect::KeepRun(Box::new(file)));
        }
    }

    /// Sets the share held out for validation when another method needs another share, unless the user has set it.
    fn follow_method(&mut self, settings: &RunSettings) {
        let fraction = settings.validation_fraction();
        let is_new = self.held_out.is_some_and(|before| before != fraction) && !self.opening.is_reopening;
        if let (true, Some(draft)) = (is_new, &mut self.draft) {
            draft.plan.division.validation_fraction = Some(fraction);
        }
        self.held_out = Some(fraction);
    }

    /// Selects one network for all rows if no column contains the row numbers.
    fn follow_row_wires(&self, settings: &RunSettings, effects: &mut Vec<Effect>) {
        if settings.source.row_model() == RowModel::Each && !self.has_row_wires() && !self.opening.is_reopening {
            effects.push(Effect::ConfigureRecording(Box::new(RunSettings {
                source: Source::Measured { rows: RowModel::Shared },
                ..*settings
            })));
        }
    }

    /// Returns the plan of the import, or what is missing and what to do.
    fn plan(&self) -> Result<Arc<Plan>, String> {
        if let Some(missing) = self
            .missing
            .as_ref()
            .and_then(|missing| missing.missing().first().copied())
        {
            return Err(format!(
                "{} is missing: find it under “Files”, or open another recording.",
                file_name(missing)
            ));
        }
        match &self.draft {
            None => Err(RecordingDraft::NOTHING_OPEN.to_owned()),
            Some(_) if self.opening.under_way.is_some() => Err("Files are being opened.".to_owned()),
            Some(draft) => match draft.obstacle() {
                Some(obstacle) => Err(obstacle),
                None => draft.planned(),
            },
        }
    }

    /// Returns the plan of the import, if it is complete.
    pub(super) fn planned(&self) -> Option<Arc<Plan>> {
        self.draft.as_ref()?.planned().ok()
    }

    /// Returns the numbers of inputs and targets, once there are both.
    pub fn channels(&self) -> Option<(usize, usize)> {
        let draft = self.draft.as_ref()?;
        let channels = (draft.count(Meaning::Input), draft.count(Meaning::Target));
        (channels.0 > 0 && channels.1 > 0).then_some(channels)
    }

    /// Returns the size of a training with one network, once the import is checked.
    pub fn training_size(&self, settings: &RunSettings) -> Option<TrainingSize> {
        let checked = self.checking.checked.as_ref()?.as_ref().ok()?;
        let (inputs, targets) = checked.channels;
        let is_shared = settings.source.row_model() == RowModel::Shared;
        is_shared.then_some(TrainingSize {
            samples: checked.samples[0],
            inputs,
            targets,
            networks: 1,
        })
    }

    /// Returns true if a column contains the row numbers.
    pub fn has_row_wires(&self) -> bool {
        self.draft.as_ref().is_some_and(|draft| draft.has(Meaning::RowWire))
    }

    /// Returns true if the columns take the place of the results in the middle of the view.
    pub fn is_on_show(&self, shared: &Shared) -> bool {
        shared.source == SourceKind::Recording && (self.shows_columns || shared.shown_run().is_none())
    }

    /// Returns the files of the import, which must not be overwritten.
    pub fn files_in_use(&self) -> Vec<FileInUse> {
        let plan = self.planned();
        let files = plan.iter().flat_map(|plan| plan.files());
        let paths = self.draft.iter().flat_map(Draft::paths);
        files.chain(paths).map(FileInUse::Recording).collect()
    }
}

pub(super) fn failed(reason: &str) -> Effect {
    Effect::Notify(Matter::Recording, Notice::Failed(reason.to_owned()))
}

fn take_settings(settings: RunSettings, effects: &mut Vec<Effect>) {
    effects.push(Effect::ChooseSource(SourceKind::Recording));
    effects.push(Effect::ConfigureRecording(Box::new(settings)));
}
