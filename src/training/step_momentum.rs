use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, Setting, StopReason,
    algorithm::{Algorithm, MethodState},
    backpropagation::Backpropagation,
};
use crate::network::Mlp;

/// Settings of gradient descent with momentum of steps, with the field's usual defaults (`traingdm`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepMomentumSettings {
    /// The learning rate lr.
    pub learning_rate: f64,
    /// The momentum constant mc.
    pub momentum: f64,
}

impl Default for StepMomentumSettings {
    fn default() -> Self {
        Self {
            learning_rate: 0.01,
            momentum: 0.9,
        }
    }
}

impl StepMomentumSettings {
    pub(super) fn list(&mut self) -> Vec<Setting<'_>> {
        let default = Self::default();
        vec![
            Setting {
                name: "learning rate",
                meaning: "Length of a step per length of the gradient.",
                default: default.learning_rate,
                range: f64::MIN_POSITIVE..=1e300,
                value: &mut self.learning_rate,
            },
            Setting {
                name: "momentum",
                meaning: "Share of the previous step in each step, from 0 to 1.",
                default: default.momentum,
                range: 0.0..=1.0,
                value: &mut self.momentum,
            },
        ]
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

impl StepMomentum {
    /// Takes the gradient at the start.
    pub(super) fn new(settings: StepMomentumSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let method = Self {
            settings,
            backpropagation,
            step: vec![0.0; mlp.weights().len()],
        };
        (method, evaluation)
    }

    /// Goes on with the last step of an interrupted training.
    pub(super) fn resume(mut self, step: Vec<f64>) -> Self {
        self.step = step;
        self
    }
}

impl Algorithm for StepMomentum {
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

    fn state(&self) -> MethodState {
        MethodState::StepMomentum(self.step.clone())
    }
}
