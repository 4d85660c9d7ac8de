use std::{path::Path, time::Duration};

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;

use super::{
    AtomicFile, DocumentError, DocumentKind, document::PROGRAM, network_file::settings_defect, unfinished::folder_of,
};
use crate::import::{Progress, Recorded, Setup, SetupError, SetupSets};
use decoupler_core::{
    evaluation::{Run, RunSettings},
    job::Job,
    training::TrainerState,
};

const KIND: DocumentKind = DocumentKind::Checkpoint;

/// A run saved at an epoch. A resumed run gives bit-identical results.
///
/// The file is JSON. It does not contain the samples: those of a simulated array follow from the settings, those of a recording
/// are read again by its plan and recognised by their checksum. Another checksum (CRC-32) detects changes to the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointFile {
    /// Program and version that wrote the file.
    #[serde(skip)]
    pub program: String,
    /// Settings of the run, with the method and stopping rules of that epoch.
    pub settings: RunSettings,
    /// Origin of recorded samples, with absolute paths; `None` for a simulated array.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<Recorded>,
    /// Time that all starts together have taken: [`Run::wall_time`].
    pub wall_time: Option<Duration>,
    /// State of every trainer: by start, then, if there is a network for each row-wire, by row.
    pub starts: Vec<TrainerState>,
}

impl CheckpointFile {
    /// Captures the current state of `run`; `recorded` is the origin of its samples if they are recorded.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and no plan is given.
    pub fn from_run(run: &Run, recorded: Option<&Recorded>) -> Result<Self, DocumentError> {
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: *run.settings(),
            recorded: KIND.recorded_of(run, recorded)?,
            wall_time: run.wall_time(),
            starts: run.states(),
        })
    }

    /// Setup of the run.
    pub fn setup(&self) -> Setup {
        let plan = self.recorded.as_ref().map(|recorded| recorded.plan.clone());
        Setup::of(self.settings, plan).expect("reading and writing check that a recording has its plan")
    }

    /// Resumes the run from this epoch: draws or reads its samples again and restores every trainer. Returns the run and
    /// its samples.
    ///
    /// # Errors
    /// The settings are invalid, the recording has changed or is missing, the states do not fit the settings or each
    /// other, or the job is cancelled.
    pub fn resume(self, job: &Job<'_>, on_progress: &mut dyn FnMut(Progress)) -> Result<(Run, SetupSets), SetupError> {
        let setup = self.setup();
        if self.settings.simulation().is_some() {
            self.settings.check_states(&self.starts)?;
        }
        let mut sets = setup.sets(Path::new(""), job, on_progress)?;
        sets.check_saved(self.recorded.as_ref())?;
        if let (Some(recordings), Some(saved)) = (&mut sets.recordings, self.recorded) {
            recordings.recorded.search = saved.search;
            recordings.recorded.combined = saved.combined;
            recordings.recorded.chosen_intervals = saved.chosen_intervals;
        }
        let run = sets.run(&setup, Some(self.starts), job)?;
        Ok((run.with_wall_time(self.wall_time), sets))
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The run has numbers that JSON cannot hold, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        let unsound = |error: serde_json::Error| DocumentError::Unsound {
            path: path.to_owned(),
            defect: error.to_string(),
        };
        let located = |recorded: &Recorded| recorded.relative_to(folder_of(path));
        let file = Self {
            recorded: self.recorded.as_ref().map(located),
            ..self.clone()
        };
        let contents = to_raw_value(&file).map_err(unsound)?;
        // A weight that is not finite would be written as `null`, which cannot be read back.
        serde_json::from_str::<Self>(contents.get()).map_err(unsound)?;
        Ok(KIND.save(&self.program, &contents, path, AtomicFile::commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (program, mut file): (_, Self) = KIND.load(path)?;
        file.program = program;
        file.recorded = file.recorded.map(|recorded| recorded.within(folder_of(path)));
        match settings_defect(&file.settings, file.recorded.as_ref()) {
            None => Ok(file),
            Some(defect) => Err(KIND.damaged(path, defect)),
        }
    }
}
