use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, NormalEquations, Setting, StopReason,
    algorithm::{Algorithm, MethodState, place},
};
use crate::network::Mlp;

/// Settings of Levenberg-Marquardt (Hagan and Menhaj 1994), with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LevenbergMarquardtSettings {
    /// First damping: large values take short steps down the gradient, small ones full Gauss-Newton steps.
    pub mu: f64,
    /// Factor on mu after a step that lowers the error.
    pub mu_decrease: f64,
    /// Factor on mu after a step that does not.
    pub mu_increase: f64,
    /// Damping at which training gives up.
    pub mu_max: f64,
}

impl Default for LevenbergMarquardtSettings {
    fn default() -> Self {
        Self {
            mu: 1e-3,
            mu_decrease: 0.1,
            mu_increase: 10.0,
            mu_max: 1e10,
        }
    }
}

impl LevenbergMarquardtSettings {
    pub(super) fn list(&mut self) -> Vec<Setting<'_>> {
        let default = Self::default();
        vec![
            Setting {
                name: "mu",
                meaning: "First damping. Large: short steps down the gradient; small: full Gauss-Newton steps.",
                default: default.mu,
                range: SMALLEST_MU..=1e300,
                value: &mut self.mu,
            },
            Setting {
                name: "mu decrease",
                meaning: "Factor on mu after a step that lowers the error.",
                default: default.mu_decrease,
                range: 1e-6..=0.999,
                value: &mut self.mu_decrease,
            },
            Setting {
                name: "mu increase",
                meaning: "Factor on mu after a step that does not lower the error.",
                default: default.mu_increase,
                range: 1.001..=1e6,
                value: &mut self.mu_increase,
            },
            Setting {
                name: "largest mu",
                meaning: "Training ends when mu exceeds this: no step lowers the error any more.",
                default: default.mu_max,
                range: SMALLEST_MU..=1e300,
                value: &mut self.mu_max,
            },
        ]
    }
}

/// Below this, mu is lost in the rounding of any sum of squares worth damping.
pub(super) const SMALLEST_MU: f64 = 1e-20;

/// Levenberg-Marquardt at work. A rejected step only factors the gathered products again, with a larger mu.
pub(super) struct LevenbergMarquardt {
    settings: LevenbergMarquardtSettings,
    mu: f64,
    mse: f64,
    equations: NormalEquations,
    step: Vec<f64>,
    candidate: Mlp,
}

impl LevenbergMarquardt {
    /// Gathers the normal equations at the start.
    pub(super) fn new(settings: LevenbergMarquardtSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::new(mlp.shape(), examples);
        let evaluation = equations.gather(mlp, examples);
        let method = Self {
            settings,
            mu: settings.mu,
            mse: evaluation.mse,
            equations,
            step: vec![0.0; mlp.weights().len()],
            candidate: mlp.clone(),
        };
        (method, evaluation)
    }

    /// Goes on with the damping of an interrupted training.
    pub(super) fn resume(mut self, mu: f64) -> Self {
        self.mu = mu;
        self
    }
}

impl Algorithm for LevenbergMarquardt {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        while self.mu <= self.settings.mu_max {
            if self.equations.solve(mlp, examples, self.mu, &mut self.step) {
                place(&mut self.candidate, mlp, &self.step);
                let mse = self.equations.mse(&self.candidate, examples);
                // Written so that NaN is rejected.
                if mse < self.mse {
                    std::mem::swap(mlp, &mut self.candidate);
                    self.mu = (self.mu * self.settings.mu_decrease).max(SMALLEST_MU);
                    self.mse = mse;
                    return Ok(self.equations.gather(mlp, examples));
                }
            }
            self.mu *= self.settings.mu_increase;
        }
        Err(StopReason::MuLarge)
    }

    fn parameter(&self) -> f64 {
        self.mu
    }

    fn state(&self) -> MethodState {
        MethodState::LevenbergMarquardt { mu: self.mu }
    }
}
