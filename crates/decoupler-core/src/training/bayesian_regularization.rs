//! Bayesian regularisation (`trainbr`).

use serde::{Deserialize, Serialize};

use super::{
    Damping, Evaluation, Examples, FactoredEquations, SettingError, StopReason,
    method::{Algorithm, Checked, Description, add_step},
    normal_equations::{Decay, OutputTraces, PerClass, Traces, class_sizes, class_squares},
    setting::{WHOLE, settings},
    trainer::correlation_time,
};
use crate::network::{Mlp, Shape};

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
    group_of: PerClass<usize>,
    /// Means of the targets, if output biases are drawn towards them.
    means: Vec<f64>,
    state: BayesianState,
    /// √ρ of each target; empty if all have the same noise level.
    roots: Vec<f64>,
    /// γ of the output weights of each target, once measured; empty if all have the same noise level.
    of_outputs: Vec<OutputParameters>,
    equations: FactoredEquations,
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

/// State of Bayesian regularisation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Number of epochs so far.
    #[serde(default)]
    epochs: usize,
    /// τ, once measured.
    #[serde(default)]
    correlation_time: Option<f64>,
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

/// Effective number of parameters among the weights of one output.
#[derive(Clone, Copy, Debug)]
struct OutputParameters {
    weights: f64,
    bias: f64,
}

/// State of a group of weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupState {
    alpha: f64,
    effective_parameters: f64,
}

/// Maximum lag in samples; the sum of the correlations ends at the first that is not positive.
const MAX_LAG: usize = 50;

impl Checked for BayesianState {
    fn vectors(&self) -> Vec<&[f64]> {
        Vec::new()
    }
}

impl BayesianState {
    /// Returns `true` if there is one α and one β.
    fn is_plain(&self) -> bool {
        self.further.is_empty() && self.targets.is_empty()
    }

    /// α of each class of weights.
    fn decays(&self, group_of: PerClass<usize>) -> PerClass {
        group_of.map(|group| match group {
            0 => self.alpha,
            group => self.further[group - 1].alpha,
        })
    }

    /// β Σρe² + Σ α Σw², with Σρe² = `mse`·`errors`, and the weights of the scaled network `mlp`.
    fn objective(&self, mse: f64, errors: f64, mlp: &Mlp, (group_of, means): (PerClass<usize>, &[f64])) -> f64 {
        let of_weights = if self.is_plain() {
            self.alpha * sum_of_squares(mlp)
        } else {
            let squares = class_squares(mlp, means).values();
            let products = self.decays(group_of).values().into_iter().zip(squares);
            products.map(|(decay, squares)| decay * squares).sum()
        };
        self.beta * mse * errors + of_weights
    }
}

impl BayesianRegularization {
    /// Number of errors n.
    fn errors(&self) -> f64 {
        self.examples.errors()
    }

    /// Number of independent errors among `errors` that are left to estimate the noise.
    fn free(&self, errors: f64, gamma: f64) -> f64 {
        /// Minimum share of the errors left to estimate the noise.
        const MIN_FREE: f64 = 0.1;
        match self.state.correlation_time {
            None if self.state.targets.is_empty() => errors - gamma,
            time => {
                let independent = errors / time.unwrap_or(1.0);
                (independent - gamma).max(MIN_FREE * independent)
            }
        }
    }

    /// Updates each α, and β, from γ. Each is 1 if the formula gives no positive number, and is limited so that the
    /// ratio of any two cannot overflow.
    fn update_weighting(&mut self) {
        let gamma = self.state.effective_parameters;
        let determined = self.free(self.errors(), gamma);
        let bounded = |value: f64| {
            if value > 0.0 && value.is_finite() {
                value.clamp(1e-150, 1e150)
            } else {
                1.0
            }
        };
        if self.state.is_plain() {
            self.state.alpha = bounded(gamma / (2.0 * sum_of_squares(&self.scaled)));
        } else {
            let squares = self.by_group(class_squares(&self.scaled, &self.scaled_means()), |squares| squares);
            let further: f64 = self.state.further.iter().map(|group| group.effective_parameters).sum();
            let of_outputs = Vec::from_iter((0..squares.len()).map(|group| self.alpha_of_outputs(group)));
            self.state.alpha = bounded(of_outputs[0].unwrap_or((gamma - further) / (2.0 * squares[0])));
            for (number, group) in self.state.further.iter_mut().enumerate() {
                let shared = group.effective_parameters / (2.0 * squares[number + 1]);
                group.alpha = bounded(of_outputs[number + 1].unwrap_or(shared));
            }
        }
        self.state.beta = bounded(determined / (2.0 * self.weighted_mse * self.errors()));
    }

