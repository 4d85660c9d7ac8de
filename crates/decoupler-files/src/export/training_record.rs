use serde::{Deserialize, Serialize};

use decoupler_core::{
    evaluation::{PastNetwork, Run, StartRecord},
    training::{EpochRecord, History, Stage, StopReason},
};

/// Record of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Document", into = "Document")]
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
    /// All starts of the run, of which the best gave the network. Empty for the network of a past epoch.
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
    pub(super) fn until(run: &Run, past: &PastNetwork) -> Self {
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
            // The states of the other starts at that epoch are not kept.
            starts: Vec::new(),
        }
    }

    /// Number of epochs run.
    pub fn epochs(&self) -> usize {
        self.history.last().map_or(0, |record| record.epoch)
    }
}

/// Layout of the record in files.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    stop_reason: Option<StopReason>,
    best_epoch: usize,
    epochs: usize,
    seconds: f64,
    history: History,
    stages: Vec<Stage>,
    starts: Vec<StartRecord>,
}

impl From<TrainingRecord> for Document {
    fn from(record: TrainingRecord) -> Self {
        Self {
            stop_reason: record.stop_reason,
            best_epoch: record.best_epoch,
            epochs: record.epochs(),
            seconds: record.seconds,
            history: History(record.history),
            stages: record.stages,
            starts: record.starts,
        }
    }
}

impl TryFrom<Document> for TrainingRecord {
    type Error = String;

    fn try_from(document: Document) -> Result<Self, String> {
        let record = Self {
            stop_reason: document.stop_reason,
            best_epoch: document.best_epoch,
            seconds: document.seconds,
            history: document.history.0,
            stages: document.stages,
            starts: document.starts,
        };
        let (epochs, last) = (document.epochs, record.epochs());
        if epochs == last {
            Ok(record)
        } else {
            Err(format!(
                "training.epochs: it is {epochs}, but the history ends with epoch {last}"
            ))
        }
    }
}
