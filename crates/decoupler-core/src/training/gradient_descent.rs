//! Gradient descent:
//! - conventional back-propagation (`traingd`),
//! - with momentum of gradients, Eq. (11) of the paper,
//! - with momentum of steps (`traingdm`),
//! - with momentum and an adaptive learning rate (`traingdx`),
//! - resilient back-propagation (`trainrp`).

use serde::{Deserialize, Serialize};

use super::{
    AdaptiveDescentSettings, Evaluation, Examples, ResilientSettings, StopReason,
    activations::Backpropagation,
    method::{Algorithm, MethodState},
};
use crate::network::Mlp;

/// What a step of gradient descent mixes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mixed {
    /// Nothing: conventional back-propagation of the paper, Eq. (5)-(10), in batch form: `v(N+1) = v(N) + α g(N)`, where
    /// g is the negative gradient of the mean squared error over all samples. Eq. (8)-(9) are written for a sigmoid; the
    /// derivative of our layers is 1 − h² for the tanh nodes and 1 for the linear outputs.
    Nothing,
    /// The previous **gradient**, Eq. (11) of the paper: `v(N+1) = v(N) + α[(1−η) g(N) + η g(N−1)]`. In the first step
    /// g(N−1) = g(N).
    Gradient,
    /// The previous **step** (Rumelhart, Hinton and Williams 1986; `traingdm`): `dX = mc·dXprev + lr·(1 − mc)·g`; dXprev
    /// is 0 before the first step.
    Step,
}

/// Gradient descent with a fixed learning rate.
pub(super) struct GradientDescent {
    mixed: Mixed,
    learning_rate: f64,
    /// Share of the previous gradient or step; 0 if nothing is mixed in.
    momentum: f64,
    backpropagation: Backpropagation,
    /// Previous gradient or step.
    previous: Vec<f64>,
}

impl GradientDescent {
    pub(super) fn new(
        mixed: Mixed,
        learning_rate: f64,
        momentum: f64,
        mlp: &Mlp,
        examples: &Examples,
    ) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let mut previous = backpropagation.gradient.clone();
        if mixed == Mixed::Step {
            previous.fill(0.0);
        }
        let method = Self {
            mixed,
            learning_rate,
            momentum,
            backpropagation,
            previous,
        };
        (method, evaluation)
    }
}

impl Algorithm for GradientDescent {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let (rate, momentum) = (self.learning_rate, self.momentum);
        let slopes = self.backpropagation.gradient.iter().zip(&mut self.previous);
        for (weight, (slope, previous)) in mlp.weights_mut().iter_mut().zip(slopes) {
            if self.mixed == Mixed::Step {
                *previous = momentum * *previous - rate * (1.0 - momentum) * slope;
                *weight += *previous;
            } else {
                *weight -= rate * ((1.0 - momentum) * slope + momentum * *previous);
                *previous = *slope;
            }
        }
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    fn parameter(&self) -> f64 {
        self.learning_rate
    }

    fn state(&self) -> MethodState {
        match self.mixed {
            Mixed::Nothing => MethodState::GradientDescent,
            Mixed::Gradient => MethodState::Momentum(self.previous.clone()),
            Mixed::Step => MethodState::StepMomentum(self.previous.clone()),
        }
    }

    fn restore(&mut self, state: MethodState) -> bool {
        match (self.mixed, state) {
            (Mixed::Nothing, MethodState::GradientDescent) => {}
            (Mixed::Gradient, MethodState::Momentum(previous)) | (Mixed::Step, MethodState::StepMomentum(previous)) => {
                self.previous = previous;
            }
            _ => return false,
        }
        true
    }
}

/// Largest learning rate, which keeps a long run of accepted steps from overflowing.
const MAX_RATE: f64 = 1e300;

/// Gradient descent with momentum and an adaptive learning rate (Vogl et al. 1988; `traingdx`). With gX the negative
/// gradient, each epoch tries
///
/// ```text
/// dX = mc·dXprev + lr·(1 − mc)·gX
/// ```
///
/// If the step lowers the error, lr grows by the factor `rate_increase`. If it raises the error by more than the factor
/// `largest_error_increase`, it is rejected: the weights stay, lr shrinks by the factor `rate_decrease`, and dXprev of
/// the next epoch is `lr·gX` with the reduced lr (0 if that overflows). Before the first epoch dXprev is 0. (The
/// reference manual prints `lr·mc·gX` in the step; we use 1 − mc, as in `traingdm`.)
pub(super) struct AdaptiveDescent {
    settings: AdaptiveDescentSettings,
    state: AdaptiveState,
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
    step: Vec<f64>,
}

impl AdaptiveState {
    /// The previous step, with an entry for each weight.
    pub(super) fn step(&self) -> &[f64] {
        &self.step
    }
}

impl AdaptiveDescent {
    pub(super) fn new(settings: AdaptiveDescentSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let now = backpropagation.evaluate(mlp, examples);
        let method = Self {
            settings,
            state: AdaptiveState {
                learning_rate: settings.learning_rate,
                step: vec![0.0; mlp.weights().len()],
            },
            now,
            gradient: backpropagation.gradient.clone(),
            backpropagation,
            candidate: mlp.clone(),
        };
        (method, now)
    }
}

