//! Gradient descent with momentum of steps (`traingdm`).

use super::{
    Evaluation, Examples, StopReason,
    algorithm::{Algorithm, Description},
    backpropagation::Backpropagation,
    setting::{LARGEST_MOMENTUM, settings},
};
use crate::network::Mlp;

settings! {
    /// Settings of gradient descent with momentum of steps, with the field's usual defaults (`traingdm`).
    pub struct StepMomentumSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Step length relative to the length of the gradient.";
        momentum: "momentum" = 0.9, in 0.0..=LARGEST_MOMENTUM,
            "Share of the previous step in each step, from 0 to below 1: at 1 the gradient would have none.";
    }
}

/// Gradient descent that mixes in the previous **step** (Rumelhart, Hinton and Williams 1986; `traingdm`):
/// `dX = mc·dXprev + lr·(1 − mc)·g`, g the negative gradient; dXprev is 0 before the first step. (The paper's Eq. (11)
/// mixes in the previous gradient instead: `gdm`.)
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
        cure: "change the learning rate, run more epochs, or take another method",
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
