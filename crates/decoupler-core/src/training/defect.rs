//! Defects of a training that has ended.

use std::fmt;

use super::{EpochRecord, Method, StopReason, Trainer};

/// Defect of a training that has ended: what happened, and what to change. Its text says both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingDefect {
    /// Epoch in which the error grew above that of the start and stayed there, if it did.
    pub diverged_in: Option<usize>,
    /// True if the best network is hardly better than the random start: [`TrainingDefect::MIN_GAIN`].
    pub is_at_start: bool,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Number of epochs run.
    pub epochs: usize,
    /// Reason why the training ended.
    pub reason: StopReason,
    /// The method with its settings.
    pub method: Method,
}

impl TrainingDefect {
    /// Share by which the error that decides (validation, or training where nothing is held out) must fall below that of
    /// the start for the network to count as trained.
    pub const MIN_GAIN: f64 = 0.01;

    /// Finds the defect of a training; `None` for a sound one and for one that has not ended.
    pub fn of(trainer: &Trainer) -> Option<Self> {
        let reason = trainer.stop_reason()?;
        let start = trainer.history().first()?;
        let start_mse = start.validation_mse.unwrap_or(start.training_mse);
        let enough = (1.0 - Self::MIN_GAIN) * start_mse;
        let defect = Self {
            diverged_in: diverged_in(trainer.history(), reason),
            // False for a start without any error, which nothing can improve; true for one that is not a number.
            is_at_start: start_mse != 0.0 && (trainer.best_mse() >= enough || enough.is_nan()),
            best_epoch: trainer.best_epoch(),
            epochs: trainer.latest().epoch,
            reason,
            method: trainer.settings().method,
        };
        (defect.diverged_in.is_some() || defect.is_at_start).then_some(defect)
    }

    /// Returns the setting to change, in words.
    pub fn cure(&self) -> String {
        match self.reason {
            StopReason::GoalReached => "set a lower goal".to_owned(),
            StopReason::GradientSmall if self.diverged_in.is_none() => {
                format!("set a lower smallest gradient; or {}", self.method.cure())
            }
            StopReason::Stopped if self.diverged_in.is_none() => "let it run longer".to_owned(),
            _ => self.method.cure(),
        }
    }
}

/// First epoch of those at the end whose training error is above that of the start; an epoch that ended in no number is
/// not in the history.
fn diverged_in(history: &[EpochRecord], reason: StopReason) -> Option<usize> {
    let start_mse = history.first()?.training_mse;
    let is_below = |record: &EpochRecord| record.training_mse <= start_mse;
    let after = history.iter().rposition(is_below).map_or(0, |last| last + 1);
    (after < history.len() || reason == StopReason::Diverged).then_some(after)
}

impl fmt::Display for TrainingDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { epochs, best_epoch, .. } = self;
        match (self.diverged_in, self.is_at_start) {
            (Some(epoch), true) => write!(
                f,
                "training diverged in epoch {epoch}, and the network is no better than its random start"
            )?,
            (Some(epoch), false) => write!(
                f,
                "training diverged in epoch {epoch}; the network is the best before that, of epoch {best_epoch}"
            )?,
            (None, _) => write!(
                f,
                "the network is no better than its random start after {epochs} epochs ({})",
                self.reason
            )?,
        }
        write!(f, ": {}", self.cure())
    }
}
