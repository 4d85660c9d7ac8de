//! Levenberg-Marquardt (`trainlm`), and the damping mu of all methods that take Levenberg-Marquardt steps.

use serde::{Deserialize, Serialize};

use super::{
    Damping, Evaluation, Examples, StopReason,
    method::{Algorithm, MethodState, add_step},
    normal_equations::{NormalEquations, Plan},
};
use crate::{network::Mlp, settings::MIN_MU};

/// Levenberg-Marquardt (Hagan and Menhaj 1994). After a rejected step only the damped equations are solved again, with
/// a larger mu; the products are gathered once per epoch.
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

impl LevenbergMarquardt {
    pub(super) fn new(damping: Damping, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::new(&Plan::cheapest(mlp.shape(), examples.samples()), examples);
        let evaluation = equations.gather(mlp, &[], examples);
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
}

impl Algorithm for LevenbergMarquardt {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let (before, gradient) = (self.mse, self.equations.gradient().to_vec());
        self.mse = self.damping.search(&mut self.mu, |mu| {
            self.equations
                .solve(mlp, examples, [mu; 4], &gradient, &mut self.step)?;
            add_step(&mut self.candidate, mlp, &self.step);
            let mse = self.equations.mse(&self.candidate, examples);
            // False for NaN.
            (mse < before).then_some(mse)
        })?;
        std::mem::swap(mlp, &mut self.candidate);
        Ok(self.equations.gather(mlp, &[], examples))
    }

    fn parameter(&self) -> f64 {
        self.mu
    }

    fn state(&self) -> MethodState {
        MethodState::LevenbergMarquardt(DampedState { mu: self.mu })
    }

    fn restore(&mut self, state: MethodState) {
        if let MethodState::LevenbergMarquardt(DampedState { mu }) = state {
            self.mu = mu;
        }
    }
}

impl Damping {
    /// Tries steps with growing damping until one is accepted; `mu` is then decreased for the next epoch.
    ///
    /// `attempt` returns `Some` if it accepts the step at the given damping, and `None` if there is no step or the step
    /// does not lower the error.
    ///
    /// # Errors
    /// [`StopReason::MuLarge`] if no step up to the largest mu is accepted.
    pub(super) fn search<T>(self, mu: &mut f64, mut attempt: impl FnMut(f64) -> Option<T>) -> Result<T, StopReason> {
        // A saved mu of 0 would never grow.
        *mu = mu.max(MIN_MU);
        while *mu <= self.mu_max {
            if let Some(accepted) = attempt(*mu) {
                *mu = (*mu * self.mu_decrease).max(MIN_MU);
                return Ok(accepted);
            }
            *mu *= self.mu_increase;
        }
        Err(StopReason::MuLarge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mu_grows_until_a_step_is_accepted_and_then_falls() {
        let mut mu = 1.0;
        let mut tried = Vec::new();
        let accepted = Damping::default().search(&mut mu, |mu| {
            tried.push(mu);
            (mu >= 100.0).then_some("accepted")
        });
        assert_eq!((accepted, mu), (Ok("accepted"), 10.0));
        assert_eq!(tried, [1.0, 10.0, 100.0]);
    }

    #[test]
    fn the_search_ends_above_the_largest_mu_and_mu_never_becomes_zero() {
        let mut mu = 1e9;
        let refused: Result<(), _> = Damping::default().search(&mut mu, |_| None);
        assert_eq!(refused, Err(StopReason::MuLarge));
        assert!(mu > 1e10);
        let mut mu = MIN_MU;
        assert_eq!(Damping::default().search(&mut mu, |_| Some(())), Ok(()));
        assert_eq!(mu, MIN_MU);
    }
}
