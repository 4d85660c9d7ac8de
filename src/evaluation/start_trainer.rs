use std::time::Duration;

use rayon::prelude::*;

use crate::{
    network::Mlp,
    training::{
        EpochRecord, Method, SettingError, Stage, StopReason, StoppingRules, Trainer, TrainerState, TrainingError,
    },
};

/// The trainings of one start: one for all row-wires, or one for each where the row is known, side by side.
///
/// What is told of several of them together, epoch by epoch, is their mean; a training that has ended stays as it is.
pub struct StartTrainer {
    rows: Vec<Trainer>,
    /// Of all rows together; empty where there is one training, whose own history it is.
    history: Vec<EpochRecord>,
}

impl StartTrainer {
    /// Joins the trainings of a start.
    ///
    /// # Panics
    /// If there is none.
    pub(super) fn new(rows: Vec<Trainer>) -> Self {
        assert!(!rows.is_empty());
        let mut joined = Self {
            rows,
            history: Vec::new(),
        };
        joined.rebuild_history(0);
        joined
    }

    /// The training of each row-wire, or the one for all.
    pub fn rows(&self) -> &[Trainer] {
        &self.rows
    }

    /// Runs one epoch of every training that has not ended. Returns why they have ended, once all have.
    pub(super) fn step(&mut self) -> Option<StopReason> {
        // Stays on this thread, which saves handing it over each epoch.
        if let [only] = self.rows.as_mut_slice() {
            return only.step();
        }
        let next = |trainer: &Trainer| trainer.stop_reason().is_none().then(|| trainer.history().len());
        let first_new = self.rows.iter().filter_map(next).min();
        self.rows.par_iter_mut().for_each(|trainer| {
            trainer.step();
        });
        if let Some(first_new) = first_new {
            self.rebuild_history(first_new);
        }
        self.stop_reason()
    }

    fn rebuild_history(&mut self, from: usize) {
        if self.rows.len() == 1 {
            return;
        }
        let epochs = self.rows.iter().map(|trainer| trainer.history().len()).max();
        self.history.truncate(from);
        for epoch in self.history.len()..epochs.unwrap_or(0) {
            let at = |trainer: &Trainer| *trainer.history().get(epoch).unwrap_or(trainer.latest());
            let records: Vec<EpochRecord> = self.rows.iter().map(at).collect();
            self.history.push(mean_record(epoch, &records));
        }
    }

    pub(super) fn stop(&mut self) {
        self.rows.iter_mut().for_each(Trainer::stop);
    }

    /// Why they have ended, once all have: the user's wish if any could have gone on, or else the reason of the one
    /// that ran longest.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons: Vec<_> = self.rows.iter().map(Trainer::stop_reason).collect::<Option<_>>()?;
        if reasons.contains(&StopReason::Stopped) {
            return Some(StopReason::Stopped);
        }
        self.longest().stop_reason()
    }

    /// The first of those with the most epochs.
    fn longest(&self) -> &Trainer {
        let mut longest = &self.rows[0];
        for trainer in &self.rows[1..] {
            if trainer.history().len() > longest.history().len() {
                longest = trainer;
            }
        }
        longest
    }

    pub(super) fn continue_with(&mut self, method: Method) -> Result<(), TrainingError> {
        // They may differ in inputs, so each is asked before any is changed.
        for trainer in &self.rows {
            trainer.check_method(&method)?;
        }
        self.rows
            .iter_mut()
            .try_for_each(|trainer| trainer.continue_with(method))
    }

    pub(super) fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        // All have the same rules, so the first is refused or none.
        self.rows
            .iter_mut()
            .try_for_each(|trainer| trainer.set_stopping(stopping))
    }

    pub(super) fn states(&self) -> impl Iterator<Item = TrainerState> + '_ {
        self.rows.iter().map(Trainer::state)
    }

    /// Every epoch so far, the start first.
    pub fn history(&self) -> &[EpochRecord] {
        match &self.rows[..] {
            [only] => only.history(),
            _ => &self.history,
        }
    }

    /// The latest epoch.
    pub fn latest(&self) -> &EpochRecord {
        self.history()
            .last()
            .expect("the start is recorded when the trainer is made")
    }

    /// The epoch of the best network; of several, the latest of their best.
    pub fn best_epoch(&self) -> usize {
        self.rows.iter().map(Trainer::best_epoch).max().unwrap_or(0)
    }

    /// The error of the best networks, their mean: on the validation set, or on the training set where nothing is held
    /// out.
    pub fn best_mse(&self) -> f64 {
        mean(self.rows.iter().map(Trainer::best_mse))
    }

    /// The best network of each row-wire, or the one for all.
    pub fn best(&self) -> impl Iterator<Item = &Mlp> {
        self.rows.iter().map(Trainer::best)
    }

    /// The record of each training at its best.
    pub(super) fn best_records(&self) -> EpochRecord {
        let best = |trainer: &Trainer| trainer.history()[trainer.best_epoch()];
        let records: Vec<EpochRecord> = self.rows.iter().map(best).collect();
        mean_record(self.best_epoch(), &records)
    }

    /// The methods so far, the first one first.
    pub fn stages(&self) -> &[Stage] {
        self.longest().stages()
    }

    /// Time spent in training, pauses not counted; of all rows together.
    pub fn elapsed(&self) -> Duration {
        self.rows.iter().map(Trainer::elapsed).sum()
    }

    /// Weights of all networks.
    pub fn weights(&self) -> usize {
        self.rows.iter().map(|trainer| trainer.present().weights().len()).sum()
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// Several records as one, whose errors are their means. One stays as it is, bit by bit.
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
