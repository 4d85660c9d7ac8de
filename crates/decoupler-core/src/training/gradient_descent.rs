//! Gradient descent:
//! - conventional back-propagation (`traingd`),
//! - with momentum of gradients, Eq. (11) of the paper,
//! - with momentum of steps (`traingdm`),
//! - with momentum and an adaptive learning rate (`traingdx`),
//! - resilient back-propagation (`trainrp`).

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, Method, StopReason,
    activations::Backpropagation,
    method::{Algorithm, MethodState},
};
use crate::network::Mlp;

/// Method whose steps follow from the gradient g of the mean squared error over all samples, and from the last step or
/// gradient.
///
/// - Conventional back-propagation, Eq. (5)-(10), in batch form: `v(N+1) = v(N) − α g(N)`. Eq. (8)-(9) are written for a
///   sigmoid; the derivative of our layers is 1 − h² for the tanh nodes and 1 for the linear outputs.
/// - Momentum of gradients, Eq. (11) of the paper: `v(N+1) = v(N) − α[(1−η) g(N) + η g(N−1)]`. In the first step
///   g(N−1) = g(N).
/// - Momentum of steps (Rumelhart, Hinton and Williams 1986; `traingdm`): `dX = mc·dXprev − lr·(1 − mc)·g`; dXprev is 0
///   before the first step.
/// - Adaptive learning rate (Vogl et al. 1988; `traingdx`), with the same step. If it lowers the error, lr grows by the
///   factor `rate_increase`. If it raises the error by more than the factor `largest_error_increase`, it is rejected:
///   the weights stay, lr shrinks by the factor `rate_decrease`, and dXprev of the next epoch is `−lr·g` with the
///   reduced lr (0 if that overflows). (The reference manual prints `lr·mc·gX` in the step; we use 1 − mc, as in
///   `traingdm`.)
/// - Resilient back-propagation (Riedmiller and Braun 1993; `trainrp`): each weight has its own step length, and only
///   the sign of its slope is used. The length grows while the sign stays the same and shrinks when it changes; no step
///   is rejected.
pub(super) struct GradientDescent {
    method: Method,
    state: MethodState,
    now: Evaluation,
    /// Gradient at the current weights.
    gradient: Vec<f64>,
    /// Gradient at the candidate.
    backpropagation: Backpropagation,
    candidate: Mlp,
}

/// State of gradient descent with an adaptive learning rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveState {
    learning_rate: f64,
    /// The previous step, with an entry for each weight.
    pub(super) step: Vec<f64>,
}

/// State of resilient back-propagation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResilientState {
    /// Gradient of the previous epoch.
    pub(super) previous_gradient: Vec<f64>,
    /// Step length of each weight.
    pub(super) lengths: Vec<f64>,
}

/// Largest learning rate, which keeps a long run of accepted steps from overflowing.
const MAX_RATE: f64 = 1e300;

impl GradientDescent {
    /// Starts `method`, one of those listed above.
    pub(super) fn new(method: Method, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let zeros = vec![0.0; mlp.weights().len()];
        let mut state = match method {
            Method::Momentum(_) => MethodState::Momentum(zeros),
            Method::StepMomentum(_) => MethodState::StepMomentum(zeros),
            Method::AdaptiveDescent(settings) => MethodState::AdaptiveDescent(AdaptiveState {
                learning_rate: settings.learning_rate,
                step: zeros,
            }),
            Method::Resilient(settings) => MethodState::Resilient(ResilientState {
                lengths: vec![settings.first_length; zeros.len()],
                previous_gradient: zeros,
            }),
            _ => MethodState::GradientDescent,
        };
        let now = backpropagation.evaluate(mlp, examples);
        let gradient = backpropagation.gradient.clone();
        if let MethodState::Momentum(previous) = &mut state {
            previous.copy_from_slice(&gradient);
        }
        let method = Self {
            method,
            state,
            now,
            gradient,
            backpropagation,
            candidate: mlp.clone(),
        };
        (method, now)
    }

    /// Adds the step of each weight to the candidate, which is at the current weights.
    fn move_candidate(&mut self) {
        let weights = self.candidate.weights_mut().iter_mut().zip(&self.gradient);
        match (self.method, &mut self.state) {
            (Method::GradientDescent { learning_rate }, _) => {
                weights.for_each(|(weight, slope)| *weight -= learning_rate * slope);
            }
            (Method::Momentum(settings), MethodState::Momentum(previous)) => {
                let (rate, momentum) = (settings.learning_rate, settings.momentum);
                for ((weight, slope), previous) in weights.zip(previous) {
                    *weight -= rate * ((1.0 - momentum) * slope + momentum * *previous);
                    *previous = *slope;
                }
            }
            (Method::StepMomentum(settings), MethodState::StepMomentum(previous)) => {
                add_momentum(weights, previous, settings.learning_rate, settings.momentum);
            }
            (Method::AdaptiveDescent(settings), MethodState::AdaptiveDescent(state)) => {
                add_momentum(weights, &mut state.step, state.learning_rate, settings.momentum);
            }
            (Method::Resilient(settings), MethodState::Resilient(state)) => {
                let lengths = state.lengths.iter_mut().zip(&mut state.previous_gradient);
                for ((weight, slope), (length, before)) in weights.zip(lengths) {
                    // Compares signs, since the product of two tiny slopes would be 0.
                    let factor = match (*slope > 0.0, *slope < 0.0, *before > 0.0, *before < 0.0) {
                        (true, _, true, _) | (_, true, _, true) => settings.length_increase,
                        (true, _, _, true) | (_, true, true, _) => settings.length_decrease,
                        _ => 1.0,
                    };
                    *length = (*length * factor).min(settings.largest_length);
                    if *slope != 0.0 {
                        *weight -= length.copysign(*slope);
                    }
                    *before = *slope;
                }
            }
            _ => {}
        }
    }
}

