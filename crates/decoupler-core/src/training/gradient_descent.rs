//! Gradient descent:
//! - conventional back-propagation (`traingd`),
//! - with momentum of gradients, Eq. (11) of the paper,
//! - with momentum of steps (`traingdm`),
//! - with momentum and an adaptive learning rate (`traingdx`),
//! - resilient back-propagation (`trainrp`).

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, SettingError, StopReason,
    activations::Backpropagation,
    method::{Algorithm, Checked, Description},
    setting::{MAX_MOMENTUM, check_limit, settings},
};
use crate::network::Mlp;

settings! {
    /// Settings of gradient descent, with the field's usual default (`traingd`).
    pub struct GradientDescentSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Step length relative to the length of the gradient.";
    }
}

/// Conventional back-propagation of the paper, Eq. (5)-(10), in batch form: `v(N+1) = v(N) + α g(N)`, where g is the
/// negative gradient of the mean squared error over all samples. Eq. (8)-(9) are written for a sigmoid; the derivative
/// of our layers is 1 − h² for the tanh nodes and 1 for the linear outputs.
pub(super) struct GradientDescent {
    settings: GradientDescentSettings,
    backpropagation: Backpropagation,
}

impl Algorithm for GradientDescent {
    type Settings = GradientDescentSettings;
    type State = ();

    const DESCRIPTION: Description = Description {
        short_name: "gd",
        name: "Gradient descent",
        summary: "Conventional back-propagation, Eq. (5)-(10): a step down the gradient each epoch.",
        parameter_name: "learning rate",
        remedy: "change the learning rate, run more epochs, or try another method",
    };

    fn new(settings: GradientDescentSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let method = Self {
            settings,
            backpropagation,
        };
        (method, evaluation)
    }

    fn restore(&mut self, (): ()) {}

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        for (weight, slope) in mlp.weights_mut().iter_mut().zip(&self.backpropagation.gradient) {
            *weight -= self.settings.learning_rate * slope;
        }
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    fn parameter(&self) -> f64 {
        self.settings.learning_rate
    }

    fn state(&self) {}
}

settings! {
    /// Settings of gradient descent with momentum, with the field's usual defaults.
    pub struct MomentumSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Step length relative to the length of the gradient (alpha).";
        momentum: "momentum" = 0.9, in 0.0..=1.0,
            "Share of the previous gradient in each step (eta), from 0 to 1.";
    }
}

/// Gradient descent that mixes in the previous **gradient**, Eq. (11) of the paper:
/// `v(N+1) = v(N) + α[(1−η) g(N) + η g(N−1)]`, where g is the negative gradient. (The field's `traingdm` mixes in the
/// previous step instead.) In the first step g(N−1) = g(N).
#[derive(Debug)]
pub(super) struct Momentum {
    settings: MomentumSettings,
    backpropagation: Backpropagation,
    previous_gradient: Vec<f64>,
}

impl Algorithm for Momentum {
    type Settings = MomentumSettings;
    type State = Vec<f64>;

    const DESCRIPTION: Description = Description {
        short_name: "gdm",
        name: "Momentum, Eq. (11)",
        summary: "Gradient descent that mixes the previous gradient into each step, as the paper's Eq. (11) does.",
        parameter_name: "learning rate",
        remedy: "change the learning rate, run more epochs, or try another method",
    };

    fn new(settings: MomentumSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let previous_gradient = backpropagation.gradient.clone();
        let method = Self {
            settings,
            backpropagation,
            previous_gradient,
        };
        (method, evaluation)
    }

    fn restore(&mut self, previous_gradient: Vec<f64>) {
        self.previous_gradient = previous_gradient;
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let MomentumSettings {
            learning_rate,
            momentum,
        } = self.settings;
        let gradients = self.backpropagation.gradient.iter().zip(&self.previous_gradient);
        for (weight, (now, before)) in mlp.weights_mut().iter_mut().zip(gradients) {
            *weight -= learning_rate * ((1.0 - momentum) * now + momentum * before);
        }
        self.previous_gradient.copy_from_slice(&self.backpropagation.gradient);
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    fn parameter(&self) -> f64 {
        self.settings.learning_rate
    }

    fn state(&self) -> Vec<f64> {
        self.previous_gradient.clone()
    }
}

settings! {
    /// Settings of gradient descent with momentum of steps, with the field's usual defaults (`traingdm`).
    pub struct StepMomentumSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Step length relative to the length of the gradient.";
        momentum: "momentum" = 0.9, in 0.0..=MAX_MOMENTUM,
            "Share of the previous step in each step, from 0 to below 1: at 1 the gradient would have none.";
    }
}

/// Gradient descent that mixes in the previous **step** (Rumelhart, Hinton and Williams 1986; `traingdm`):
/// `dX = mc·dXprev + lr·(1 − mc)·g`, where g is the negative gradient; dXprev is 0 before the first step. (The paper's
/// Eq. (11) mixes in the previous gradient instead: `gdm`.)
pub(super) struct StepMomentum {
    settings: StepMomentumSettings,
    backpropagation: Backpropagation,
    step: Vec<f64>,
}

impl Algorithm for StepMomentum {
    type Settings = StepMomentumSettings;
    type State = Vec<f64>;