    /// Returns α of a group that has only weights of outputs: the lowest among single targets. `None` for another
    /// group, or if all targets have the same noise level.
    ///
    /// In units of its noise, a target without information has small weights that the data determine well. In a common
    /// α, it would shrink the weights of the others.
    fn alpha_of_outputs(&self, group: usize) -> Option<f64> {
        let PerClass {
            hidden_weights,
            hidden_biases,
            output_weights,
            output_biases,
        } = self.group_of;
        if group == hidden_weights || group == hidden_biases {
            return None;
        }
        let Shape { hidden, outputs, .. } = self.scaled.shape();
        let (weights, means) = (self.scaled.layers().1, self.scaled_means());
        let (nodes, biases) = weights.split_at(hidden * outputs);
        let of_target = |(target, parameters): (usize, &OutputParameters)| {
            let (mut gamma, mut squares) = (0.0, 0.0);
            if group == output_weights {
                gamma += parameters.weights;
                squares += nodes
                    .iter()
                    .skip(target)
                    .step_by(outputs)
                    .map(|weight| weight * weight)
                    .sum::<f64>();
            }
            if group == output_biases {
                gamma += parameters.bias;
                squares += (biases[target] - means.get(target).unwrap_or(&0.0)).powi(2);
            }
            gamma / (2.0 * squares)
        };
        let alphas = self.of_outputs.iter().enumerate().map(of_target);
        alphas
            .filter(|alpha| alpha.is_finite() && *alpha > 0.0)
            .reduce(f64::min)
    }

    /// Updates the noise level of each target at the weights of `mlp`, if each has its own.
    fn update_precisions(&mut self, mlp: &Mlp) {
        /// Standard deviation, in scaled units, below which the noise of a target is taken as this, so that a target
        /// without noise does not outweigh the others.
        const MIN_NOISE: f64 = 1e-4;
        if self.state.targets.is_empty() {
            return;
        }
        let squares = self.equations.squares_of_targets(mlp, &self.examples);
        let samples = self.examples.samples() as f64;
        let betas: Vec<f64> = squares
            .iter()
            .zip(&self.state.targets)
            .map(|(squares, target)| {
                self.free(samples, target.effective_parameters) / squares.max(samples * MIN_NOISE * MIN_NOISE)
            })
            .collect();
        let mean = betas.iter().sum::<f64>() / betas.len() as f64;
        for (target, beta) in self.state.targets.iter_mut().zip(betas) {
            target.precision = beta / mean;
        }
        self.scale_targets(mlp);
    }

    /// Multiplies the output weights of `mlp` by √ρ in [`Self::scaled`].
    fn scale_targets(&mut self, mlp: &Mlp) {
        self.roots = self
            .state
            .targets
            .iter()
            .map(|target| target.precision.sqrt())
            .collect();
        scale_outputs(&mut self.scaled, mlp, &self.roots);
    }

    /// ρ of each target; empty if all have the same noise level.
    fn precisions(&self) -> Vec<f64> {
        self.state.targets.iter().map(|target| target.precision).collect()
    }

    /// Means of the targets multiplied by √ρ.
    fn scaled_means(&self) -> Vec<f64> {
        let mut means = self.means.clone();
        means.iter_mut().zip(&self.roots).for_each(|(mean, root)| *mean *= root);
        means
    }

    /// Gathers the equations at the weights of `mlp`.
    fn gather(&mut self, mlp: &Mlp) {
        let precisions = self.precisions();
        self.mse = self.equations.gather_weighted(mlp, &precisions, &self.examples).mse;
        self.weighted_mse = weighted_mse(&mut self.equations, mlp, &precisions, &self.examples);
    }

