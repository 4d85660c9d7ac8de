//! The state: strengths of regularisation and noise levels.

use serde::{Deserialize, Serialize};

use crate::{
    network::Mlp,
    training::normal_equations::{Classes, class_squares},
};

/// State of Bayesian regularisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BayesianState {
    pub(super) mu: f64,
    /// α, the weight of Σw² of the first group.
    pub(super) alpha: f64,
    /// β, the weight of Σe².
    pub(super) beta: f64,
    /// γ, the effective number of parameters of all weights.
    pub(super) effective_parameters: f64,
    /// The groups after the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) further: Vec<GroupState>,
    /// Number of epochs so far.
    #[serde(default)]
    pub(super) epochs: usize,
    /// τ, once measured.
    #[serde(default)]
    pub(super) correlation_time: Option<f64>,
    /// Noise level and γₜ of each target; empty if all have the same noise level.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) targets: Vec<TargetState>,
}

/// State of a target with its own noise level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TargetState {
    /// ρₜ = βₜ/β.
    pub(super) precision: f64,
    /// γₜ.
    pub(super) effective_parameters: f64,
}

/// State of a group of weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupState {
    pub(super) alpha: f64,
    pub(super) effective_parameters: f64,
}

impl BayesianState {
    /// Returns `true` if there is one α and one β.
    pub(super) fn is_plain(&self) -> bool {
        self.further.is_empty() && self.targets.is_empty()
    }

    /// α of each class of weights.
    pub(super) fn decays(&self, group_of: Classes<usize>) -> Classes {
        group_of.map(|group| match group {
            0 => self.alpha,
            group => self.further[group - 1].alpha,
        })
    }

    /// β Σρe² + Σ α Σw², with Σρe² = `mse`·`errors`, and the weights of the scaled network `mlp`.
    pub(super) fn objective(
        &self,
        mse: f64,
        errors: f64,
        mlp: &Mlp,
        (group_of, means): (Classes<usize>, &[f64]),
    ) -> f64 {
        let of_weights = if self.is_plain() {
            self.alpha * sum_of_squares(mlp)
        } else {
            let squares = class_squares(mlp, means);
            let products = self.decays(group_of).into_iter().zip(squares);
            products.map(|(decay, squares)| decay * squares).sum()
        };
        self.beta * mse * errors + of_weights
    }
}

/// Σw².
pub(super) fn sum_of_squares(mlp: &Mlp) -> f64 {
    mlp.weights().iter().map(|weight| weight * weight).sum()
}
