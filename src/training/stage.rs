use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::{Method, SettingError, StopReason, StoppingRules, Trainer, TrainingError, trainer::check_width};

/// A part of a training under one method; [`super::Trainer::continue_with`] begins the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// The first epoch under this method; 0 for the first stage.
    pub first_epoch: usize,
    /// The method and its settings.
    pub method: Method,
}

impl Trainer {
    /// Goes on from the present weights with another method (momentum first, Levenberg-Marquardt to finish), also after
    /// the training has ended, unless it ended because all epochs were run. Epochs go on counting.
    ///
    /// # Errors
    /// A setting out of range, or a network too wide for the method; then nothing has changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), TrainingError> {
        self.check_method(&method)?;
        let begun = Instant::now();
        let first_epoch = self.latest().epoch + 1;
        self.stages.retain(|stage| stage.first_epoch < first_epoch);
        self.stages.push(Stage { first_epoch, method });
        self.settings.method = method;
        (self.algorithm, _) = method.start(&self.mlp, &self.problem.training);
        self.validation_failures = 0;
        let all_run = self.latest().epoch >= self.settings.stopping.epochs;
        self.stop_reason = all_run.then_some(StopReason::EpochsReached);
        self.elapsed += begun.elapsed();
        Ok(())
    }

    /// Whether [`Self::continue_with`] would take this method.
    ///
    /// # Errors
    /// What it would say.
    pub fn check_method(&self, method: &Method) -> Result<(), TrainingError> {
        method.check()?;
        check_width(method, self.mlp.shape(), self.problem.training.samples())
    }

    /// Changes when to stop. A training that these rules would not have ended where it stands goes on, say with more
    /// epochs; one that they would have ended, ends.
    ///
    /// # Errors
    /// A setting out of range; then nothing has changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        stopping.check()?;
        if stopping == self.settings.stopping {
            return Ok(());
        }
        self.settings.stopping = stopping;
        let by_rule = !matches!(
            self.stop_reason,
            Some(StopReason::Stopped | StopReason::Diverged | StopReason::MuLarge)
        );
        if by_rule {
            let latest = *self.latest();
            self.stop_reason = self.reason_to_stop(&latest);
        }
        Ok(())
    }
}
