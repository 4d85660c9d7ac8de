use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, NormalEquations, Setting, StopReason,
    algorithm::{Algorithm, MethodState, place},
    levenberg_marquardt::SMALLEST_MU,
    normal_equations::Way,
};
use crate::network::Mlp;

/// Settings of Bayesian regularisation, with the field's usual defaults (`trainbr`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BayesianRegularizationSettings {
    /// First damping.
    pub mu: f64,
    /// Factor on mu after a step that lowers the objective.
    pub mu_decrease: f64,
    /// Factor on mu after a step that does not.
    pub mu_increase: f64,
    /// Damping at which training gives up.
    pub mu_max: f64,
}

impl Default for BayesianRegularizationSettings {
    fn default() -> Self {
        Self {
            mu: 0.005,
            mu_decrease: 0.1,
            mu_increase: 10.0,
            mu_max: 1e10,
        }
    }
}

impl BayesianRegularizationSettings {
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
                meaning: "Factor on mu after a step that lowers the regularised error.",
                default: default.mu_decrease,
                range: 1e-6..=0.999,
                value: &mut self.mu_decrease,
            },
            Setting {
                name: "mu increase",
                meaning: "Factor on mu after a step that does not lower the regularised error.",
                default: default.mu_increase,
                range: 1.001..=1e6,
                value: &mut self.mu_increase,
            },
            Setting {
                name: "largest mu",
                meaning: "Training ends when mu exceeds this: no step lowers the regularised error any more.",
                default: default.mu_max,
                range: SMALLEST_MU..=1e300,
                value: &mut self.mu_max,
            },
        ]
    }
}

/// Levenberg-Marquardt on `F = β Σe² + α Σw²`, with α and β estimated from the data (MacKay 1992; Foresee and Hagan
/// 1997; `trainbr`). After every accepted step, with N weights and n errors,
///
/// ```text
/// γ = N − α tr (β JᵀJ + α I)⁻¹        the weights that the data determine
/// α = γ / (2 Σw²)                     β = (n − γ) / (2 Σe²)
/// ```
///
/// The recorded gradient is that of F / (β n): what becomes small where F is smallest. Unlike the field's toolbox, which
/// switches them off for this method, our stopping rules on the validation error hold here as for every other method.
pub(super) struct BayesianRegularization {
    settings: BayesianRegularizationSettings,
    state: BayesianState,
    equations: NormalEquations,
    errors: f64,
    mse: f64,
    step: Vec<f64>,
    candidate: Mlp,
}

/// What `BayesianRegularization` remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BayesianState {
    mu: f64,
    /// α, the weight of Σw².
    alpha: f64,
    /// β, the weight of Σe².
    beta: f64,
    /// γ, the effective number of parameters.
    effective_parameters: f64,
}

impl BayesianRegularization {
    /// Gathers the normal equations at the start, where all weights are taken as determined by the data.
    pub(super) fn new(settings: BayesianRegularizationSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::solved_by(Way::Factored, mlp.shape(), examples);
        let evaluation = equations.gather(mlp, examples);
        let weights = mlp.weights().len();
        let mut method = Self {
            settings,
            state: BayesianState {
                mu: settings.mu,
                alpha: 1.0,
                beta: 1.0,
                effective_parameters: weights as f64,
            },
            equations,
            errors: examples.errors(),
            mse: evaluation.mse,
            step: vec![0.0; weights],
            candidate: mlp.clone(),
        };
        method.weigh(mlp);
        let evaluation = method.regularized(mlp);
        (method, evaluation)
    }

    /// Goes on with the weighing of an interrupted training.
    pub(super) fn resume(mut self, state: BayesianState) -> Self {
        self.state = state;
        self
    }

    /// α and β from γ; each 1 where it would not be a positive number, and neither so extreme that their ratio overflows.
    fn weigh(&mut self, mlp: &Mlp) {
        let gamma = self.state.effective_parameters;
        let bounded = |value: f64| {
            if value > 0.0 && value.is_finite() {
                value.clamp(1e-150, 1e150)
            } else {
                1.0
            }
        };
        self.state.alpha = bounded(gamma / (2.0 * squares(mlp)));
        self.state.beta = bounded((self.errors - gamma) / (2.0 * self.mse * self.errors));
    }

    /// β Σe² + α Σw².
    fn objective(&self, mse: f64, mlp: &Mlp) -> f64 {
        self.state.beta * mse * self.errors + self.state.alpha * squares(mlp)
    }

    /// The present error with the gradient of F / (β n).
    fn regularized(&self, mlp: &Mlp) -> Evaluation {
        let decay = self.state.alpha / self.state.beta;
        Evaluation {
            mse: self.mse,
            gradient_norm: 2.0 * self.equations.gradient_length(mlp, decay) / self.errors,
        }
    }
}

impl Algorithm for BayesianRegularization {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let objective = self.objective(self.mse, mlp);
        while self.state.mu <= self.settings.mu_max {
            let BayesianState { mu, alpha, beta, .. } = self.state;
            let damping = (mu + alpha) / beta;
            if self
                .equations
                .solve_with_decay(mlp, examples, damping, alpha / beta, &mut self.step)
            {
                place(&mut self.candidate, mlp, &self.step);
                let mse = self.equations.mse(&self.candidate, examples);
                // Written so that NaN is rejected.
                if self.objective(mse, &self.candidate) < objective {
                    std::mem::swap(mlp, &mut self.candidate);
                    self.state.mu = (mu * self.settings.mu_decrease).max(SMALLEST_MU);
                    self.mse = mse;
                    self.equations.gather(mlp, examples);
                    // Where rounding leaves no trace, γ stays as it was.
                    if let Some(trace) = self.equations.trace_of_inverse(mlp, alpha / beta) {
                        let weights = self.step.len() as f64;
                        self.state.effective_parameters = (weights - alpha / beta * trace).clamp(0.0, weights);
                    }
                    self.weigh(mlp);
                    return Ok(self.regularized(mlp));
                }
            }
            self.state.mu *= self.settings.mu_increase;
        }
        Err(StopReason::MuLarge)
    }

    fn parameter(&self) -> f64 {
        self.state.mu
    }

    fn effective_parameters(&self) -> Option<f64> {
        Some(self.state.effective_parameters)
    }

    fn state(&self) -> MethodState {
        MethodState::BayesianRegularization(self.state.clone())
    }
}

/// Σw².
fn squares(mlp: &Mlp) -> f64 {
    mlp.weights().iter().map(|weight| weight * weight).sum()
}