/// Adds `momentum` times the previous step and the rest of a step down the gradient to each weight.
fn add_momentum<'a>(
    weights: impl Iterator<Item = (&'a mut f64, &'a f64)>,
    steps: &mut [f64],
    rate: f64,
    momentum: f64,
) {
    for ((weight, slope), step) in weights.zip(steps) {
        *step = momentum * *step - rate * (1.0 - momentum) * slope;
        *weight += *step;
    }
}

impl Algorithm for GradientDescent {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        self.candidate.weights_mut().copy_from_slice(mlp.weights());
        self.move_candidate();
        let then = self.backpropagation.evaluate(&self.candidate, examples);
        if let (Method::AdaptiveDescent(settings), MethodState::AdaptiveDescent(state)) = (self.method, &mut self.state)
        {
            let bearable = then.mse <= settings.largest_error_increase * self.now.mse;
            if !bearable || then.if_finite().is_err() {
                state.learning_rate *= settings.rate_decrease;
                for (step, slope) in state.step.iter_mut().zip(&self.gradient) {
                    let next = -state.learning_rate * slope;
                    *step = if next.is_finite() { next } else { 0.0 };
                }
                return Ok(self.now);
            }
            if then.mse < self.now.mse {
                state.learning_rate = (state.learning_rate * settings.rate_increase).min(MAX_RATE);
            }
        }
        std::mem::swap(mlp, &mut self.candidate);
        std::mem::swap(&mut self.gradient, &mut self.backpropagation.gradient);
        self.now = then;
        then.if_finite()
    }

    /// Returns the learning rate, or the mean step length of resilient back-propagation.
    fn parameter(&self) -> f64 {
        match (&self.state, self.method) {
            (MethodState::AdaptiveDescent(state), _) => state.learning_rate,
            (MethodState::Resilient(state), _) => state.lengths.iter().sum::<f64>() / state.lengths.len() as f64,
            (_, Method::GradientDescent { learning_rate }) => learning_rate,
            (_, Method::Momentum(settings) | Method::StepMomentum(settings)) => settings.learning_rate,
            _ => f64::NAN,
        }
    }

    fn state(&self) -> MethodState {
        self.state.clone()
    }

    fn restore(&mut self, state: MethodState) {
        self.state = state;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::{
        AdaptiveSettings, MomentumSettings,
        examples::tests::{random_examples, random_mlp},
    };

    fn start(method: Method, mlp: &Mlp, examples: &Examples) -> (GradientDescent, Evaluation) {
        GradientDescent::new(method, mlp, examples)
    }

    fn adaptive(learning_rate: f64) -> Method {
        Method::AdaptiveDescent(AdaptiveSettings {
            learning_rate,
            momentum: 0.9,
            rate_increase: 1.05,
            rate_decrease: 0.7,
            largest_error_increase: 1.04,
        })
    }

    #[test]
    fn steps_follow_equation_11() {
        let (mut mlp, examples) = (random_mlp(3, 2, 2, 1), random_examples(50, 3, 2, 2));
        let gradient = |mlp: &Mlp| {
            let mut backpropagation = Backpropagation::new(mlp);
            backpropagation.evaluate(mlp, &examples);
            backpropagation.gradient
        };
        let of_gradients = Method::Momentum(MomentumSettings {
            learning_rate: 0.1,
            momentum: 0.7,
        });
        let mut method = start(of_gradients, &mlp, &examples).0;
        let (start, g0) = (mlp.weights().to_vec(), gradient(&mlp));
        method.step(&mut mlp, &examples).unwrap();
        let (first, g1) = (mlp.weights().to_vec(), gradient(&mlp));
        method.step(&mut mlp, &examples).unwrap();
        for k in 0..start.len() {
            assert!((first[k] - (start[k] - 0.1 * g0[k])).abs() < 1e-15);
            assert!((mlp.weights()[k] - (first[k] - 0.1 * (0.3 * g1[k] + 0.7 * g0[k]))).abs() < 1e-15);
        }
    }

    #[test]
    fn a_rate_far_too_large_shrinks_until_steps_are_accepted_and_then_adapts() {
        let (mut mlp, examples) = (random_mlp(3, 4, 2, 1), random_examples(50, 3, 2, 2));
        let (mut method, start) = start(adaptive(1e12), &mlp, &examples);
        let before = mlp.clone();
        assert_eq!(method.step(&mut mlp, &examples), Ok(start));
        assert_eq!((&mlp, method.parameter()), (&before, 0.7e12));
        let last = (0..500)
            .map(|_| method.step(&mut mlp, &examples).unwrap())
            .last()
            .unwrap();
        assert!(last.mse < start.mse, "{last:?}");
    }

    /// `traingdx` keeps `lr·gX` with the reduced rate as the previous step for the momentum.
    #[test]
    fn after_a_rejected_step_momentum_uses_the_gradient_at_the_reduced_rate() {
        let (mut mlp, examples) = (random_mlp(3, 4, 2, 1), random_examples(50, 3, 2, 2));
        let (mut method, start) = start(adaptive(1e3), &mlp, &examples);
        let gradient = method.gradient.clone();
        assert_eq!(method.step(&mut mlp, &examples), Ok(start), "the step is rejected");
        let MethodState::AdaptiveDescent(state) = method.state() else {
            panic!("another method");
        };
        for (step, slope) in state.step.iter().zip(&gradient) {
            assert_eq!(*step, -700.0 * slope);
        }
    }
}
