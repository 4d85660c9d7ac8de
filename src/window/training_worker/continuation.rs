use decoupler_core::{
    evaluation::{Run, RunError},
    training::{StoppingRules, TrainingError, TrainingSettings},
};

/// Gives `run` more epochs, counted from the start that is furthest. With the method it has, it continues as if they had
/// been given from the beginning; another method, or one that had ended for another reason, starts from the current
/// weights.
///
/// # Errors
/// A setting out of range, or networks too wide for the method; then nothing has changed.
pub fn continue_run(run: &mut Run, training: TrainingSettings) -> Result<(), RunError> {
    training.check().map_err(TrainingError::from)?;
    let stopping = StoppingRules {
        epochs: (furthest_epoch(run) + training.stopping.epochs).min(StoppingRules::MAX_EPOCHS),
        ..training.stopping
    };
    let is_other = training.method != run.settings().training.method;
    if is_other {
        run.continue_with(training.method)?;
    }
    run.set_stopping(stopping).map_err(TrainingError::from)?;
    if !is_other && run.stop_reason().is_some() {
        run.continue_with(training.method)?;
    }
    Ok(())
}

/// The epoch of the start that is furthest.
pub fn furthest_epoch(run: &Run) -> usize {
    let epochs = run.trainers().iter().map(|trainer| trainer.latest().epoch);
    epochs.max().unwrap_or(0)
}
