use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, StopReason, adaptive_descent::AdaptiveState, bayesian_regularization::BayesianState,
    scaled_conjugate_gradient::ConjugateState, variable_projection::ProjectionState,
};
use crate::network::Mlp;

/// A method at work.
pub(super) trait Algorithm: Send + Sync {
    /// Moves `mlp` by one epoch.
    ///
    /// # Errors
    /// Why there is no further epoch; `mlp` may then be anywhere.
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason>;

    /// What [`super::EpochRecord::parameter`] records.
    fn parameter(&self) -> f64;

    /// The number of weights that the data determine, for a method that estimates it.
    fn effective_parameters(&self) -> Option<f64> {
        None
    }

    /// What it remembers from epoch to epoch.
    fn state(&self) -> MethodState;
}

/// What a method remembers from epoch to epoch, beside the weights: with it a training continues as if it had never
/// been interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodState {
    /// Nothing.
    GradientDescent,
    /// The gradient before the present one.
    Momentum(Vec<f64>),
    /// The last step.
    StepMomentum(Vec<f64>),
    /// Learning rate and last step.
    AdaptiveDescent(AdaptiveState),
    /// The gradient before the present one, and each weight's step length.
    Resilient {
        /// The gradient before the present one.
        previous_gradient: Vec<f64>,
        /// Each weight's step length.
        lengths: Vec<f64>,
    },
    /// Direction, residual and scale.
    ScaledConjugateGradient(ConjugateState),
    /// The damping.
    LevenbergMarquardt {
        /// The damping.
        mu: f64,
    },
    /// Damping and the weighing of error against weights.
    BayesianRegularization(BayesianState),
    /// Damping, and whether the output layer was solved for.
    VariableProjection(ProjectionState),
}

impl MethodState {
    /// Whether it is a state for this many weights, of finite numbers.
    pub(super) fn fits(&self, weights: usize) -> bool {
        let vectors: &[&[f64]] = match self {
            Self::GradientDescent
            | Self::LevenbergMarquardt { .. }
            | Self::BayesianRegularization(_)
            | Self::VariableProjection(_) => &[],
            Self::Momentum(vector) | Self::StepMomentum(vector) => &[vector],
            Self::AdaptiveDescent(state) => &[&state.step],
            Self::Resilient {
                previous_gradient,
                lengths,
            } => &[previous_gradient, lengths],
            Self::ScaledConjugateGradient(state) => &[&state.p, &state.r],
        };
        let fits = |vector: &&[f64]| vector.len() == weights && vector.iter().all(|value| value.is_finite());
        vectors.iter().all(fits)
    }
}

/// Puts `candidate` one step from `mlp`; weights beyond the end of `step` stay those of `mlp`.
pub(super) fn place(candidate: &mut Mlp, mlp: &Mlp, step: &[f64]) {
    let candidate = candidate.weights_mut();
    candidate.copy_from_slice(mlp.weights());
    for (weight, step) in candidate.iter_mut().zip(step) {
        *weight += step;
    }
}
