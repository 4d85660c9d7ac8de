use std::{path::Path, time::Duration};

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;

use super::{AtomicFile, DocumentError, DocumentKind, document::PROGRAM, sealed::Sealed};
use crate::{
    dataset::Dataset,
    evaluation::{MeasuredSettings, Run, RunError},
    import::{Plan, PlannedSets},
    training::TrainerState,
};

const KIND: DocumentKind = DocumentKind::MeasuredCheckpoint;

/// A run on measured samples saved at some epoch. A resumed run gives bit-identical results.
///
/// The file is JSON. It does not contain the samples but the plan by which they are read again, and checksums (CRC-32) of them and of
/// itself.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredCheckpointFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run, with the method and stopping rules of that epoch.
    pub settings: MeasuredSettings,
    /// Files, meanings of their columns, and division of their samples.
    pub plan: Plan,
    /// Checksum of the samples: [`Self::checksum`].
    pub samples_crc32: String,
    /// Time that all starts together have taken: [`Run::wall_time`].
    pub wall_time: Option<Duration>,
    /// State of every trainer: by start, then, if there is a network for each row-wire, by row.
    pub starts: Vec<TrainerState>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunDocument {
    settings: MeasuredSettings,
    plan: Plan,
    samples_crc32: String,
    wall_time: Option<Duration>,
    starts: Vec<TrainerState>,
}

impl MeasuredCheckpointFile {
    /// Takes the present state of `run`, made by `plan`, on samples with this checksum.
    ///
    /// # Errors
    /// [`DocumentError::Simulated`] if the samples are simulated.
    pub fn from_run(run: &Run, plan: &Plan, samples_crc32: &str) -> Result<Self, DocumentError> {
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: run.settings().measured().ok_or(DocumentError::Simulated(KIND))?,
            plan: plan.clone(),
            samples_crc32: samples_crc32.to_owned(),
            wall_time: run.wall_time(),
            starts: run.states(),
        })
    }

    /// Checksum of samples, from the bits of their readings and targets.
    pub fn checksum(sets: &PlannedSets) -> String {
        let mut hasher = crc32fast::Hasher::new();
        let mut add = |set: &Dataset| {
            for values in [set.readings(), set.targets()] {
                values.iter().for_each(|value| hasher.update(&value.to_le_bytes()));
            }
        };
        add(&sets.recording.set);
        add(&sets.test);
        format!("{:08x}", hasher.finalize())
    }

    /// Resumes the run from this epoch on the samples that its plan has given again.
    ///
    /// # Errors
    /// The settings are impossible, or the states do not fit them or each other.
    pub fn resume(self, sets: PlannedSets) -> Result<Run, RunError> {
        let run = Run::resume_on_sets(self.settings.into(), self.starts, sets.split, sets.test)?;
        Ok(run.with_wall_time(self.wall_time))
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
            plan: self.plan.clone(),
            samples_crc32: self.samples_crc32.clone(),
            wall_time: self.wall_time,
            starts: self.starts.clone(),
        });
        let run = run.map_err(unsound)?;
        // What was written must be readable: a weight that is not finite would be `null`.
        serde_json::from_str::<RunDocument>(run.get()).map_err(unsound)?;
        Ok(Sealed::new(KIND, &self.program, &run).save(path, AtomicFile::commit)?)
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
        let run: RunDocument = serde_json::from_str(sealed.run.get()).map_err(|error| error.to_string())?;
        run.settings
            .training
            .check()
            .map_err(|flaw| format!("settings.training: {flaw}"))?;
        Ok(Self {
            settings: run.settings,
            plan: run.plan,
            samples_crc32: run.samples_crc32,
            wall_time: run.wall_time,
            starts: run.starts,
            program: sealed.program,
        })
    }
}
