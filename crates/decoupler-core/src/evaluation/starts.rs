use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    network::Mlp,
    training::{EpochRecord, Stage, StopReason, Trainer, for_each_part},
};

/// Result of one start of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartRecord {
    /// Training error (mse, scaled) of the best network.
    pub train_mse: f64,
    /// Validation error (mse, scaled) of the best network, if samples were held out.
    pub validation_mse: Option<f64>,
    /// AveZerr of the best network on the test set of an array, in percent; never used for selection.
    pub z_percent: Option<f64>,
    /// Mean absolute error of the best network on the test set of a recording, in percent of the range; never used for
    /// selection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub percent_of_range: Option<f64>,
    /// Number of epochs run.
    pub epochs: usize,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Reason for stopping; `None` while running.
    pub stop_reason: Option<StopReason>,
}

impl StartRecord {
    /// Returns the error in percent on the test set: [`TestErrors::percent`](super::TestErrors::percent).
    pub fn percent(&self) -> Option<f64> {
        self.z_percent.or(self.percent_of_range)
    }

    /// Returns the error by which the best start is selected: on the validation set, or on the training set if
    /// nothing is held out.
    pub fn deciding_mse(&self) -> f64 {
        self.validation_mse.unwrap_or(self.train_mse)
    }
}

/// Returns the index of the best start, from 0: the first with the lowest selection error.
pub fn best_start(starts: &[StartRecord]) -> Option<usize> {
    lowest(starts.iter().map(StartRecord::deciding_mse))
}

/// Returns the index of the first of the lowest errors.
pub(super) fn lowest(errors: impl IntoIterator<Item = f64>) -> Option<usize> {
    let numbered = errors.into_iter().enumerate();
    numbered
        .min_by(|(_, one), (_, other)| one.total_cmp(other))
        .map(|(place, _)| place)
}

/// Trainings of one start: one shared by all row-wires, or one per row-wire if the row is known, in parallel.
///
/// Values for several trainings are their means, epoch by epoch; a training that has ended keeps its last values.
pub struct StartTrainer {
    pub(super) rows: Vec<Trainer>,
    /// History averaged over all rows.
    history: Vec<EpochRecord>,
}

impl StartTrainer {
    /// Combines the trainings of one start.
    ///
    /// # Panics
    /// If `rows` is empty.
    pub(super) fn new(rows: Vec<Trainer>) -> Self {
        assert!(!rows.is_empty());
        let mut joined = Self {
            rows,
            history: Vec::new(),
        };
        joined.extend_history(0);
        joined
    }

    /// Returns the training of each row-wire, or the shared training.
    pub fn rows(&self) -> &[Trainer] {
        &self.rows
    }

    /// Runs one epoch of every training that has not ended.
    pub(super) fn step(&mut self) {
        let next = |trainer: &Trainer| trainer.stop_reason().is_none().then(|| trainer.history().len());
        let first_new = self.rows.iter().filter_map(next).min();
        for_each_part(&mut self.rows, |trainer| {
            trainer.step();
        });
        if let Some(first_new) = first_new {
            self.extend_history(first_new);
        }
    }

    fn extend_history(&mut self, from: usize) {
        let epochs = self.rows.iter().map(|trainer| trainer.history().len()).max();
        self.history.truncate(from);
        for epoch in self.history.len()..epochs.unwrap_or(0) {
            let at = |trainer: &Trainer| *trainer.history().get(epoch).unwrap_or(trainer.latest());
            let records: Vec<EpochRecord> = self.rows.iter().map(at).collect();
            self.history.push(mean_record(epoch, &records));
        }
    }

    /// Returns the reason for stopping once all trainings have ended: [`StopReason::Stopped`] if the user stopped any
    /// before its end, otherwise that of the longest training.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons: Vec<_> = self.rows.iter().map(Trainer::stop_reason).collect::<Option<_>>()?;
        if reasons.contains(&StopReason::Stopped) {
            return Some(StopReason::Stopped);
        }
        self.longest().stop_reason()
    }

    /// Returns the first training with the most epochs.
    fn longest(&self) -> &Trainer {
        let epochs = |trainer: &&Trainer| trainer.history().len();
        let last = self.rows.iter().rev().max_by_key(epochs);
        last.expect("a start has trainings")
    }

    /// Returns the records of all epochs so far, beginning with the initialisation.
    pub fn history(&self) -> &[EpochRecord] {
        &self.history
    }

    /// Returns the record of the latest epoch.
    pub fn latest(&self) -> &EpochRecord {
        self.history()
            .last()
            .expect("the start is recorded when the trainer is created")
    }

    /// Epoch of the best network; the latest one if there are several networks.
    pub fn best_epoch(&self) -> usize {
        self.rows.iter().map(Trainer::best_epoch).max().unwrap_or(0)
    }

    /// Mean error of the best networks on the validation set, or on the training set if nothing is held out.
    pub fn best_mse(&self) -> f64 {
        mean(self.rows.iter().map(Trainer::best_mse))
    }

    /// Returns the best network of each row-wire, or the shared network.
    pub fn best(&self) -> impl Iterator<Item = &Mlp> {
        self.rows.iter().map(Trainer::best)
    }

    /// Returns the mean of the records of the trainings at their best epochs.
    pub(super) fn best_records(&self) -> EpochRecord {
        let best = |trainer: &Trainer| trainer.history()[trainer.best_epoch()];
        let records: Vec<EpochRecord> = self.rows.iter().map(best).collect();
        mean_record(self.best_epoch(), &records)
    }

    /// Returns the methods used so far, in order.
    pub fn stages(&self) -> &[Stage] {
        self.longest().stages()
    }

    /// Training time summed over all rows, without pauses.
    pub fn elapsed(&self) -> Duration {
        let times = self.rows.iter().map(Trainer::elapsed);
        times.fold(Duration::ZERO, Duration::saturating_add)
    }

    /// Total number of weights in all networks.
    pub fn weights(&self) -> usize {
        self.rows.iter().map(|trainer| trainer.present().weights().len()).sum()
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// Averages the errors of several records; a single record is returned unchanged.
fn mean_record(epoch: usize, records: &[EpochRecord]) -> EpochRecord {
    let of = |value: fn(&EpochRecord) -> f64| mean(records.iter().map(value));
    let of_known = |value: fn(&EpochRecord) -> Option<f64>| {
        let values: Vec<f64> = records.iter().map(value).collect::<Option<_>>()?;
        Some(mean(values.into_iter()))
    };
    EpochRecord {
        epoch,
        training_mse: of(|record| record.training_mse),
        validation_mse: of_known(|record| record.validation_mse),
        test_mse: of_known(|record| record.test_mse),
        gradient_norm: of(|record| record.gradient_norm),
        parameter: of(|record| record.parameter),
        effective_parameters: of_known(|record| record.effective_parameters),
        validation_failures: records
            .iter()
            .map(|record| record.validation_failures)
            .max()
            .unwrap_or(0),
    }
}