    /// Sums over the classes of each group.
    fn by_group<T: Copy>(&self, classes: PerClass<T>, value: impl Fn(T) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; 1 + self.state.further.len()];
        for (group, class) in self.group_of.values().into_iter().zip(classes.values()) {
            sums[group] += value(class);
        }
        sums
    }

    /// Measures γ at the current weights; γ keeps its value if the trace is lost in rounding.
    fn measure_effective_parameters(&mut self) {
        let BayesianState { alpha, beta, .. } = self.state;
        if self.state.is_plain() {
            if let Some(trace) = self.equations.trace_of_inverse(&self.scaled, alpha / beta) {
                let weights = self.step.len() as f64;
                self.state.effective_parameters = (weights - alpha / beta * trace).clamp(0.0, weights);
            }
            return;
        }
        let decays = self.state.decays(self.group_of).map(|alpha| alpha / beta);
        let Some(traces) = self.equations.traces_of_inverse(&self.scaled, decays) else {
            return;
        };
        let sizes = self.by_group(class_sizes(self.scaled.shape()), |size| size as f64);
        let decayed = decays.times(traces.classes());
        let decayed = self.by_group(decayed, |decayed| decayed);
        let groups: Vec<f64> = sizes
            .iter()
            .zip(decayed)
            .map(|(size, decayed)| (size - decayed).clamp(0.0, *size))
            .collect();
        for (group, effective) in self.state.further.iter_mut().zip(&groups[1..]) {
            group.effective_parameters = *effective;
        }
        self.state.effective_parameters = groups.iter().sum();
        self.share_out(decays, &traces);
    }

    /// Shares γ out among the targets that have their own noise level.
    fn share_out(&mut self, decays: PerClass, traces: &Traces) {
        let Shape {
            inputs,
            hidden,
            outputs,
        } = self.scaled.shape();
        let of_inputs = (inputs * hidden) as f64 - decays.hidden_weights * traces.hidden_weights;
        let of_hidden = (of_inputs + hidden as f64 - decays.hidden_biases * traces.hidden_biases).max(0.0);
        let mut shares = vec![0.0; outputs];
        let output_weights = &self.scaled.layers().1[..hidden * outputs];
        for (index, weight) in output_weights.iter().enumerate() {
            shares[index % outputs] += weight * weight;
        }
        let sum: f64 = shares.iter().sum();
        let of_output = |traces: &OutputTraces| OutputParameters {
            weights: (hidden as f64 - decays.output_weights * traces.weights).max(0.0),
            bias: (1.0 - decays.output_biases * traces.bias).max(0.0),
        };
        self.of_outputs.clear();
        if self.state.targets.is_empty() {
            return;
        }
        self.of_outputs.extend(traces.outputs.iter().map(of_output));
        for ((target, own), share) in self.state.targets.iter_mut().zip(&self.of_outputs).zip(shares) {
            let share = if sum > 0.0 { share / sum } else { 1.0 / outputs as f64 };
            target.effective_parameters = own.weights + own.bias + share * of_hidden;
        }
    }

    /// Returns the current error with the gradient of F / (β n).
    fn regularized(&self) -> Evaluation {
        let beta = self.state.beta;
        let decays = self.state.decays(self.group_of).map(|alpha| alpha / beta);
        let means = self.scaled_means();
        let length = self.equations.gradient_length(&self.scaled, Decay::new(decays, &means));
        Evaluation {
            mse: self.mse,
            gradient_norm: 2.0 * length / self.errors(),
        }
    }
}

/// Sets `scaled` to `mlp` with the weights of each output multiplied by its root; without roots, to `mlp`.
fn scale_outputs(scaled: &mut Mlp, mlp: &Mlp, roots: &[f64]) {
    let hidden_weights = mlp.shape().hidden_weights();
    let scaled = scaled.weights_mut();
    scaled.copy_from_slice(mlp.weights());
    if !roots.is_empty() {
        let outputs = scaled[hidden_weights..].iter_mut().zip(roots.iter().cycle());
        outputs.for_each(|(weight, root)| *weight *= root);
    }
}

