//! Bayesian regularisation (`trainbr`): `weighting` estimates strengths of regularisation and noise levels from the data.

#[cfg(test)]
mod tests;
mod weighting;

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, RegularizationSettings, StopReason,
    method::{Algorithm, MethodState, add_step},
    normal_equations::{Classes, NormalEquations, Plan, class_sizes},
};
use crate::network::Mlp;

/// Levenberg-Marquardt on `F = β Σe² + α Σw²`, with α and β estimated from the data (MacKay 1992; Foresee and Hagan
/// 1997; `trainbr`). After every accepted step, with N weights and n errors,
///
/// ```text
/// γ = N − α tr (β JᵀJ + α I)⁻¹        effective number of parameters
/// α = γ / (2 Σw²)                     β = (n − γ) / (2 Σe²)
/// ```
///
/// With several groups of weights, each group has its own α from its own γ and Σw² (MacKay 1992,
/// doi:10.1162/neco.1992.4.3.448): weights of inputs and of outputs have different scales, and one α for both suits
/// neither, which matters with few samples. For output biases, w is then the distance from the mean of the target, so
/// that a network without information answers the mean, and no answer depends on the zero of a target.
///
/// With a noise level for each target t, the objective is `Σₜ βₜ Σeₜ² + α Σw²`, where
///
/// ```text
/// βₜ = (samples − γₜ) / (2 Σeₜ²)      γₜ: the share of γ that target t determines
/// ```
///
/// Otherwise a target without information, such as a constant with jitter, raises the noise level of all. The prior of
/// the output weights is the conjugate one, in units of the noise of their target: with precisions ρₜ = βₜ/β, it is the
/// same training with targets and output weights multiplied by √ρₜ, so the equations keep their structure, and units
/// of targets have no influence. With groups of weights, the α of output weights is the lowest among single targets. The
/// weights of the hidden layer, which all targets determine together, are shared among the γₜ in proportion to the squares of
/// these output weights.
///
/// The recorded gradient is that of F / (β n), which vanishes at the minimum of F. The field's toolbox disables
/// validation stops for this method; here they apply as for every other method.
pub(super) struct BayesianRegularization {
    settings: RegularizationSettings,
    /// Group of each class of weights.
    group_of: Classes<usize>,
    /// Means of the targets, if output biases are drawn towards them.
    means: Vec<f64>,
    state: BayesianState,
    /// ρ of each target: 1 if all have the same noise level.
    precisions: Vec<f64>,
    /// γ of the weights and of the bias of each output, once measured; empty if all have the same noise level.
    of_outputs: Vec<[f64; 2]>,
    equations: NormalEquations,
    examples: Examples,
    /// Mean squared error.
    mse: f64,
    /// Mean of ρe².
    weighted_mse: f64,
    step: Vec<f64>,
    /// The network with its output weights multiplied by √ρ.
    scaled: Mlp,
}

/// State of Bayesian regularisation. Fields of version 0.1.0 are ignored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BayesianState {
    mu: f64,
    /// α, the weight of Σw² of the first group.
    alpha: f64,
    /// β, the weight of Σe².
    beta: f64,
    /// γ, the effective number of parameters of all weights.
    effective_parameters: f64,
    /// The groups after the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    further: Vec<GroupState>,
    /// Noise level and γₜ of each target; empty if all have the same noise level.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    targets: Vec<TargetState>,
}

/// State of a target with its own noise level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetState {
    /// ρₜ = βₜ/β.
    precision: f64,
    /// γₜ.
    effective_parameters: f64,
}

/// State of a group of weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupState {
    alpha: f64,
    effective_parameters: f64,
}

impl BayesianRegularization {
    /// Starts with γ = N, as if the data determined all weights.
    pub(super) fn new(settings: RegularizationSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let (weights, outputs) = (mlp.weights().len(), examples.outputs());
        let group_of = match settings.groups as usize {
            ..=1 => [0, 0, 0, 0],
            2 => [0, 0, 1, 1],
            3 => [0, 1, 2, 2],
            _ => [0, 1, 2, 3],
        };
        let group = |group| {
            let classes = group_of.into_iter().zip(class_sizes(mlp.shape()));
            let sizes = classes.filter(|(of, _)| *of == group).map(|(_, size)| size as f64);
            GroupState {
                alpha: 1.0,
                effective_parameters: sizes.sum(),
            }
        };
        let target = TargetState {
            precision: 1.0,
            effective_parameters: weights as f64 / outputs as f64,
        };
        // Fewer samples do not determine the noise of each target: with 20, networks came out worse than ridge.
        let has_own_noise = settings.own_noise != 0.0 && examples.samples() >= weights;
        let means = if settings.groups >= 2.0 {
            examples.target_means()
        } else {
            Vec::new()
        };
        let mut method = Self {
            settings,
            group_of,
            means,
            state: BayesianState {
                mu: settings.damping.mu,
                alpha: 1.0,
                beta: 1.0,
                effective_parameters: weights as f64,
                further: (1..settings.groups as usize).map(group).collect(),
                targets: vec![target; if has_own_noise { outputs } else { 0 }],
            },
            precisions: vec![1.0; outputs],
            of_outputs: Vec::new(),
            equations: NormalEquations::new(&Plan::factored(mlp.shape(), examples.samples()), examples),
            examples: examples.clone(),
            mse: f64::NAN,
            weighted_mse: f64::NAN,
            step: vec![0.0; weights],
            scaled: mlp.clone(),
        };
        method.gather(mlp);
        method.update_weighting();
        let evaluation = method.regularized();
        (method, evaluation)
    }
}

impl Algorithm for BayesianRegularization {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let (alphas, beta) = (self.decays(), self.state.beta);
        let (objective, slopes) = (self.objective(self.weighted_mse, &self.scaled), self.slopes());
        let hidden_weights = mlp.shape().hidden_weights();
        let (mut mu, mut candidate) = (self.state.mu, mlp.clone());
        let found = self.settings.damping.search(&mut mu, |mu| {
            let damping = alphas.map(|alpha| (mu + alpha) / beta);
            self.equations
                .solve(&self.scaled, examples, damping, &slopes, &mut self.step)?;
            let of_outputs = self.step[hidden_weights..].iter_mut();
            for (step, precision) in of_outputs.zip(self.precisions.iter().cycle()) {
                *step /= precision.sqrt();
            }
            add_step(&mut candidate, mlp, &self.step);
            let mse = self.weighted_mse(&candidate);
            // False for NaN.
            (self.objective(mse, &self.scaled(&candidate)) < objective).then_some(())
        });
        self.state.mu = mu;
        found?;
        std::mem::swap(mlp, &mut candidate);
        self.update_precisions(mlp);
        self.gather(mlp);
        self.measure_effective_parameters();
        self.update_weighting();
        Ok(self.regularized())
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

    fn restore(&mut self, state: MethodState) {
        let MethodState::BayesianRegularization(state) = state else {
            return;
        };
        let fresh = std::mem::replace(&mut self.state, state);
        // A state has as many groups and targets as the settings it was saved with, unless it is damaged.
        fit(&mut self.state.further, fresh.further);
        fit(&mut self.state.targets, fresh.targets);
        // Before the first step every precision is 1.
        let mlp = self.scaled.clone();
        self.gather(&mlp);
    }
}

/// Gives `restored` the length of `fresh`, whose values fill it up.
fn fit<T: Clone>(restored: &mut Vec<T>, fresh: Vec<T>) {
    restored.extend_from_slice(fresh.get(restored.len()..).unwrap_or_default());
    restored.truncate(fresh.len());
}
