//! Layouts of the network file, which change less than what the program makes of them.

use serde::{Deserialize, Serialize};

use super::{NetworkFile, TrainingRecord};
use crate::{
    evaluation::{Baselines, Errors, SimulatedSettings, StartRecord},
    network::Networks,
    training::{History, Stage, StopReason},
};

/// The record of a run, the part of the file that the checksum covers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunDocument {
    settings: SimulatedSettings,
    network: Networks,
    training: TrainingDocument,
    errors: Errors,
    baselines: Baselines,
}

/// Layout of the versions without checksum.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnsealedDocument {
    #[serde(rename = "format")]
    _format: String,
    pub(super) version: u64,
    pub(super) program: String,
    settings: SimulatedSettings,
    network: Networks,
    training: TrainingDocument,
    errors: Errors,
    baselines: Baselines,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrainingDocument {
    stop_reason: Option<StopReason>,
    best_epoch: usize,
    epochs: usize,
    seconds: f64,
    history: History,
    #[serde(default)]
    stages: Vec<Stage>,
    #[serde(default)]
    starts: Vec<StartRecord>,
}

impl From<UnsealedDocument> for RunDocument {
    fn from(document: UnsealedDocument) -> Self {
        Self {
            settings: document.settings,
            network: document.network,
            training: document.training,
            errors: document.errors,
            baselines: document.baselines,
        }
    }
}

impl RunDocument {
    pub(super) fn of(file: &NetworkFile) -> Self {
        let NetworkFile {
            program: _,
            version: _,
            settings,
            network,
            training,
            errors,
            baselines,
        } = file.clone();
        Self {
            settings,
            network,
            training: TrainingDocument::of(training),
            errors,
            baselines,
        }
    }

    /// Joins it with the heading.
    ///
    /// # Errors
    /// A description of the first number that contradicts another.
    pub(super) fn into_file(self, program: String, version: u64) -> Result<NetworkFile, String> {
        Ok(NetworkFile {
            program,
            version,
            settings: self.settings,
            network: self.network,
            training: self.training.into_record()?,
            errors: self.errors,
            baselines: self.baselines,
        })
    }
}

impl TrainingDocument {
    pub(super) fn of(training: TrainingRecord) -> Self {
        Self {
            stop_reason: training.stop_reason,
            best_epoch: training.best_epoch,
            epochs: training.history.last().map_or(0, |record| record.epoch),
            seconds: training.seconds,
            history: History(training.history),
            stages: training.stages,
            starts: training.starts,
        }
    }

    /// Returns the record.
    ///
    /// # Errors
    /// A description of the number of epochs that contradicts the history.
    pub(super) fn into_record(self) -> Result<TrainingRecord, String> {
        let (epochs, last) = (self.epochs, self.history.0.last().map_or(0, |record| record.epoch));
        if epochs != last {
            return Err(format!(
                "training.epochs: it is {epochs}, but the history ends with epoch {last}"
            ));
        }
        Ok(TrainingRecord {
            stop_reason: self.stop_reason,
            best_epoch: self.best_epoch,
            seconds: self.seconds,
            history: self.history.0,
            stages: self.stages,
            starts: self.starts,
        })
    }
}