/// Returns the mean of ρe², or of e² without precisions.
fn weighted_mse(equations: &mut FactoredEquations, mlp: &Mlp, precisions: &[f64], examples: &Examples) -> f64 {
    if precisions.is_empty() {
        return equations.mse(mlp, examples);
    }
    let squares = equations.squares_of_targets(mlp, examples);
    let weighted = squares
        .iter()
        .zip(precisions)
        .map(|(squares, precision)| squares * precision);
    weighted.sum::<f64>() / examples.errors()
}

impl Algorithm for BayesianRegularization {
    type Settings = RegularizationSettings;
    type State = BayesianState;

    const DESCRIPTION: Description = Description {
        short_name: "br",
        name: "Bayesian regularisation",
        summary: "Levenberg-Marquardt with a penalty on the weights whose strength is estimated from the data: for few or \
                  noisy samples.",
        parameter_name: "mu",
        remedy: "try another seed, more samples, or Levenberg-Marquardt (lm)",
    };

    fn check(settings: &RegularizationSettings) -> Result<(), SettingError> {
        settings.damping().check()
    }

    fn equations_bytes(shape: Shape, samples: usize) -> usize {
        FactoredEquations::factored_bytes(shape, samples).saturating_add(FactoredEquations::inverse_bytes(shape))
    }

    fn epoch_multiplications(shape: Shape, samples: usize) -> f64 {
        FactoredEquations::factored_multiplications(shape, samples) + FactoredEquations::trace_multiplications(shape)
    }

