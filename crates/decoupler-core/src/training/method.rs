//! The interface that each training method implements, and the state that it carries from epoch to epoch.
//!
//! To add a method, add it to [`Method`] with its rows in the table of settings, implement [`Algorithm`] in the file of its
//! family or in a new one, and start it in [`Method::start`].

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, Method, StopReason,
    bayesian_regularization::{BayesianRegularization, BayesianState},
    gradient_descent::{AdaptiveState, GradientDescent, ResilientState},
    levenberg_marquardt::LevenbergMarquardt,
    normal_equations::Plan,
    scaled_conjugate_gradient::{ConjugateState, ScaledConjugateGradient},
};
use crate::network::{Mlp, Shape};

/// Training method running on one network.
pub(super) trait Algorithm: Send + Sync {
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

    /// Returns the state for saving.
    fn state(&self) -> MethodState;

    /// Restores the state of an interrupted training of this method.
    fn restore(&mut self, state: MethodState);
}

/// State that a method carries from epoch to epoch in addition to the weights. A training resumed from it gives
/// bit-identical results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodState {
    /// State of [`Method::LevenbergMarquardt`].
    LevenbergMarquardt {
        /// Damping.
        mu: f64,
    },
    /// State of [`Method::BayesianRegularization`].
    BayesianRegularization(BayesianState),
    /// State of [`Method::ScaledConjugateGradient`].
    ScaledConjugateGradient(ConjugateState),
    /// State of [`Method::Resilient`].
    Resilient(ResilientState),
    /// State of [`Method::AdaptiveDescent`].
    AdaptiveDescent(AdaptiveState),
    /// Previous step of [`Method::StepMomentum`].
    StepMomentum(Vec<f64>),
    /// Previous gradient of [`Method::Momentum`].
    Momentum(Vec<f64>),
    /// [`Method::GradientDescent`] has no state.
    GradientDescent,
}

impl MethodState {
    /// Returns `true` if the state has finite values for this many weights.
    pub(super) fn fits(&self, weights: usize) -> bool {
        let vectors = match self {
            Self::LevenbergMarquardt { .. } | Self::BayesianRegularization(_) | Self::GradientDescent => Vec::new(),
            Self::ScaledConjugateGradient(state) => vec![&state.p[..], &state.r],
            Self::Resilient(state) => vec![&state.previous_gradient[..], &state.lengths],
            Self::AdaptiveDescent(state) => vec![&state.step[..]],
            Self::StepMomentum(previous) | Self::Momentum(previous) => vec![&previous[..]],
        };
        let is_finite = |vector: &[f64]| vector.iter().all(|value| value.is_finite());
        vectors
            .into_iter()
            .all(|vector| vector.len() == weights && is_finite(vector))
    }
}

impl Method {
    /// Starts the method from the weights of `mlp`.
    pub(super) fn start(&self, mlp: &Mlp, examples: &Examples) -> (Box<dyn Algorithm>, Evaluation) {
        fn boxed((method, evaluation): (impl Algorithm + 'static, Evaluation)) -> (Box<dyn Algorithm>, Evaluation) {
            (Box::new(method), evaluation)
        }
        match *self {
            Self::LevenbergMarquardt(settings) => boxed(LevenbergMarquardt::new(settings, mlp, examples)),
            Self::BayesianRegularization(settings) => boxed(BayesianRegularization::new(settings, mlp, examples)),
            Self::ScaledConjugateGradient(settings) => boxed(ScaledConjugateGradient::new(settings, mlp, examples)),
            _ => boxed(GradientDescent::new(*self, mlp, examples)),
        }
    }

    /// Approximate memory in bytes of the method's equations for a network of this shape and this many samples.
    pub fn equations_bytes(&self, shape: Shape, samples: usize) -> usize {
        match self {
            Self::LevenbergMarquardt(_) => Plan::cheapest(shape, samples).bytes(),
            Self::BayesianRegularization(_) => {
                let plan = Plan::factored(shape, samples);
                plan.bytes().saturating_add(plan.inverse_bytes())
            }
            _ => 0,
        }
    }

    /// Approximate number of multiplications per epoch for a network of this shape and this many samples.
    pub fn epoch_multiplications(&self, shape: Shape, samples: usize) -> f64 {
        let per_run = samples as f64 * shape.weights() as f64;
        match self {
            Self::LevenbergMarquardt(_) => Plan::cheapest(shape, samples).multiplications(),
            Self::BayesianRegularization(_) => {
                let plan = Plan::factored(shape, samples);
                plan.multiplications() + plan.trace_multiplications()
            }
            // Two evaluations of error and gradient: one for the curvature, one after the step.
            Self::ScaledConjugateGradient(_) => 4.0 * per_run,
            // One run of the network over the samples, and the gradient.
            _ => 3.0 * per_run,
        }
    }
}

/// Sets `candidate` to the weights of `mlp` plus `step`.
pub(super) fn add_step(candidate: &mut Mlp, mlp: &Mlp, step: &[f64]) {
    let weights = candidate.weights_mut().iter_mut().zip(mlp.weights()).zip(step);
    for ((candidate, weight), step) in weights {
        *candidate = weight + step;
    }
}