    const DESCRIPTION: Description = Description {
        short_name: "gdms",
        name: "Momentum of steps",
        summary: "Gradient descent that mixes the previous step into each step, as traingdm does.",
        parameter_name: "learning rate",
        remedy: "change the learning rate, run more epochs, or try another method",
    };

    fn new(settings: StepMomentumSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let method = Self {
            settings,
            backpropagation,
            step: vec![0.0; mlp.weights().len()],
        };
        (method, evaluation)
    }

    fn restore(&mut self, step: Vec<f64>) {
        self.step = step;
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let StepMomentumSettings {
            learning_rate,
            momentum,
        } = self.settings;
        let steps = self.step.iter_mut().zip(&self.backpropagation.gradient);
        for (weight, (step, slope)) in mlp.weights_mut().iter_mut().zip(steps) {
            *step = momentum * *step - learning_rate * (1.0 - momentum) * slope;
            *weight += *step;
        }
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    fn parameter(&self) -> f64 {
        self.settings.learning_rate
    }

    fn state(&self) -> Vec<f64> {
        self.step.clone()
    }
}

settings! {
    /// Settings of gradient descent with momentum and an adaptive learning rate, with the field's usual defaults
    /// (`traingdx`).
    pub struct AdaptiveDescentSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Initial step length relative to the length of the gradient; it adapts from there.";
        momentum: "momentum" = 0.9, in 0.0..=MAX_MOMENTUM,
            "Share of the previous step in each step, from 0 to below 1: at 1 the gradient would have none.";
        rate_increase: "rate increase" = 1.05, in 1.0..=1e3,
            "Factor on the learning rate after a step that lowers the error.";
        rate_decrease: "rate decrease" = 0.7, in 1e-6..=0.999,
            "Factor on the learning rate after a rejected step.";
        largest_error_increase: "largest error increase" = 1.04, in 1.0..=1e6,
            "A step that raises the error by more than this factor is rejected.";
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

impl Checked for AdaptiveState {
    fn vectors(&self) -> Vec<&[f64]> {
        vec![&self.step]
    }
}

impl Algorithm for AdaptiveDescent {
    type Settings = AdaptiveDescentSettings;
    type State = AdaptiveState;

    const DESCRIPTION: Description = Description {
        short_name: "gdx",
        name: "Adaptive rate with momentum",
        summary: "Gradient descent with momentum whose learning rate grows while the error falls.",
        parameter_name: "learning rate",
        remedy: "lower the learning rate, run more epochs, or try another seed",
    };

    fn new(settings: AdaptiveDescentSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
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

    fn restore(&mut self, state: AdaptiveState) {
        self.state = state;
    }

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

    fn state(&self) -> AdaptiveState {
        self.state.clone()
    }
}

settings! {
    /// Settings of resilient back-propagation, with the field's usual defaults (`trainrp`).
    pub struct ResilientSettings {
        first_length: "first step length" = 0.07, in f64::MIN_POSITIVE..=1e300,
            "Step length of every weight in the first epoch (delta0).";
        length_increase: "length increase" = 1.2, in 1.0..=1e3,
            "Factor on a weight's step length while its slope keeps its sign.";
        length_decrease: "length decrease" = 0.5, in 1e-6..=0.999,
            "Factor on a weight's step length when its slope changes sign.";
        largest_length: "largest step length" = 50.0, in f64::MIN_POSITIVE..=1e300,
            "Largest step of a weight in one epoch (deltamax).";
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

impl Checked for ResilientState {
    fn vectors(&self) -> Vec<&[f64]> {
        vec![&self.previous_gradient, &self.lengths]
    }
}

impl Algorithm for Resilient {
    type Settings = ResilientSettings;
    type State = ResilientState;

    const DESCRIPTION: Description = Description {
        short_name: "rp",
        name: "Resilient back-propagation",
        summary: "Each weight has its own step length and uses only the sign of its slope.",
        parameter_name: "mean step length",
        remedy: "lower the first and the largest step length, or try another seed",
    };

    fn check(settings: &ResilientSettings) -> Result<(), SettingError> {
        check_limit(
            ("first step length", settings.first_length),
            ("largest step length", settings.largest_length),
        )
    }

    fn new(settings: ResilientSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
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

    fn restore(&mut self, state: ResilientState) {
        self.state = state;
    }

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

    fn state(&self) -> ResilientState {
        self.state.clone()
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
        let (mut method, _) = GradientDescent::new(GradientDescentSettings { learning_rate: 0.5 }, &mlp, &examples);
        method.step(&mut mlp, &examples).unwrap();
        for ((moved, weight), slope) in mlp.weights().iter().zip(start.weights()).zip(&backpropagation.gradient) {
            assert_eq!(*moved, weight - 0.5 * slope);
        }
    }

    #[test]
    fn steps_follow_equation_11() {
        let (mut mlp, examples) = (random_mlp(3, 2, 2, 1), random_examples(50, 3, 2, 2));
        let settings = MomentumSettings {
            learning_rate: 0.1,
            momentum: 0.7,
        };
        let gradient = |mlp: &Mlp| {
            let mut backpropagation = Backpropagation::new(mlp);
            backpropagation.evaluate(mlp, &examples);
            backpropagation.gradient
        };
        let (mut method, _) = Momentum::new(settings, &mlp, &examples);
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
        for (step, slope) in method.state().step.iter().zip(&gradient) {
            assert_eq!(*step, -700.0 * slope);
        }
    }
}