    /// Starts with γ = N, as if the data determined all weights.
    fn new(settings: RegularizationSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut equations = FactoredEquations::factored(mlp.shape(), examples);
        let evaluation = equations.gather(mlp, examples);
        let weights = mlp.weights().len();
        let group_of = settings.group_of_classes();
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
            let sizes = class_sizes(mlp.shape()).values();
            let classes = group_of.values().into_iter().zip(sizes);
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

    fn restore(&mut self, state: BayesianState) {
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
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let weighting = self.state.clone();
        let (precisions, means, errors) = (self.precisions(), self.scaled_means(), self.errors());
        let (beta, prior) = (weighting.beta, (self.group_of, &means[..]));
        let alphas = weighting.decays(self.group_of);
        let objective = weighting.objective(self.weighted_mse, errors, &self.scaled, prior);
        let hidden_weights = mlp.shape().hidden_weights();
        self.damping.search(&mut self.state.mu, |mu| {
            let damping = alphas.map(|alpha| (mu + alpha) / beta);
            let decay = Decay::new(alphas.map(|alpha| alpha / beta), prior.1);
            self.equations
                .solve_with_decay(&self.scaled, examples, damping, decay, &mut self.step)?;
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

    fn state(&self) -> BayesianState {
        self.state.clone()
    }
}

/// Σw².
fn sum_of_squares(mlp: &Mlp) -> f64 {
    mlp.weights().iter().map(|weight| weight * weight).sum()
}

settings! {
    /// Settings of Bayesian regularisation: the damping mu, as in [`Damping`], and the correlation of errors.
    #[serde(default)]
    pub struct RegularizationSettings {
        mu: "mu" = 0.005, in 1e-20..=1e300,
            "Initial damping. Large: short steps down the gradient; small: full Gauss-Newton steps.";
        mu_decrease: "mu decrease" = 0.1, in 1e-6..=0.999,
            "Factor on mu after a step that lowers the error.";
        mu_increase: "mu increase" = 10.0, in 1.001..=1e6,
            "Factor on mu after a step that does not lower the error.";
        mu_max: "largest mu" = 1e10, in 1e-20..=1e300,
            "Training ends when mu exceeds this: no step lowers the error any more.";
        correlation_epoch [WHOLE]: "correlation epoch" = 0.0, in 0.0..=1e6,
            "Epoch after which the correlation of neighbouring errors is measured, as in a recording: from then on fewer \
             errors count as independent, and weights are smaller. 0: never.";
        groups [WHOLE]: "groups of weights" = 1.0, in 1.0..=4.0,
            "Groups of weights, each with its own strength of regularisation. 1: all together. 2: hidden layer and output \
             layer. 3: the biases of the hidden layer separate, too. 4: all biases separate. From 2 on, output biases are \
             drawn towards the means of the targets, not towards 0.";
        own_noise [WHOLE]: "own noise" = 0.0, in 0.0..=1.0,
            "1: every target has its own noise level, so that a noisy or jittering target does not spoil the others, if \
             there are at least as many samples as weights. 0: one noise level for all.";
    }
}

impl RegularizationSettings {
    /// Settings for recordings, whose samples are few for the number of weights and whose targets have any units and
    /// noise.
    ///
    /// The correlation of errors is not measured: in a recording it is mostly a systematic error, such as hysteresis,
    /// which a raster scan or a slow press makes look like lost samples. On recordings of five sensors the correction
    /// never lowered the test error by more than the difference between two seeds, and raised it by up to 20 %.
    pub fn recorded() -> Self {
        Self {
            groups: 4.0,
            own_noise: 1.0,
            ..Self::default()
        }
    }

    /// Group of each class of weights, from 0.
    pub(super) fn group_of_classes(&self) -> PerClass<usize> {
        let [hidden_weights, hidden_biases, output_weights, output_biases] = match self.groups as usize {
            ..=1 => [0, 0, 0, 0],
            2 => [0, 0, 1, 1],
            3 => [0, 1, 2, 2],
            _ => [0, 1, 2, 3],
        };
        PerClass {
            hidden_weights,
            hidden_biases,
            output_weights,
            output_biases,
        }
    }

    pub(super) fn damping(&self) -> Damping {
        let &Self {
            mu,
            mu_decrease,
            mu_increase,
            mu_max,
            correlation_epoch: _,
            groups: _,
            own_noise: _,
        } = self;
        Damping {
            mu,
            mu_decrease,
            mu_increase,
            mu_max,
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::linalg::solvers::Llt;
    use ndarray::{Array2, ArrayView2, Axis};
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{
        network::nguyen_widrow,
        training::{
            Method, Problem, StoppingRules, Trainer, TrainingSettings, method::Running, normal_equations::dense,
        },
    };

    /// Returns the effective number of parameters after 60 epochs on a curve with autoregressive noise.
    fn effective_parameters(memory: f64, correlation_epoch: f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let inputs = Array2::from_shape_fn((300, 1), |(sample, _)| (sample as f64 / 150.0) - 1.0);
        let mut noise = 0.0;
        let targets = inputs.mapv(|x: f64| {
            noise = memory * noise + (1.0_f64 - memory * memory).sqrt() * rng.random_range(-0.5..0.5);
            (3.0 * x).sin() + noise
        });
        let shape = Shape {
            inputs: 1,
            hidden: 10,
            outputs: 1,
        };
        let problem = Problem {
            training: Examples::new(inputs.view(), targets.view()),
            validation: None,
            test: None,
        };
        let settings = TrainingSettings {
            method: Method::BayesianRegularization(RegularizationSettings {
                correlation_epoch,
                ..RegularizationSettings::default()
            }),
            stopping: StoppingRules {
                epochs: 60,
                ..StoppingRules::default()
            },
        };
        let mut trainer = Trainer::new(nguyen_widrow(shape, &mut rng), problem, settings).unwrap();
        while trainer.step().is_none() {}
        trainer.latest().effective_parameters.unwrap()
    }

    #[test]
    fn correlated_errors_determine_fewer_weights_once_the_correlation_is_measured() {
        let (never, measured) = (effective_parameters(0.9, 0.0), effective_parameters(0.9, 20.0));
        assert!(measured < 0.9 * never, "{measured} {never}");
        let (never, measured) = (effective_parameters(0.0, 0.0), effective_parameters(0.0, 20.0));
        assert!((measured / never - 1.0).abs() < 0.15, "{measured} {never}");
    }

    /// The training error has its minimum where the weights fit the noise; the regularised error continues to fall.
    #[test]
    fn without_validation_the_latest_weights_are_the_best() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let inputs = Array2::from_shape_fn((20, 3), |_| rng.random_range(-1.0..1.0));
        let targets = Array2::from_shape_fn((20, 2), |_| rng.random_range(-0.3..0.9));
        let shape = Shape {
            inputs: 3,
            hidden: 6,
            outputs: 2,
        };
        for groups in [1.0, 2.0, 3.0, 4.0] {
            let settings = TrainingSettings {
                method: Method::BayesianRegularization(RegularizationSettings {
                    groups,
                    ..RegularizationSettings::default()
                }),
                stopping: StoppingRules {
                    epochs: 100,
                    ..StoppingRules::default()
                },
            };
            let problem = Problem {
                training: Examples::new(inputs.view(), targets.view()),
                validation: None,
                test: None,
            };
            let start = nguyen_widrow(shape, &mut ChaCha8Rng::seed_from_u64(1));
            let mut trainer = Trainer::new(start, problem, settings).unwrap();
            while trainer.step().is_none() {}
            assert_eq!(trainer.best().weights(), trainer.present().weights(), "{groups}");
        }
    }

    /// Samples × 3 inputs, and targets: two smooth functions with noise of 1 %, then two constants with a jitter of the
    /// size of their rounding, then white noise, each scaled to [−1, 1].
    fn good_and_bad_targets(samples: usize, seed: u64) -> (Array2<f64>, Array2<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let inputs = Array2::from_shape_simple_fn((samples, 3), || rng.random_range(-1.0..1.0));
        let targets = Array2::from_shape_fn((samples, 5), |(sample, target)| {
            let (x, y, z): (f64, f64, f64) = (inputs[[sample, 0]], inputs[[sample, 1]], inputs[[sample, 2]]);
            let noise: f64 = rng.random_range(-1.0..1.0);
            match target {
                0 => 0.6 * (2.0 * x + y).sin() + 0.3 * z + 0.01 * noise,
                1 => 0.7 * (1.5 * y * z).tanh() - 0.2 * x + 0.01 * noise,
                2 | 3 => (1.5 * noise).round(),
                _ => noise,
            }
        });
        (inputs, targets)
    }

    fn problem(inputs: &Array2<f64>, targets: ArrayView2<'_, f64>) -> Problem {
        Problem {
            training: Examples::new(inputs.view(), targets),
            validation: None,
            test: None,
        }
    }

    fn trained(problem: Problem, hidden: usize, settings: RegularizationSettings, epochs: usize) -> Trainer {
        let shape = Shape {
            inputs: problem.training.inputs(),
            hidden,
            outputs: problem.training.outputs(),
        };
        let settings = TrainingSettings {
            method: Method::BayesianRegularization(settings),
            stopping: StoppingRules {
                epochs,
                ..StoppingRules::default()
            },
        };
        let start = nguyen_widrow(shape, &mut ChaCha8Rng::seed_from_u64(1));
        let mut trainer = Trainer::new(start, problem, settings).unwrap();
        while trainer.step().is_none() {}
        trainer
    }

    /// Root mean square of the errors of the first two targets on samples that were not used for training.
    fn error_of_good_targets(targets: usize, own_noise: f64) -> f64 {
        let (inputs, all) = good_and_bad_targets(300, 8);
        let settings = RegularizationSettings {
            own_noise,
            ..RegularizationSettings::recorded()
        };
        let trainer = trained(
            problem(&inputs, all.select(Axis(1), &Vec::from_iter(0..targets)).view()),
            8,
            settings,
            150,
        );
        let (inputs, all) = good_and_bad_targets(1000, 9);
        let good = |values: &Array2<f64>| values.select(Axis(1), &[0, 1]);
        let errors = good(&trainer.best().forward(inputs.view())) - good(&all);
        (errors.mapv(|error| error * error).mean().unwrap()).sqrt()
    }

    #[test]
    fn targets_without_information_leave_the_others_as_they_are() {
        let alone = error_of_good_targets(2, 1.0);
        assert!(alone < 0.02, "{alone}");
        let together = error_of_good_targets(5, 1.0);
        assert!(together < 1.1 * alone, "{together} {alone}");
        let coupled = error_of_good_targets(5, 0.0);
        assert!(coupled > 2.0 * alone, "{coupled} {alone}");
    }

    /// Half the logarithm of the determinant of a positive definite matrix.
    fn half_log_determinant(matrix: &faer::Mat<f64>) -> f64 {
        let factor = Llt::new(matrix.as_ref(), faer::Side::Lower).unwrap();
        (0..matrix.nrows()).map(|index| factor.L()[(index, index)].ln()).sum()
    }

    /// Compares α and each βₜ with the maximum of the evidence, whose Hessian is formed from the dense Jacobian
    /// (MacKay 1992): `ln p = −Σₜ βₜ Σeₜ² − Σ αw² − ½ ln det A + ½ Σ samples ln βₜ + ½ N ln α`, with
    /// A = Σₜ βₜ JₜᵀJₜ + α ρₜ at the weights of target t, and α at those of the hidden layer.
    #[test]
    fn noise_levels_and_decay_maximise_the_evidence() {
        let (inputs, all) = good_and_bad_targets(200, 3);
        let targets = all.select(Axis(1), &[0, 1, 4]);
        let settings = RegularizationSettings {
            own_noise: 1.0,
            ..RegularizationSettings::default()
        };
        let trainer = trained(problem(&inputs, targets.view()), 4, settings, 400);
        let Running::BayesianRegularization(method) = &trainer.algorithm else {
            panic!("another method");
        };
        let (mlp, state) = (trainer.present(), &method.state);
        let examples = Examples::new(inputs.view(), targets.view());
        let (jacobian, errors) = (dense::jacobian(mlp, &examples), dense::errors(mlp, &examples));
        let (weights, hidden_weights, outputs) = (mlp.weights().len(), mlp.shape().hidden_weights(), 3);
        // The prior remains that of the trained precisions while a noise level is varied.
        let precision = |index: usize| {
            if index < hidden_weights {
                1.0
            } else {
                state.targets[(index - hidden_weights) % outputs].precision
            }
        };
        let evidence = |alpha: f64, betas: [f64; 3]| {
            let a = faer::Mat::from_fn(weights, weights, |row, column| {
                let products = (0..jacobian.nrows())
                    .map(|error| betas[error % outputs] * jacobian[(error, row)] * jacobian[(error, column)]);
                let decay = if row == column { alpha * precision(row) } else { 0.0 };
                products.sum::<f64>() + decay
            });
            let fit: f64 = (0..errors.nrows())
                .map(|row| betas[row % outputs] * errors[(row, 0)].powi(2))
                .sum();
            let size: f64 = mlp
                .weights()
                .iter()
                .enumerate()
                .map(|(index, weight)| precision(index) * weight * weight)
                .sum();
            let logs = betas.iter().map(|beta| beta.ln()).sum::<f64>() * 200.0 + weights as f64 * alpha.ln();
            -fit - alpha * size - half_log_determinant(&a) + 0.5 * logs
        };
        let betas = [0, 1, 2].map(|target: usize| state.beta * state.targets[target].precision);
        let slope = |change: &dyn Fn(f64) -> f64| (change(1e-4) - change(-1e-4)) / 2e-4;
        let of_alpha = slope(&|step| evidence(state.alpha * (1.0 + step), betas));
        // The slope without the term of the logarithms is half the number of weights.
        assert!(of_alpha.abs() < 0.01 * weights as f64, "{of_alpha}");
        for target in 0..outputs {
            let of_beta = slope(&|step| {
                let mut betas = betas;
                betas[target] *= 1.0 + step;
                evidence(state.alpha, betas)
            });
            // γ of the hidden layer is shared out approximately.
            assert!(of_beta.abs() < 0.02 * 200.0, "{target}: {of_beta}");
        }
        let shares: f64 = state.targets.iter().map(|target| target.effective_parameters).sum();
        assert!((shares / state.effective_parameters - 1.0).abs() < 1e-9, "{shares}");
    }

    #[test]
    fn a_training_with_noise_levels_resumes_with_the_same_bits() {
        let (inputs, targets) = good_and_bad_targets(100, 2);
        let problem = problem(&inputs, targets.view());
        let mut first = trained(problem.clone(), 5, RegularizationSettings::recorded(), 12);
        let state = serde_json::to_string(&first.state()).unwrap();
        let mut resumed = Trainer::resume(serde_json::from_str(&state).unwrap(), problem).unwrap();
        for trainer in [&mut first, &mut resumed] {
            let stopping = StoppingRules {
                epochs: 30,
                ..StoppingRules::default()
            };
            trainer.set_stopping(stopping).unwrap();
            while trainer.step().is_none() {}
        }
        assert_eq!(first.present().weights(), resumed.present().weights());
    }
}
