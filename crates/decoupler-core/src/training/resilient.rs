//! Resilient back-propagation (`trainrp`).

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, SettingError, StopReason,
    backpropagation::Backpropagation,
    method::{Algorithm, Checked, Description},
    setting::{check_limit, settings},
};
use crate::network::Mlp;

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

/// Resilient back-propagation (Riedmiller and Braun 1993; `trainrp`): each weight has a step length of its own, and of
/// its slope only the sign is used. The length grows while the sign stays and shrinks when it changes; no step is
/// rejected.
pub(super) struct Resilient {
    settings: ResilientSettings,
    backpropagation: Backpropagation,
    state: ResilientState,
}

/// State of resilient back-propagation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResilientState {
    /// The gradient before the current one.
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
        summary: "Each weight keeps a step length of its own and follows only the sign of its slope.",
        parameter_name: "mean step length",
        cure: "lower the first and the largest step length, or take another seed",
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
            // By signs: the product of two tiny slopes would be 0.
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

    /// The mean step length.
    fn parameter(&self) -> f64 {
        self.state.lengths.iter().sum::<f64>() / self.state.lengths.len() as f64
    }

    fn state(&self) -> ResilientState {
        self.state.clone()
    }
}
