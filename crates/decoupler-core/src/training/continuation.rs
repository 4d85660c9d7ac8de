//! Continuing a training with another method or other stopping rules.

use std::time::Instant;

use super::{Method, SettingError, Stage, StopReason, StoppingRules, Trainer, TrainingError, trainer::check_width};

impl Trainer {
    /// Continues from the current weights with another method (momentum first, Levenberg-Marquardt to finish), even if the
    /// training has ended, unless because all epochs were run. Epochs keep counting; the count of validation failures
    /// restarts from 0, but the best validation error so far remains the one to beat.
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

    /// Checks that [`Self::continue_with`] would accept this method.
    ///
    /// # Errors
    /// Those of [`Self::continue_with`].
    pub fn check_method(&self, method: &Method) -> Result<(), TrainingError> {
        method.check()?;
        check_width(method, self.mlp.shape(), self.problem.training.samples(), 1)
    }

    /// Replaces the stopping rules. A training that the new rules would not have ended at its present epoch continues, for
    /// instance with more epochs; one that they would have ended, ends.
    ///
    /// # Errors
    /// A setting out of range; then nothing has changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        stopping.check()?;
        if stopping == self.settings.stopping {
            return Ok(());
        }
        self.settings.stopping = stopping;
        if self.stop_reason.is_none_or(StopReason::depends_on_rules) {
            let latest = *self.latest();
            self.stop_reason = self.reason_to_stop(&latest);
        }
        Ok(())
    }
}
