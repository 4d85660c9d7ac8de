use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, NormalEquations, Setting, StopReason,
    algorithm::{Algorithm, MethodState, place},
    levenberg_marquardt::SMALLEST_MU,
    normal_equations::Way,
};
use crate::network::Mlp;

/// Settings of variable projection: those of the Levenberg-Marquardt steps it takes on the hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariableProjectionSettings {
    /// First damping of the hidden layer.
    pub mu: f64,
    /// Factor on mu after a step that lowers the error.
    pub mu_decrease: f64,
    /// Factor on mu after a step that does not.
    pub mu_increase: f64,
    /// Damping at which training gives up.
    pub mu_max: f64,
}

impl Default for VariableProjectionSettings {
    fn default() -> Self {
        Self {
            mu: 1e-3,
            mu_decrease: 0.1,
            mu_increase: 10.0,
            mu_max: 1e10,
        }
    }
}

impl VariableProjectionSettings {
    pub(super) fn list(&mut self) -> Vec<Setting<'_>> {
        let default = Self::default();
        vec![
            Setting {
                name: "mu",
                meaning: "First damping of the hidden layer's steps; the output layer is solved for exactly.",
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

/// Variable projection (Golub and Pereyra 1973, with the simpler Jacobian of Kaufman 1975). For any hidden layer the best
/// output layer is a linear least-squares problem, V = G⁻¹ H̃ᵀT with G = H̃ᵀH̃, so only W is searched. The Jacobian of
/// what remains is, but for a small term, P⊥B diag(V̄ₜ ⊗ 1) for output t, P⊥ = I − H̃ G⁻¹ H̃ᵀ, and Levenberg-Marquardt steps on
/// W need just the Schur complement with μ on W alone:
///
/// ```text
/// [μI + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − C G⁻¹ Cᵀ)] δW = −Jwᵀe
/// ```
///
/// G gets a ridge of 1e-13 of its largest entry, so that saturated or equal nodes leave it solvable. The first epoch only
/// solves for V at the start's hidden layer.
pub(super) struct VariableProjection {
    settings: VariableProjectionSettings,
    state: ProjectionState,
    equations: NormalEquations,
    now: Evaluation,
    step: Vec<f64>,
    candidate: Mlp,
}

/// What `VariableProjection` remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectionState {
    mu: f64,
    /// Whether the output layer was solved for.
    projected: bool,
}

impl VariableProjection {
    /// Gathers the normal equations at the start.
    pub(super) fn new(settings: VariableProjectionSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::solved_by(Way::Factored, mlp.shape(), examples);
        let now = equations.gather(mlp, examples);
        let method = Self {
            settings,
            state: ProjectionState {
                mu: settings.mu,
                projected: false,
            },
            equations,
            now,
            step: vec![0.0; mlp.shape().hidden_weights()],
            candidate: mlp.clone(),
        };
        (method, now)
    }

    /// Goes on with the damping of an interrupted training.
    pub(super) fn resume(mut self, state: ProjectionState) -> Self {
        self.state = state;
        self
    }

    /// Solves for the candidate's output layer; its mean squared error, if there is one.
    fn project(&mut self, examples: &Examples) -> Option<f64> {
        self.equations.solve_outputs(&mut self.candidate, examples).then(|| {
            // Infinite or NaN errors are no errors.
            self.equations.mse(&self.candidate, examples)
        })
    }

    fn accept(&mut self, mlp: &mut Mlp, examples: &Examples) -> Evaluation {
        std::mem::swap(mlp, &mut self.candidate);
        self.now = self.equations.gather(mlp, examples);
        self.now
    }
}

impl Algorithm for VariableProjection {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        if !self.state.projected {
            self.state.projected = true;
            self.candidate.weights_mut().copy_from_slice(mlp.weights());
            if self.project(examples).is_some_and(|mse| mse < self.now.mse) {
                return Ok(self.accept(mlp, examples));
            }
        }
        while self.state.mu <= self.settings.mu_max {
            if self
                .equations
                .solve_hidden(mlp, examples, self.state.mu, &mut self.step)
            {
                // The output layer keeps its weights until it is solved for.
                place(&mut self.candidate, mlp, &self.step);
                if self.project(examples).is_some_and(|mse| mse < self.now.mse) {
                    self.state.mu = (self.state.mu * self.settings.mu_decrease).max(SMALLEST_MU);
                    return Ok(self.accept(mlp, examples));
                }
            }
            self.state.mu *= self.settings.mu_increase;
        }
        Err(StopReason::MuLarge)
    }

    fn parameter(&self) -> f64 {
        self.state.mu
    }

    fn state(&self) -> MethodState {
        MethodState::VariableProjection(self.state.clone())
    }
}
