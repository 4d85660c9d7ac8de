//! Bayesian regularisation (`trainbr`).

use serde::{Deserialize, Serialize};

use super::{
    Damping, Evaluation, Examples, FactoredEquations, SettingError, StopReason,
    method::{Algorithm, Checked, Description, add_step},
    normal_equations::{Decay, PerClass, class_sizes, class_squares},
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
    equations: FactoredEquations,
    /// Number of errors n.
    errors: f64,
    mse: f64,
    step: Vec<f64>,
    candidate: Mlp,
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
    /// α of each class of weights.
    fn decays(&self, group_of: PerClass<usize>) -> PerClass {
        group_of.map(|group| match group {
            0 => self.alpha,
            group => self.further[group - 1].alpha,
        })
    }

    /// β Σe² + Σ α Σw², with Σe² = `mse`·`errors`.
    fn objective(&self, mse: f64, errors: f64, mlp: &Mlp, (group_of, means): (PerClass<usize>, &[f64])) -> f64 {
        let of_weights = if self.further.is_empty() {
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
    /// Updates each α, and β, from γ. Each is 1 if the formula gives no positive number, and is limited so that the
    /// ratio of any two cannot overflow.
    fn update_weighting(&mut self, mlp: &Mlp) {
        let gamma = self.state.effective_parameters;
        let determined = match self.state.correlation_time {
            None => self.errors - gamma,
            Some(time) => {
                /// Minimum share of the errors left to estimate the noise.
                const MIN_FREE: f64 = 0.1;
                let independent = self.errors / time;
                (independent - gamma).max(MIN_FREE * independent)
            }
        };
        let bounded = |value: f64| {
            if value > 0.0 && value.is_finite() {
                value.clamp(1e-150, 1e150)
            } else {
                1.0
            }
        };
        if self.state.further.is_empty() {
            self.state.alpha = bounded(gamma / (2.0 * sum_of_squares(mlp)));
        } else {
            let squares = self.by_group(class_squares(mlp, &self.means), |squares| squares);
            let further: f64 = self.state.further.iter().map(|group| group.effective_parameters).sum();
            self.state.alpha = bounded((gamma - further) / (2.0 * squares[0]));
            for (group, squares) in self.state.further.iter_mut().zip(&squares[1..]) {
                group.alpha = bounded(group.effective_parameters / (2.0 * squares));
            }
        }
        self.state.beta = bounded(determined / (2.0 * self.mse * self.errors));
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
    fn measure_effective_parameters(&mut self, mlp: &Mlp) {
        let BayesianState { alpha, beta, .. } = self.state;
        if self.state.further.is_empty() {
            if let Some(trace) = self.equations.trace_of_inverse(mlp, alpha / beta) {
                let weights = self.step.len() as f64;
                self.state.effective_parameters = (weights - alpha / beta * trace).clamp(0.0, weights);
            }
            return;
        }
        let decays = self.state.decays(self.group_of).map(|alpha| alpha / beta);
        let Some(traces) = self.equations.traces_of_inverse(mlp, decays) else {
            return;
        };
        let sizes = self.by_group(class_sizes(mlp.shape()), |size| size as f64);
        let decayed = decays.times(traces);
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
    }

    /// Returns the current error with the gradient of F / (β n).
    fn regularized(&self, mlp: &Mlp) -> Evaluation {
        let beta = self.state.beta;
        let decays = self.state.decays(self.group_of).map(|alpha| alpha / beta);
        Evaluation {
            mse: self.mse,
            gradient_norm: 2.0 * self.equations.gradient_length(mlp, Decay::new(decays, &self.means)) / self.errors,
        }
    }
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
            },
            equations,
            errors: examples.errors(),
            mse: evaluation.mse,
            step: vec![0.0; weights],
            candidate: mlp.clone(),
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
        method.update_weighting(mlp);
        let evaluation = method.regularized(mlp);
        (method, evaluation)
    }

    fn restore(&mut self, state: BayesianState) {
        let groups = std::mem::replace(&mut self.state, state);
        // A state has as many groups as the settings it was saved with, unless it is damaged.
        let missing = groups.further.get(self.state.further.len()..).unwrap_or_default();
        self.state.further.extend_from_slice(missing);
        self.state.further.truncate(groups.further.len());
    }

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let weighting = self.state.clone();
        let (beta, prior) = (weighting.beta, (self.group_of, &self.means[..]));
        let alphas = weighting.decays(self.group_of);
        let objective = weighting.objective(self.mse, self.errors, mlp, prior);
        self.mse = self.damping.search(&mut self.state.mu, |mu| {
            let damping = alphas.map(|alpha| (mu + alpha) / beta);
            let decay = Decay::new(alphas.map(|alpha| alpha / beta), prior.1);
            self.equations
                .solve_with_decay(mlp, examples, damping, decay, &mut self.step)?;
            add_step(&mut self.candidate, mlp, &self.step);
            let mse = self.equations.mse(&self.candidate, examples);
            // False for NaN.
            (weighting.objective(mse, self.errors, &self.candidate, prior) < objective).then_some(mse)
        })?;
        std::mem::swap(mlp, &mut self.candidate);
        self.equations.gather(mlp, examples);
        self.measure_effective_parameters(mlp);
        self.state.epochs += 1;
        if self.state.epochs == self.correlation_epoch {
            self.state.correlation_time = Some(correlation_time(mlp, examples, MAX_LAG));
        }
        self.update_weighting(mlp);
        Ok(self.regularized(mlp))
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
    }
}

impl RegularizationSettings {
    /// Before this epoch, an incomplete fit makes errors look more correlated than they are.
    const EPOCH_OF_RECORDINGS: f64 = 200.0;

    /// Settings for samples in the order of recording, which are few for the number of weights and have any units.
    pub fn recorded() -> Self {
        Self {
            correlation_epoch: Self::EPOCH_OF_RECORDINGS,
            groups: 4.0,
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
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{
        network::nguyen_widrow,
        training::{Method, Problem, StoppingRules, Trainer, TrainingSettings},
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
}
