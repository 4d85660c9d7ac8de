//! Gradient descent with momentum of gradients, Eq. (11) of the paper.

use super::{
    Evaluation, Examples, StopReason,
    algorithm::{Algorithm, Description},
    backpropagation::Backpropagation,
    setting::settings,
};
use crate::network::Mlp;

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
/// `v(N+1) = v(N) + α[(1−η) g(N) + η g(N−1)]`, g the negative gradient. (The field's `traingdm` mixes in the previous
/// step instead.) Before the first step g(N−1) is taken as g(N).
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
        cure: "change the learning rate, run more epochs, or take another method",
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

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
}