impl Algorithm for AdaptiveDescent {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let AdaptiveState { learning_rate, step } = &mut self.state;
        let momentum = self.settings.momentum;
        for (index, step) in step.iter_mut().enumerate() {
            *step = momentum * *step - *learning_rate * (1.0 - momentum) * self.gradient[index];
            self.candidate.weights_mut()[index] = mlp.weights()[index] + *step;
        }
        let then = self.backpropagation.evaluate(&self.candidate, examples);
        let bearable = then.mse <= self.settings.largest_error_increase * self.now.mse;
        if bearable && then.if_finite().is_ok() {
            if then.mse < self.now.mse {
                *learning_rate = (*learning_rate * self.settings.rate_increase).min(MAX_RATE);
            }
            std::mem::swap(mlp, &mut self.candidate);
            std::mem::swap(&mut self.gradient, &mut self.backpropagation.gradient);
            self.now = then;
        } else {
            *learning_rate *= self.settings.rate_decrease;
            for (step, slope) in step.iter_mut().zip(&self.gradient) {
                let next = -*learning_rate * slope;
                *step = if next.is_finite() { next } else { 0.0 };
            }
        }
        Ok(self.now)
    }

    fn parameter(&self) -> f64 {
        self.state.learning_rate
    }

    fn state(&self) -> MethodState {
        MethodState::AdaptiveDescent(self.state.clone())
    }

    fn restore(&mut self, state: MethodState) -> bool {
        let MethodState::AdaptiveDescent(state) = state else {
            return false;
        };
        self.state = state;
        true
    }
}

/// Resilient back-propagation (Riedmiller and Braun 1993; `trainrp`): each weight has its own step length, and only the
/// sign of its slope is used. The length grows while the sign stays the same and shrinks when it changes; no step is
/// rejected.
pub(super) struct Resilient {
    settings: ResilientSettings,
    backpropagation: Backpropagation,
    state: ResilientState,
}

/// State of resilient back-propagation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResilientState {
    /// Gradient of the previous epoch.
    previous_gradient: Vec<f64>,
    /// Step length of each weight.
    lengths: Vec<f64>,
}

impl ResilientState {
    /// Vectors with an entry for each weight.
    pub(super) fn vectors(&self) -> [&[f64]; 2] {
        [&self.previous_gradient, &self.lengths]
    }
}

impl Resilient {
    pub(super) fn new(settings: ResilientSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let weights = mlp.weights().len();
        let method = Self {
            settings,
            backpropagation,
            state: ResilientState {
                previous_gradient: vec![0.0; weights],
                lengths: vec![settings.first_length; weights],
            },
        };
        (method, evaluation)
    }
}

impl Algorithm for Resilient {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let settings = self.settings;
        for (index, weight) in mlp.weights_mut().iter_mut().enumerate() {
            let (now, before) = (
                self.backpropagation.gradient[index],
                self.state.previous_gradient[index],
            );
            // Compares signs, since the product of two tiny slopes would be 0.
            let factor = match (now > 0.0, now < 0.0, before > 0.0, before < 0.0) {
                (true, _, true, _) | (_, true, _, true) => settings.length_increase,
                (true, _, _, true) | (_, true, true, _) => settings.length_decrease,
                _ => 1.0,
            };
            let length = (self.state.lengths[index] * factor).min(settings.largest_length);
            self.state.lengths[index] = length;
            if now != 0.0 {
                *weight -= length.copysign(now);
            }
        }
        self.state
            .previous_gradient
            .copy_from_slice(&self.backpropagation.gradient);
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    /// Returns the mean step length.
    fn parameter(&self) -> f64 {
        self.state.lengths.iter().sum::<f64>() / self.state.lengths.len() as f64
    }

    fn state(&self) -> MethodState {
        MethodState::Resilient(self.state.clone())
    }

    fn restore(&mut self, state: MethodState) -> bool {
        let MethodState::Resilient(state) = state else {
            return false;
        };
        self.state = state;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    #[test]
    fn a_step_is_the_learning_rate_times_the_negative_gradient() {
        let (mut mlp, examples) = (random_mlp(3, 2, 2, 1), random_examples(50, 3, 2, 2));
        let start = mlp.clone();
        let mut backpropagation = Backpropagation::new(&mlp);
        backpropagation.evaluate(&mlp, &examples);
        let (mut method, _) = GradientDescent::new(Mixed::Nothing, 0.5, 0.0, &mlp, &examples);
        method.step(&mut mlp, &examples).unwrap();
        for ((moved, weight), slope) in mlp.weights().iter().zip(start.weights()).zip(&backpropagation.gradient) {
            assert_eq!(*moved, weight - 0.5 * slope);
        }
    }

    #[test]
    fn steps_follow_equation_11() {
        let (mut mlp, examples) = (random_mlp(3, 2, 2, 1), random_examples(50, 3, 2, 2));
        let gradient = |mlp: &Mlp| {
            let mut backpropagation = Backpropagation::new(mlp);
            backpropagation.evaluate(mlp, &examples);
            backpropagation.gradient
        };
        let (mut method, _) = GradientDescent::new(Mixed::Gradient, 0.1, 0.7, &mlp, &examples);
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
        let settings = AdaptiveDescentSettings {
            learning_rate: 1e12,
            ..AdaptiveDescentSettings::default()
        };
        let (mut method, start) = AdaptiveDescent::new(settings, &mlp, &examples);
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
        let settings = AdaptiveDescentSettings {
            learning_rate: 1e3,
            ..AdaptiveDescentSettings::default()
        };
        let (mut method, start) = AdaptiveDescent::new(settings, &mlp, &examples);
        let gradient = method.gradient.clone();
        assert_eq!(method.step(&mut mlp, &examples), Ok(start), "the step is rejected");
        for (step, slope) in method.state.step.iter().zip(&gradient) {
            assert_eq!(*step, -700.0 * slope);
        }
    }
}
