//! Strengths of regularisation and noise levels, estimated from the data after every accepted step.

use super::BayesianRegularization;
use crate::{
    network::{Mlp, Shape},
    training::{
        Evaluation,
        normal_equations::{
            Classes, HIDDEN_BIASES, HIDDEN_WEIGHTS, OUTPUT_BIASES, OUTPUT_WEIGHTS, class_sizes, class_squares,
            decay_slopes, length,
        },
    },
};

impl BayesianRegularization {
    /// Number of independent errors among `errors` that are left to estimate the noise.
    fn free(&self, errors: f64, gamma: f64) -> f64 {
        /// Minimum share of the errors left to estimate the noise.
        const MIN_FREE: f64 = 0.1;
        match self.state.targets.is_empty() {
            true => errors - gamma,
            false => (errors - gamma).max(MIN_FREE * errors),
        }
    }

    /// Updates each α, and β, from γ. Each is 1 if the formula gives no positive number, and is limited so that the
    /// ratio of any two cannot overflow.
    pub(super) fn update_weighting(&mut self) {
        let bounded = |value: f64| {
            let is_possible = value > 0.0 && value.is_finite();
            if is_possible { value.clamp(1e-150, 1e150) } else { 1.0 }
        };
        let (gamma, errors) = (self.state.effective_parameters, self.examples.errors());
        let squares = self.by_group(class_squares(&self.scaled, &self.scaled_means()));
        let further = self.state.further.iter().map(|group| group.effective_parameters);
        let mut gammas = vec![gamma - further.clone().sum::<f64>()];
        gammas.extend(further);
        for (group, (gamma, squares)) in gammas.into_iter().zip(squares).enumerate() {
            let alpha = bounded(self.alpha_of_outputs(group).unwrap_or(gamma / (2.0 * squares)));
            match group {
                0 => self.state.alpha = alpha,
                group => self.state.further[group - 1].alpha = alpha,
            }
        }
        self.state.beta = bounded(self.free(errors, gamma) / (2.0 * self.weighted_mse * errors));
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
        let of_group = |values: [f64; 2]| -> f64 {
            let values = [OUTPUT_WEIGHTS, OUTPUT_BIASES].into_iter().zip(values);
            let values = values.filter(|(class, _)| self.group_of[*class] == group);
            values.map(|(_, value)| value).sum()
        };
        let targets = self.of_outputs.iter().zip(self.squares_of_outputs());
        let alphas = targets.map(|(gamma, squares)| of_group(*gamma) / (2.0 * of_group(squares)));
        alphas
            .filter(|alpha| alpha.is_finite() && *alpha > 0.0)
            .reduce(f64::min)
    }

    /// Returns Σw² of the weights and of the bias of each output of the scaled network.
    fn squares_of_outputs(&self) -> Vec<[f64; 2]> {
        let Shape { hidden, outputs, .. } = self.scaled.shape();
        let (nodes, biases) = self.scaled.layers().1.split_at(hidden * outputs);
        let means = self.scaled_means();
        let of_output = |output: usize| {
            let weights = nodes.iter().skip(output).step_by(outputs);
            let distance = biases[output] - means.get(output).unwrap_or(&0.0);
            [weights.map(|weight| weight * weight).sum(), distance * distance]
        };
        (0..outputs).map(of_output).collect()
    }

    /// Updates the noise level of each target at the weights of `mlp`, if each has its own.
    pub(super) fn update_precisions(&mut self, mlp: &Mlp) {
        /// Standard deviation, in scaled units, below which the noise of a target is taken as this, so that a target
        /// without noise does not outweigh the others.
        const MIN_NOISE: f64 = 1e-4;
        if self.state.targets.is_empty() {
            return;
        }
        let samples = self.examples.samples() as f64;
        let squares = self.equations.activations.squares_of_outputs(mlp, &self.examples);
        let of_targets = squares.iter().zip(&self.state.targets).map(|(squares, target)| {
            self.free(samples, target.effective_parameters) / squares.max(samples * MIN_NOISE * MIN_NOISE)
        });
        let betas = Vec::from_iter(of_targets);
        let mean = betas.iter().sum::<f64>() / betas.len() as f64;
        for (target, beta) in self.state.targets.iter_mut().zip(betas) {
            target.precision = beta / mean;
        }
    }

    /// Returns `mlp` with the weights of each output multiplied by √ρ.
    pub(super) fn scaled(&self, mlp: &Mlp) -> Mlp {
        let (mut scaled, hidden_weights) = (mlp.clone(), mlp.shape().hidden_weights());
        let of_outputs = scaled.weights_mut()[hidden_weights..].iter_mut();
        for (weight, precision) in of_outputs.zip(self.precisions.iter().cycle()) {
            *weight *= precision.sqrt();
        }
        scaled
    }

    /// Means of the targets multiplied by √ρ.
    fn scaled_means(&self) -> Vec<f64> {
        let means = self.means.iter().zip(&self.precisions);
        means.map(|(mean, precision)| mean * precision.sqrt()).collect()
    }

