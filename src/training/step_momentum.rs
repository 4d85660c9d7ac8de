//! Gradient descent with momentum of steps (`traingdm`).

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, Setting, StopReason,
    algorithm::{Algorithm, Description},
    backpropagation::Backpropagation,
    setting::LARGEST_MOMENTUM,
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
    fn list(&mut self) -> Vec<Setting<'_>> {
        let default = Self::default();
        vec![
            Setting {
                name: "learning rate",
                meaning: "Step length relative to the length of the gradient.",
                default: default.learning_rate,
                range: f64::MIN_POSITIVE..=1e300,
                value: &mut self.learning_rate,
            },
            Setting {
                name: "momentum",
                meaning: "Share of the previous step in each step, from 0 to below 1: at 1 the gradient would have none.",
                default: default.momentum,
                range: 0.0..=LARGEST_MOMENTUM,
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

    fn list(settings: &mut StepMomentumSettings) -> Vec<Setting<'_>> {
        settings.list()
    }

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
