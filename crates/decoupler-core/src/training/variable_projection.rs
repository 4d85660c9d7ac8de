//! Variable projection: the linear output layer is solved for, only the hidden layer is searched.

use serde::{Deserialize, Serialize};

use super::{
    Damping, Evaluation, Examples, FactoredEquations, SettingError, StopReason,
    method::{Algorithm, Checked, Description, add_step},
};
use crate::network::{Mlp, Shape};

/// Variable projection (Golub and Pereyra 1973, with Kaufman's simpler Jacobian of 1975). For any hidden layer the best
/// output layer is a linear least-squares problem, V = G⁻¹ H̃ᵀT with G = H̃ᵀH̃, so only W is searched. Up to a small term
/// the Jacobian of what remains is P⊥B diag(V̄ₜ ⊗ 1) for output t, P⊥ = I − H̃ G⁻¹ H̃ᵀ, and Levenberg-Marquardt steps on W
/// need just the Schur complement with μ on W alone:
///
/// ```text
/// [μI + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − C G⁻¹ Cᵀ)] δW = −Jwᵀe
/// ```
///
/// G gets a ridge of 1e-13 of its largest entry, so that it can be factored when nodes are saturated or equal. The first
/// epoch only solves for V at the initial hidden layer.
pub(super) struct VariableProjection {
    damping: Damping,
    state: ProjectionState,
    equations: FactoredEquations,
    now: Evaluation,
    step: Vec<f64>,
    candidate: Mlp,
}

/// State of variable projection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectionState {
    mu: f64,
    /// True once the output layer was solved for.
    projected: bool,
}

impl Checked for ProjectionState {
    fn vectors(&self) -> Vec<&[f64]> {
        Vec::new()
    }
}

impl VariableProjection {
    fn accept(&mut self, mlp: &mut Mlp, examples: &Examples) -> Evaluation {
        std::mem::swap(mlp, &mut self.candidate);
        self.now = self.equations.gather(mlp, examples);
        self.now
    }
}

/// Solves for the output layer of `candidate` and returns its mean squared error if that is below `limit`.
fn project(equations: &mut FactoredEquations, candidate: &mut Mlp, examples: &Examples, limit: f64) -> Option<f64> {
    equations.solve_outputs(candidate, examples)?;
    let mse = equations.mse(candidate, examples);
    // False for NaN.
    (mse < limit).then_some(mse)
}

impl Algorithm for VariableProjection {
    type Settings = Damping;
    type State = ProjectionState;

    const DESCRIPTION: Description = Description {
        short_name: "varpro",
        name: "Variable projection",
        summary: "Solves the linear output layer exactly and takes Levenberg-Marquardt steps on the hidden layer only.",
        parameter_name: "mu",
        cure: "take another seed, more samples, or Levenberg-Marquardt (lm)",
    };

    fn check(settings: &Damping) -> Result<(), SettingError> {
        settings.check()
    }

    fn equations_bytes(shape: Shape, samples: usize) -> usize {
        FactoredEquations::factored_bytes(shape, samples)
    }

    fn epoch_multiplications(shape: Shape, samples: usize) -> f64 {
        FactoredEquations::factored_multiplications(shape, samples)
    }

    fn new(damping: Damping, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = FactoredEquations::factored(mlp.shape(), examples);
        let now = equations.gather(mlp, examples);
        let method = Self {
            damping,
            state: ProjectionState {
                mu: damping.mu,
                projected: false,
            },
            equations,
            now,
            step: vec![0.0; mlp.shape().hidden_weights()],
            candidate: mlp.clone(),
        };
        (method, now)
    }

    fn restore(&mut self, state: ProjectionState) {
        self.state = state;
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let before = self.now.mse;
        if !self.state.projected {
            self.state.projected = true;
            self.candidate.weights_mut().copy_from_slice(mlp.weights());
            if project(&mut self.equations, &mut self.candidate, examples, before).is_some() {
                return Ok(self.accept(mlp, examples));
            }
        }
        self.damping.search(&mut self.state.mu, |mu| {
            self.equations.solve_hidden(mlp, examples, mu, &mut self.step)?;
            add_step(&mut self.candidate, mlp, &self.step);
            project(&mut self.equations, &mut self.candidate, examples, before)
        })?;
        Ok(self.accept(mlp, examples))
    }

    fn parameter(&self) -> f64 {
        self.state.mu
    }

    fn state(&self) -> ProjectionState {
        self.state.clone()
    }
}