    /// Gathers the equations at the weights of `mlp`.
    pub(super) fn gather(&mut self, mlp: &Mlp) {
        for (precision, target) in self.precisions.iter_mut().zip(&self.state.targets) {
            *precision = target.precision;
        }
        self.scaled = self.scaled(mlp);
        self.mse = self.equations.gather(mlp, &self.precisions, &self.examples).mse;
        self.weighted_mse = self.weighted_mse(mlp);
    }

    /// Returns the mean of ρe².
    pub(super) fn weighted_mse(&mut self, mlp: &Mlp) -> f64 {
        let squares = self.equations.activations.squares_of_outputs(mlp, &self.examples);
        let weighted = squares.iter().zip(&self.precisions);
        let sum: f64 = weighted.map(|(squares, precision)| squares * precision).sum();
        sum / self.examples.errors()
    }

    /// Returns β Σρe² + Σ α Σw², with the mean of ρe² and the weights of the scaled network.
    pub(super) fn objective(&self, weighted_mse: f64, scaled: &Mlp) -> f64 {
        let products = self
            .decays()
            .into_iter()
            .zip(class_squares(scaled, &self.scaled_means()));
        let of_weights: f64 = products.map(|(decay, squares)| decay * squares).sum();
        self.state.beta * weighted_mse * self.examples.errors() + of_weights
    }

    /// Returns α of each class of weights.
    pub(super) fn decays(&self) -> Classes {
        self.group_of.map(|group| match group {
            0 => self.state.alpha,
            group => self.state.further[group - 1].alpha,
        })
    }

    /// Returns α/β of each class of weights.
    fn rates(&self) -> Classes {
        self.decays().map(|alpha| alpha / self.state.beta)
    }

    /// Returns half the gradient of F/β with respect to the weights of the scaled network.
    pub(super) fn slopes(&self) -> Vec<f64> {
        let mut slopes = decay_slopes(&self.scaled, self.rates(), &self.scaled_means());
        for (slope, of_errors) in slopes.iter_mut().zip(self.equations.gradient()) {
            *slope += of_errors;
        }
        slopes
    }

    /// Returns the current error with the gradient of F / (β n).
    pub(super) fn regularized(&self) -> Evaluation {
        Evaluation {
            mse: self.mse,
            gradient_norm: 2.0 * length(&self.slopes()) / self.examples.errors(),
        }
    }

    /// Sums over the classes of each group.
    fn by_group(&self, classes: Classes) -> Vec<f64> {
        let mut sums = vec![0.0; 1 + self.state.further.len()];
        for (group, class) in self.group_of.into_iter().zip(classes) {
            sums[group] += class;
        }
        sums
    }

    /// Measures γ at the current weights, and shares it out among the targets that have their own noise level; γ keeps
    /// its value if the trace is lost in rounding.
    pub(super) fn measure_effective_parameters(&mut self) {
        let rates = self.rates();
        let Some(traces) = self.equations.traces_of_inverse(&self.scaled, rates) else {
            return;
        };
        let (shape, of_classes) = (self.scaled.shape(), traces.classes());
        let sizes = class_sizes(shape).map(|size| size as f64);
        let decayed = self.by_group(std::array::from_fn(|class| rates[class] * of_classes[class]));
        let groups = self.by_group(sizes).into_iter().zip(decayed);
        let groups = Vec::from_iter(groups.map(|(size, decayed)| (size - decayed).clamp(0.0, size)));
        for (group, effective) in self.state.further.iter_mut().zip(&groups[1..]) {
            group.effective_parameters = *effective;
        }
        self.state.effective_parameters = groups.iter().sum();
        if self.state.targets.is_empty() {
            return;
        }
        let determined = |size: f64, class: usize, trace: f64| size - rates[class] * trace;
        let of_hidden = determined(sizes[HIDDEN_WEIGHTS], HIDDEN_WEIGHTS, traces.hidden[0])
            + determined(sizes[HIDDEN_BIASES], HIDDEN_BIASES, traces.hidden[1]);
        let of_output = |[weights, bias]: [f64; 2]| {
            let weights = determined(shape.hidden as f64, OUTPUT_WEIGHTS, weights);
            [weights, determined(1.0, OUTPUT_BIASES, bias)].map(|gamma| gamma.max(0.0))
        };
        self.of_outputs = traces.outputs.into_iter().map(of_output).collect();
        let squares = self.squares_of_outputs();
        let sum: f64 = squares.iter().map(|[weights, _]| weights).sum();
        for ((target, [weights, bias]), [share, _]) in self.state.targets.iter_mut().zip(&self.of_outputs).zip(squares)
        {
            let share = if sum > 0.0 {
                share / sum
            } else {
                1.0 / shape.outputs as f64
            };
            target.effective_parameters = weights + bias + share * of_hidden.max(0.0);
        }
    }
}
