//! The interface of a training method: each method's file implements it, and [`super::Method`] lists the methods.

use super::{Evaluation, Examples, SettingError, StopReason, setting::Settings};
use crate::network::{Mlp, Shape};

/// A training method at work on one network.
pub(super) trait Algorithm: Sized + Send + Sync {
    /// Settings, chosen before training.
    type Settings: Settings;
    /// Everything that is carried from epoch to epoch next to the weights.
    type State;

    /// Name and description for menus, tables and the terminal.
    const DESCRIPTION: Description;

    /// The field's usual settings.
    fn default_settings() -> Self::Settings {
        Self::Settings::default()
    }

    /// Checks settings against each other, each being in its own range.
    ///
    /// # Errors
    /// Two settings that contradict each other.
    fn check(_settings: &Self::Settings) -> Result<(), SettingError> {
        Ok(())
    }

    /// About how many bytes the method's equations take for a network of this shape and this many samples.
    fn equations_bytes(_shape: Shape, _samples: usize) -> usize {
        0
    }

    /// About how many multiplications an epoch takes: one run of the network over the samples and the gradient.
    fn epoch_multiplications(shape: Shape, samples: usize) -> f64 {
        3.0 * samples as f64 * shape.weights() as f64
    }

    /// Starts from the weights of `mlp`.
    fn new(settings: Self::Settings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation);

    /// Restores the state of an interrupted training.
    fn restore(&mut self, state: Self::State);

    /// Moves `mlp` by one epoch.
    ///
    /// # Errors
    /// The reason why there is no further epoch; the weights of `mlp` are then unspecified.
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason>;

    /// Value recorded as [`super::EpochRecord::parameter`].
    fn parameter(&self) -> f64;

    /// Number of weights that the data determine, for a method that estimates it.
    fn effective_parameters(&self) -> Option<f64> {
        None
    }

    /// The state, to be saved.
    fn state(&self) -> Self::State;
}

/// Name and description of a method.
pub(super) struct Description {
    /// Name in the terminal and in tables.
    pub(super) short_name: &'static str,
    pub(super) name: &'static str,
    /// One sentence.
    pub(super) summary: &'static str,
    /// Name of [`Algorithm::parameter`].
    pub(super) parameter_name: &'static str,
    /// Cure for a training that diverged or did not lower the error; completes "to repair it, …".
    pub(super) cure: &'static str,
}

/// State of a method, as read from a file.
pub(super) trait Checked {
    /// Vectors with one entry for each weight.
    fn vectors(&self) -> Vec<&[f64]>;
}

impl Checked for Vec<f64> {
    fn vectors(&self) -> Vec<&[f64]> {
        vec![self]
    }
}

/// Sets `candidate` to the weights of `mlp` plus `step`; weights beyond the end of `step` are those of `mlp`.
pub(super) fn add_step(candidate: &mut Mlp, mlp: &Mlp, step: &[f64]) {
    let candidate = candidate.weights_mut();
    candidate.copy_from_slice(mlp.weights());
    for (weight, step) in candidate.iter_mut().zip(step) {
        *weight += step;
    }
}
