use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, Setting, StopReason,
    algorithm::{Algorithm, MethodState},
    backpropagation::Backpropagation,
};
use crate::network::Mlp;

/// Settings of resilient back-propagation, with the field's usual defaults (`trainrp`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResilientSettings {
    /// First step length of every weight.
    pub first_length: f64,
    /// Factor on a weight's step length while its slope keeps its sign.
    pub length_increase: f64,
    /// Factor on a weight's step length when its slope changes sign.
    pub length_decrease: f64,
    /// Largest step length.
    pub largest_length: f64,
}

impl Default for ResilientSettings {
    fn default() -> Self {
        Self {
            first_length: 0.07,
            length_increase: 1.2,
            length_decrease: 0.5,
            largest_length: 50.0,
        }
    }
}

impl ResilientSettings {
    pub(super) fn list(&mut self) -> Vec<Setting<'_>> {
        let default = Self::default();
        vec![
            Setting {
                name: "first step length",
                meaning: "By how much every weight moves in the first epoch (delta0).",
                default: default.first_length,
                range: f64::MIN_POSITIVE..=1e300,
                value: &mut self.first_length,
            },
            Setting {
                name: "length increase",
                meaning: "Factor on a weight's step length while its slope keeps its sign.",
                default: default.length_increase,
                range: 1.0..=1e3,
                value: &mut self.length_increase,
            },
            Setting {
                name: "length decrease",
                meaning: "Factor on a weight's step length when its slope changes sign.",
                default: default.length_decrease,
                range: 1e-6..=0.999,
                value: &mut self.length_decrease,
            },
            Setting {
                name: "largest step length",
                meaning: "By how much a weight moves at most in an epoch.",
                default: default.largest_length,
                range: f64::MIN_POSITIVE..=1e300,
                value: &mut self.largest_length,
            },
        ]
    }
}

/// Resilient back-propagation (Riedmiller and Braun 1993; `trainrp`): each weight has a step length of its own, and of
/// its slope only the sign is used. The length grows while the sign stays and shrinks when it changes; steps are not
/// taken back.
pub(super) struct Resilient {
    settings: ResilientSettings,
    backpropagation: Backpropagation,
    previous_gradient: Vec<f64>,
    lengths: Vec<f64>,
}

impl Resilient {
    /// Takes the gradient at the start.
    pub(super) fn new(settings: ResilientSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let weights = mlp.weights().len();
        let method = Self {
            settings,
            backpropagation,
            previous_gradient: vec![0.0; weights],
            lengths: vec![settings.first_length.min(settings.largest_length); weights],
        };
        (method, evaluation)
    }

    /// Goes on with the lengths of an interrupted training.
    pub(super) fn resume(mut self, previous_gradient: Vec<f64>, lengths: Vec<f64>) -> Self {
        self.previous_gradient = previous_gradient;
        self.lengths = lengths;
        self
    }
}

impl Algorithm for Resilient {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let settings = self.settings;
        for (index, weight) in mlp.weights_mut().iter_mut().enumerate() {
            let (now, before) = (self.backpropagation.gradient[index], self.previous_gradient[index]);
            // By signs: the product of two tiny slopes would be 0.
            let factor = match (now > 0.0, now < 0.0, before > 0.0, before < 0.0) {
                (true, _, true, _) | (_, true, _, true) => settings.length_increase,
                (true, _, _, true) | (_, true, true, _) => settings.length_decrease,
                _ => 1.0,
            };
            let length = (self.lengths[index] * factor).min(settings.largest_length);
            self.lengths[index] = length;
            if now != 0.0 {
                *weight -= length.copysign(now);
            }
        }
        self.previous_gradient.copy_from_slice(&self.backpropagation.gradient);
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    /// The mean step length.
    fn parameter(&self) -> f64 {
        self.lengths.iter().sum::<f64>() / self.lengths.len() as f64
    }

    fn state(&self) -> MethodState {
        MethodState::Resilient {
            previous_gradient: self.previous_gradient.clone(),
            lengths: self.lengths.clone(),
        }
    }
}
