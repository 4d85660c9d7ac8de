use std::path::Path;

use serde_json::value::to_raw_value;

use super::{
    AtomicFile, DocumentError, DocumentKind,
    document::PROGRAM,
    heading::Heading,
    network_document::{RunDocument, UnsealedDocument},
    sealed::{Commit, Sealed},
    soundness::flaw,
};
use crate::{
    evaluation::{Baselines, Errors, PastNetwork, Run, SimulatedSettings, StartRecord},
    network::Networks,
    training::{EpochRecord, Stage, StopReason},
};

const KIND: DocumentKind = DocumentKind::Network;
/// First version with a checksum, and with the ranges of the readings in training.
const SEALED_VERSION: u64 = 3;

/// A trained network with its settings, the record of its training, and its errors.
/// The file is JSON; a network that is read back gives bit-identical results.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Version of the format in which the file was found, or will be written.
    pub version: u64,
    /// Settings of the run: sensor, scene, samples, method, stopping rules, seed.
    pub settings: SimulatedSettings,
    /// Best network of the training, or best network of each row-wire.
    pub network: Networks,
    /// Record of the training.
    pub training: TrainingRecord,
    /// Errors of the network on the test set.
    pub errors: Errors,
    /// Errors of the baselines on the same test set.
    pub baselines: Baselines,
}

/// Record of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingRecord {
    /// Reason for which training ended; `None` while it runs.
    pub stop_reason: Option<StopReason>,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Training time on one thread in seconds, summed over the networks of all rows.
    pub seconds: f64,
    /// Record of every epoch, from the initial weights on.
    pub history: Vec<EpochRecord>,
    /// Training methods in the order in which they were used.
    pub stages: Vec<Stage>,
    /// All starts of the run, of which the best gave the network. Empty in files of versions that had one start
    /// only, and of the network of a past epoch.
    pub starts: Vec<StartRecord>,
}

impl TrainingRecord {
    /// Takes the record of `run` so far.
    pub(super) fn of(run: &Run) -> Self {
        let trainer = run.leader();
        Self {
            stop_reason: run.stop_reason(),
            best_epoch: trainer.best_epoch(),
            seconds: trainer.elapsed().as_secs_f64(),
            history: trainer.history().to_vec(),
            stages: trainer.stages().to_vec(),
            starts: run.starts(),
        }
    }

    /// Takes the record of the start that led at a past epoch until then.
    fn until(run: &Run, past: &PastNetwork) -> Self {
        let trainer = run.trainers().get(past.start).unwrap_or_else(|| run.leader());
        let epochs = trainer.history().partition_point(|record| record.epoch <= past.epoch);
        let stages = trainer
            .stages()
            .partition_point(|stage| stage.first_epoch <= past.epoch);
        Self {
            stop_reason: Some(StopReason::Stopped),
            best_epoch: past.best_epoch,
            seconds: past.elapsed.as_secs_f64(),
            history: trainer.history()[..epochs].to_vec(),
            stages: trainer.stages()[..stages].to_vec(),
            // How the other starts stood then is not kept.
            starts: Vec::new(),
        }
    }
}

impl NetworkFile {
    /// Takes the best network of `run` so far, with its record and errors.
    ///
    /// # Errors
    /// [`DocumentError::Measured`] if the samples were measured.
    pub fn from_run(run: &Run) -> Result<Self, DocumentError> {
        let simulated = run.settings().simulated().zip(run.node_scores());
        let (settings, scores) = simulated.ok_or(DocumentError::Measured(KIND))?;
        Ok(Self {
            program: PROGRAM.to_owned(),
            version: *KIND.versions().end(),
            settings,
            network: run.network(),
            training: TrainingRecord::of(run),
            errors: scores.network,
            baselines: scores.baselines,
        })
    }

    /// Takes the network that `run` would have kept had it been stopped at a past epoch, with its record until then and its
    /// errors.
    ///
    /// # Errors
    /// [`DocumentError::Measured`] if the samples were measured.
    pub fn from_past(run: &Run, past: &PastNetwork) -> Result<Self, DocumentError> {
        let errors = run.errors_of(&past.networks.decouple(run.test()));
        Ok(Self {
            network: past.networks.clone(),
            training: TrainingRecord::until(run, past),
            errors: errors.ok_or(DocumentError::Measured(KIND))?,
            ..Self::from_run(run)?
        })
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The network has values that could not be read back, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        self.save_by(path, AtomicFile::commit)
    }

    /// As [`Self::save`]; `commit` puts the file in its place.
    pub(super) fn save_by(&self, path: &Path, commit: Commit) -> Result<(), DocumentError> {
        let unsound = |flaw: String| DocumentError::Unsound {
            path: path.to_owned(),
            flaw,
        };
        if let Some(flaw) = flaw(self) {
            return Err(unsound(flaw));
        }
        let run = to_raw_value(&RunDocument::of(self)).map_err(|error| unsound(error.to_string()))?;
        Ok(Sealed::new(KIND, &self.program, &run).save(path, commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (heading, bytes) = KIND.read(path)?;
        Self::parse(path, &heading, &bytes)
    }

    /// Describes the first defect that would keep the file from being read back.
    pub fn flaw(&self) -> Option<String> {
        flaw(self)
    }

    /// Tells what cannot be noticed because an old version of the program wrote the file.
    pub fn old_version_warning(&self) -> Option<String> {
        (self.version < SEALED_VERSION).then(|| {
            format!(
                "the file has version {} of the format, without a checksum and without the range of the readings in \
                 training: neither damage nor readings outside that range are noticed; train again to have both",
                self.version
            )
        })
    }

    /// Reads the file at `path` from its `bytes`.
    pub(super) fn parse(path: &Path, heading: &Heading, bytes: &[u8]) -> Result<Self, DocumentError> {
        let is_sealed = heading.version.as_u64() >= Some(SEALED_VERSION);
        let read = if is_sealed {
            Self::read_sealed(bytes)
        } else {
            Self::read_unsealed(bytes)
        };
        let sound = read.and_then(|file| flaw(&file).map_or(Ok(file), Err));
        sound.map_err(|flaw| KIND.damaged(path, flaw))
    }

    fn read_sealed(bytes: &[u8]) -> Result<Self, String> {
        let Sealed {
            version, program, run, ..
        } = Sealed::read(bytes)?;
        let run: RunDocument = serde_json::from_str(run.get()).map_err(|error| error.to_string())?;
        run.into_file(program, version)
    }

    fn read_unsealed(bytes: &[u8]) -> Result<Self, String> {
        let document: UnsealedDocument = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if !KIND.versions().contains(&document.version) {
            return Err(format!("version: there is no version {}", document.version));
        }
        let (program, version) = (document.program.clone(), document.version);
        RunDocument::from(document).into_file(program, version)
    }
}
