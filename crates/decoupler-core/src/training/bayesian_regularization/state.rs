//! The state: strengths of regularisation and noise levels.

use serde::{Deserialize, Serialize};

use crate::training::normal_equations::Classes;

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
    /// α of each class of weights.
    pub(super) fn decays(&self, group_of: Classes<usize>) -> Classes {
        group_of.map(|group| match group {
            0 => self.alpha,
            group => self.further[group - 1].alpha,
        })
    }
}
