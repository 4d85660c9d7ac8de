//! Bayesian regularisation (`trainbr`): `state` is what a checkpoint keeps, and `weighting` estimates it from the data.

mod state;
#[cfg(test)]
mod tests;
mod weighting;

pub use state::BayesianState;

use state::{GroupState, TargetState};
use weighting::{OutputParameters, scale_outputs, weighted_mse};

use super::{
    Damping, Evaluation, Examples, RegularizationSettings, StopReason,
    method::{Algorithm, MethodState, add_step},
    normal_equations::{Classes, NormalEquations, Plan, class_sizes, decay_slopes},
    trainer::correlation_time,
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
/// Errors of neighbouring frames of a recording are correlated: n of them carry only as much information as n/τ
/// independent errors, where τ is their [`correlation_time`]. It is measured once, at
/// [`RegularizationSettings::correlation_epoch`]; from then on α/β is that of n/τ errors of the same size, since a
/// posterior that treats every frame as new evidence fits the noise.
///
/// The recorded gradient is that of F / (β n), which vanishes at the minimum of F. The field's toolbox disables
/// validation stops for this method; here they apply as for every other method.
pub(super) struct BayesianRegularization {
    damping: Damping,
    /// Epoch after which the correlation of errors is measured; 0 for never.
    correlation_epoch: usize,
    /// Group of each class of weights.
    group_of: Classes<usize>,
    /// Means of the targets, if output biases are drawn towards them.
    means: Vec<f64>,
    state: BayesianState,
    /// √ρ of each target; empty if all have the same noise level.
    roots: Vec<f64>,
    /// γ of the output weights of each target, once measured; empty if all have the same noise level.
    of_outputs: Vec<OutputParameters>,
    equations: NormalEquations,
    examples: Examples,
    /// Mean squared error.
    mse: f64,
    /// Mean of ρe²: the same as [`Self::mse`] if all targets have the same noise level.
    weighted_mse: f64,
    step: Vec<f64>,
    candidate: Mlp,
    /// The network with its output weights multiplied by √ρ.
    scaled: Mlp,
    scaled_candidate: Mlp,
}

/// Maximum lag in samples; the sum of the correlations ends at the first that is not positive.
const MAX_LAG: usize = 50;

/// Group of each class of weights, from 0, for this number of groups.
fn group_of_classes(groups: f64) -> Classes<usize> {
    match groups as usize {
        ..=1 => [0, 0, 0, 0],
        2 => [0, 0, 1, 1],
        3 => [0, 1, 2, 2],
        _ => [0, 1, 2, 3],
    }
}

impl BayesianRegularization {
    /// Starts with γ = N, as if the data determined all weights.
    pub(super) fn new(settings: RegularizationSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = NormalEquations::new(&Plan::factored(mlp.shape(), examples.samples()), examples);
        let evaluation = equations.gather(mlp, &[], examples);
        let weights = mlp.weights().len();
        let group_of = group_of_classes(settings.groups);
        let mut method = Self {
            damping: settings.damping(),
            group_of,
            means: if settings.groups < 2.0 {
                Vec::new()
            } else {
                examples.target_means()
            },
            correlation_epoch: settings.correlation_epoch as usize,
            state: BayesianState {
                mu: settings.mu,
                alpha: 1.0,
                beta: 1.0,
                effective_parameters: weights as f64,
                further: Vec::new(),
                epochs: 0,
                correlation_time: None,
                // Fewer samples do not determine the noise of each target: with 20, networks came out worse than ridge.
                targets: if settings.own_noise == 0.0 || examples.samples() < weights {
                    Vec::new()
                } else {
                    let target = TargetState {
                        precision: 1.0,
                        effective_parameters: weights as f64 / examples.outputs() as f64,
                    };
                    vec![target; examples.outputs()]
                },
            },
            roots: Vec::new(),
            of_outputs: Vec::new(),
            equations,
            examples: examples.clone(),
            mse: evaluation.mse,
            weighted_mse: evaluation.mse,
            step: vec![0.0; weights],
            candidate: mlp.clone(),
            scaled: mlp.clone(),
            scaled_candidate: mlp.clone(),
        };
        method.state.further = {
            let sizes = class_sizes(mlp.shape());
            let classes = group_of.into_iter().zip(sizes);
            let size = |group| {
                classes
                    .clone()
                    .filter(|(of, _)| *of == group)
                    .map(|(_, size)| size as f64)
                    .sum()
            };
            (1..settings.groups as usize)
                .map(|group| GroupState {
                    alpha: 1.0,
                    effective_parameters: size(group),
                })
                .collect()
        };
        method.update_weighting();
        let evaluation = method.regularized();
        (method, evaluation)
    }
}

impl Algorithm for BayesianRegularization {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let weighting = self.state.clone();
        let (precisions, means, errors) = (self.precisions(), self.scaled_means(), self.errors());
        let (beta, prior) = (weighting.beta, (self.group_of, &means[..]));
        let alphas = weighting.decays(self.group_of);
        let objective = weighting.objective(self.weighted_mse, errors, &self.scaled, prior);
        let decay = decay_slopes(&self.scaled, alphas.map(|alpha| alpha / beta), prior.1);
        let hidden_weights = mlp.shape().hidden_weights();
        self.damping.search(&mut self.state.mu, |mu| {
            let damping = alphas.map(|alpha| (mu + alpha) / beta);
            self.equations
                .solve(&self.scaled, examples, damping, &decay, &mut self.step)?;
            if !self.roots.is_empty() {
                let outputs = self.step[hidden_weights..].iter_mut().zip(self.roots.iter().cycle());
                outputs.for_each(|(step, root)| *step /= root);
            }
            add_step(&mut self.candidate, mlp, &self.step);
            scale_outputs(&mut self.scaled_candidate, &self.candidate, &self.roots);
            let mse = weighted_mse(&mut self.equations, &self.candidate, &precisions, examples);
            // False for NaN.
            (weighting.objective(mse, errors, &self.scaled_candidate, prior) < objective).then_some(())
        })?;
        std::mem::swap(mlp, &mut self.candidate);
        std::mem::swap(&mut self.scaled, &mut self.scaled_candidate);
        self.update_precisions(mlp);
        self.gather(mlp);
        self.measure_effective_parameters();
        self.state.epochs += 1;
        if self.state.epochs == self.correlation_epoch {
            self.state.correlation_time = Some(correlation_time(mlp, examples, MAX_LAG));
        }
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

    fn restore(&mut self, state: MethodState) -> bool {
        let MethodState::BayesianRegularization(state) = state else {
            return false;
        };
        let fresh = std::mem::replace(&mut self.state, state);
        // A state has as many groups and targets as the settings it was saved with, unless it is damaged.
        let missing = fresh.further.get(self.state.further.len()..).unwrap_or_default();
        self.state.further.extend_from_slice(missing);
        self.state.further.truncate(fresh.further.len());
        let missing = fresh.targets.get(self.state.targets.len()..).unwrap_or_default();
        self.state.targets.extend_from_slice(missing);
        self.state.targets.truncate(fresh.targets.len());
        if !self.state.targets.is_empty() {
            // Before the first step, the candidate is the network.
            let mlp = self.candidate.clone();
            self.scale_targets(&mlp);
            self.gather(&mlp);
        }
        true
    }
}
