//! Strengths of regularisation and noise levels, estimated from the data after every accepted step.

use super::{
    BayesianRegularization,
    state::{BayesianState, sum_of_squares},
};
use crate::{
    network::{Mlp, Shape},
    training::{
        Evaluation, Examples,
        normal_equations::{
            Classes, HIDDEN_BIASES, HIDDEN_WEIGHTS, NormalEquations, OUTPUT_BIASES, OUTPUT_WEIGHTS, OutputTraces,
            Traces, class_sizes, class_squares, decay_slopes,
        },
    },
};

/// Effective number of parameters among the weights of one output.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutputParameters {
    pub(super) weights: f64,
    pub(super) bias: f64,
}

impl BayesianRegularization {
    /// Number of errors n.
    pub(super) fn errors(&self) -> f64 {
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
    pub(super) fn update_weighting(&mut self) {
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
        if group == self.group_of[HIDDEN_WEIGHTS] || group == self.group_of[HIDDEN_BIASES] {
            return None;
        }
        let Shape { hidden, outputs, .. } = self.scaled.shape();
        let (weights, means) = (self.scaled.layers().1, self.scaled_means());
        let (nodes, biases) = weights.split_at(hidden * outputs);
        let of_target = |(target, parameters): (usize, &OutputParameters)| {
            let (mut gamma, mut squares) = (0.0, 0.0);
            if group == self.group_of[OUTPUT_WEIGHTS] {
                gamma += parameters.weights;
                squares += nodes
                    .iter()
                    .skip(target)
                    .step_by(outputs)
                    .map(|weight| weight * weight)
                    .sum::<f64>();
            }
            if group == self.group_of[OUTPUT_BIASES] {
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
    pub(super) fn update_precisions(&mut self, mlp: &Mlp) {
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
    pub(super) fn scale_targets(&mut self, mlp: &Mlp) {
        self.roots = self
            .state
            .targets
            .iter()
            .map(|target| target.precision.sqrt())
            .collect();
        scale_outputs(&mut self.scaled, mlp, &self.roots);
    }

    /// ρ of each target; empty if all have the same noise level.
    pub(super) fn precisions(&self) -> Vec<f64> {
        self.state.targets.iter().map(|target| target.precision).collect()
    }

    /// Means of the targets multiplied by √ρ.
    pub(super) fn scaled_means(&self) -> Vec<f64> {
        let mut means = self.means.clone();
        means.iter_mut().zip(&self.roots).for_each(|(mean, root)| *mean *= root);
        means
    }

    /// Gathers the equations at the weights of `mlp`.
    pub(super) fn gather(&mut self, mlp: &Mlp) {
        let precisions = self.precisions();
        self.mse = self.equations.gather(mlp, &precisions, &self.examples).mse;
        self.weighted_mse = weighted_mse(&mut self.equations, mlp, &precisions, &self.examples);
    }

    /// Sums over the classes of each group.
    fn by_group<T: Copy>(&self, classes: Classes<T>, value: impl Fn(T) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; 1 + self.state.further.len()];
        for (group, class) in self.group_of.into_iter().zip(classes) {
            sums[group] += value(class);
        }
        sums
    }

    /// Measures γ at the current weights; γ keeps its value if the trace is lost in rounding.
    pub(super) fn measure_effective_parameters(&mut self) {
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
        let classes = traces.classes();
        let decayed = std::array::from_fn(|class| decays[class] * classes[class]);
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
    fn share_out(&mut self, decays: Classes, traces: &Traces) {
        let Shape {
            inputs,
            hidden,
            outputs,
        } = self.scaled.shape();
        let of_inputs = (inputs * hidden) as f64 - decays[HIDDEN_WEIGHTS] * traces.hidden_weights;
        let of_hidden = (of_inputs + hidden as f64 - decays[HIDDEN_BIASES] * traces.hidden_biases).max(0.0);
        let mut shares = vec![0.0; outputs];
        let output_weights = &self.scaled.layers().1[..hidden * outputs];
        for (index, weight) in output_weights.iter().enumerate() {
            shares[index % outputs] += weight * weight;
        }
        let sum: f64 = shares.iter().sum();
        let of_output = |traces: &OutputTraces| OutputParameters {
            weights: (hidden as f64 - decays[OUTPUT_WEIGHTS] * traces.weights).max(0.0),
            bias: (1.0 - decays[OUTPUT_BIASES] * traces.bias).max(0.0),
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
    pub(super) fn regularized(&self) -> Evaluation {
        let beta = self.state.beta;
        let decays = self.state.decays(self.group_of).map(|alpha| alpha / beta);
        let means = self.scaled_means();
        let length = self
            .equations
            .gradient_length(&decay_slopes(&self.scaled, decays, &means));
        Evaluation {
            mse: self.mse,
            gradient_norm: 2.0 * length / self.errors(),
        }
    }
}

/// Sets `scaled` to `mlp` with the weights of each output multiplied by its root; without roots, to `mlp`.
pub(super) fn scale_outputs(scaled: &mut Mlp, mlp: &Mlp, roots: &[f64]) {
    let hidden_weights = mlp.shape().hidden_weights();
    let scaled = scaled.weights_mut();
    scaled.copy_from_slice(mlp.weights());
    if !roots.is_empty() {
        let outputs = scaled[hidden_weights..].iter_mut().zip(roots.iter().cycle());
        outputs.for_each(|(weight, root)| *weight *= root);
    }
}

/// Returns the mean of ρe², or of e² without precisions.
pub(super) fn weighted_mse(equations: &mut NormalEquations, mlp: &Mlp, precisions: &[f64], examples: &Examples) -> f64 {
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
