use std::{path::Path, time::Duration};

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;

use super::{AtomicFile, DocumentError, DocumentKind, document::PROGRAM, sealed::Sealed, soundness::settings_flaw};
use crate::{
    evaluation::{Run, RunError, SimulatedSettings},
    training::TrainerState,
};

const KIND: DocumentKind = DocumentKind::Checkpoint;

/// A run saved at some epoch. A resumed run gives bit-identical results.
///
/// The file is JSON. It does not contain the samples, which follow from the settings. A checksum (CRC-32) detects
/// changes.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run, with the method and stopping rules of that epoch.
    pub settings: SimulatedSettings,
    /// Time that all starts together have taken: [`Run::wall_time`].
    pub wall_time: Option<Duration>,
    /// State of every trainer: by start, then, if rows are known, by row.
    pub starts: Vec<TrainerState>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunDocument {
    settings: SimulatedSettings,
    #[serde(default)]
    wall_time: Option<Duration>,
    starts: Vec<TrainerState>,
}

impl CheckpointFile {
    /// Takes the present state of `run`.
    ///
    /// # Errors
    /// [`DocumentError::Measured`] if the samples were measured.
    pub fn from_run(run: &Run) -> Result<Self, DocumentError> {
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: run.settings().simulated().ok_or(DocumentError::Measured(KIND))?,
            wall_time: run.wall_time(),
            starts: run.states(),
        })
    }

    /// Resumes the run from this epoch: draws its samples again and restores every trainer.
    ///
    /// # Errors
    /// The settings are impossible, or the states do not fit them or each other.
    pub fn resume(self) -> Result<Run, RunError> {
        let run = Run::resume(self.settings, self.starts)?;
        Ok(run.with_wall_time(self.wall_time))
    }

    /// As [`Self::resume`]; returns `None` once `is_cancelled`, which is called between the parts of the work.
    #[cfg(feature = "gui")]
    pub(crate) fn resume_unless(self, is_cancelled: &dyn Fn() -> bool) -> Result<Option<Run>, RunError> {
        let run = Run::resume_unless(self.settings, self.starts, is_cancelled)?;
        Ok(run.map(|run| run.with_wall_time(self.wall_time)))
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The run has numbers that JSON cannot hold, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        let unsound = |error: serde_json::Error| DocumentError::Unsound {
            path: path.to_owned(),
            flaw: error.to_string(),
        };
        let run = to_raw_value(&RunDocument {
            settings: self.settings,
            wall_time: self.wall_time,
            starts: self.starts.clone(),
        });
        let run = run.map_err(unsound)?;
        // What was written must be readable: a weight that is not finite would be `null`.
        serde_json::from_str::<RunDocument>(run.get()).map_err(unsound)?;
        let sealed = Sealed::new(KIND, &self.program, &run);
        Ok(sealed.save(path, AtomicFile::commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (_, bytes) = KIND.read(path)?;
        Self::parse(&bytes).map_err(|flaw| KIND.damaged(path, flaw))
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let sealed = Sealed::read(bytes)?;
        if !KIND.versions().contains(&sealed.version) {
            return Err(format!("there is no version {}", sealed.version));
        }
        let run: RunDocument = serde_json::from_str(sealed.run.get()).map_err(|error| error.to_string())?;
        match settings_flaw(&run.settings) {
            Some(flaw) => Err(flaw),
            None => Ok(Self {
                program: sealed.program,
                settings: run.settings,
                wall_time: run.wall_time,
                starts: run.starts,
            }),
        }
    }
}
