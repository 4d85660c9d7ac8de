//! Levenberg-Marquardt (`trainlm`).

use serde::{Deserialize, Serialize};

use super::{
    Damping, Evaluation, Examples, NormalEquations, SettingError, StopReason,
    algorithm::{Algorithm, Checked, Description, add_step},
};
use crate::network::{Mlp, Shape};

/// Levenberg-Marquardt (Hagan and Menhaj 1994). After a rejected step only the damped equations are solved again, with a
/// larger mu; the products are gathered once an epoch.
pub(super) struct LevenbergMarquardt {
    damping: Damping,
    mu: f64,
    mse: f64,
    equations: NormalEquations,
    step: Vec<f64>,
    candidate: Mlp,
}

/// State of Levenberg-Marquardt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DampedState {
    mu: f64,
}

impl Checked for DampedState {
    fn vectors(&self) -> Vec<&[f64]> {
        Vec::new()
    }
}

impl Algorithm for LevenbergMarquardt {
    type Settings = Damping;
    type State = DampedState;

    const DESCRIPTION: Description = Description {
        short_name: "lm",
        name: "Levenberg-Marquardt",
        summary: "Damped Gauss-Newton steps: the fewest epochs, and here also the least time.",
        parameter_name: "mu",
        cure: "take another seed, more samples, or fewer hidden nodes",
    };

    fn check(settings: &Damping) -> Result<(), SettingError> {
        settings.check()
    }

    fn equations_bytes(shape: Shape, samples: usize) -> usize {
        NormalEquations::cheapest_bytes(shape, samples)
    }

    fn epoch_multiplications(shape: Shape, samples: usize) -> f64 {
        NormalEquations::cheapest_multiplications(shape, samples)
    }

    fn new(damping: Damping, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::cheapest(mlp.shape(), examples);
        let evaluation = equations.gather(mlp, examples);
        let method = Self {
            damping,
            mu: damping.mu,
            mse: evaluation.mse,
            equations,
            step: vec![0.0; mlp.weights().len()],
            candidate: mlp.clone(),
        };
        (method, evaluation)
    }

    fn restore(&mut self, state: DampedState) {
        self.mu = state.mu;
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let before = self.mse;
        self.mse = self.damping.search(&mut self.mu, |mu| {
            self.equations.solve(mlp, examples, mu, &mut self.step)?;
            add_step(&mut self.candidate, mlp, &self.step);
            let mse = self.equations.mse(&self.candidate, examples);
            // False for NaN.
            (mse < before).then_some(mse)
        })?;
        std::mem::swap(mlp, &mut self.candidate);
        Ok(self.equations.gather(mlp, examples))
    }

    fn parameter(&self) -> f64 {
        self.mu
    }

    fn state(&self) -> DampedState {
        DampedState { mu: self.mu }
    }
}
