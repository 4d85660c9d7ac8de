use glam::DVec3;
use rand::{Rng, RngExt};

use super::{
    factor::{Component, Mixture},
    likelihood::Likelihood,
};
use crate::{
    decoupling::row_problem::RowProblem,
    scene::{LatentRow, Scene, standard_normal},
    sensor::{SensorError, SensorModel},
};

/// Posterior of a row-wire's deformation under the prior of the scene, by importance sampling.
///
/// The prior is that of standard normal variables, which determine the deformation ([`LatentRow`]); the likelihood is
/// exact. The first proposal is the prior itself, with samples that are drawn once for all readings of the row. If
/// too few of them explain the readings, the best are moved towards deformations that do, each by damped Gauss-Newton
/// steps that stay as close to the sample as possible, and samples are proposed from a mixture of Gaussians around
/// them, with the local curvature of the posterior. Further rounds centre the mixture on samples drawn by their
/// weights (population Monte Carlo, Cappé et al. 2004). Weights correct any errors of the proposals, which affect the
/// answer only through its effective sample size.
#[derive(Clone, Debug)]
pub(crate) struct SampledPosterior {
    latent: LatentRow,
    problem: RowProblem,
    likelihood: Likelihood,
    row: usize,
    axes: &'static [usize],
    /// Standard normal variables; the last is the drift, if there is any.
    variables: usize,
    nodes_mm: Vec<DVec3>,
    moved_mm: Vec<DVec3>,
    unknowns_mm: Vec<f64>,
}

/// Samples of the prior of a row, shared by all its readings.
#[derive(Clone, Debug)]
pub(crate) struct PriorSamples {
    variables: Vec<f64>,
    unknowns_mm: Vec<f64>,
    resistances_ohm: Vec<f64>,
}

/// Medians of a sampled posterior, and their reliability.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SampledMedians {
    /// Absolute coordinates of the nodes (3·M2).
    pub(crate) coordinates_mm: Vec<f64>,
    /// Effective sample size (Kish).
    pub(crate) effective_samples: f64,
    /// Posterior probability of a deformation that explains the readings less well than the true one. As the truth is
    /// itself a sample of its posterior, this is uniform between 0 and 1.
    pub(crate) rank_of_truth: f64,
}

/// A sample with its weight in the round that proposed it.
#[derive(Clone, Debug)]
struct Sample {
    variables: Vec<f64>,
    unknowns_mm: Vec<f64>,
    explains: f64,
    log_weight: f64,
    /// Component that proposed it.
    component: usize,
}

/// Number of samples of the prior.
const PRIOR_SAMPLES: usize = 2000;
/// Number of samples of the first mixture; each further one has half as many again.
const FIRST_ROUND: usize = 300;
/// Maximum number of mixtures.
const ROUNDS: usize = 7;
/// Sufficient effective sample size: it increases the expected error of a median by about 0.5 %.
const SUFFICIENT: f64 = 150.0;
/// Number of samples moved towards the readings.
const STARTS: usize = 40;
/// Number of Gauss-Newton steps of each.
const STEPS: usize = 12;
/// Candidate curvatures of directions that the readings do not determine, where the prior has 1. Gaussians narrower
/// than the prior follow a curved valley.
const CURVATURES: [f64; 3] = [1.0, 9.0, 81.0];

impl SampledPosterior {
    /// Prepares the row-wire `row` of `model`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub(crate) fn new(model: &SensorModel, scene: &Scene, row: usize) -> Result<Self, SensorError> {
        let latent = LatentRow::new(model, scene, row);
        let likelihood = Likelihood::new(scene.noise.in_test().source(model)?);
        let axes = scene.movement.axes();
        let mut problem = RowProblem::new(model, axes);
        problem.turn_to(row);
        let nodes = model.scale.nodes_per_row();
        Ok(Self {
            variables: latent.variables() + usize::from(likelihood.has_drift()),
            unknowns_mm: vec![0.0; problem.unknowns()],
            nodes_mm: vec![DVec3::ZERO; nodes],
            moved_mm: vec![DVec3::ZERO; nodes],
            axes: axes.indices(),
            latent,
            problem,
            likelihood,
            row,
        })
    }

    /// Returns the approximate number of node pairs evaluated to sample one posterior.
    pub(crate) fn node_pairs(model: &SensorModel, scene: &Scene) -> f64 {
        let scale = model.scale;
        let pairs = (scale.nodes_per_row() * scale.nodes_per_column() * scale.columns()) as f64;
        // Derivatives cost the same again for each axis, and for the products with the variables.
        let evaluations = (PRIOR_SAMPLES + 3 * FIRST_ROUND + 6 * STARTS * STEPS) as f64;
        let products = LatentRow::new(model, scene, 0).variables() as f64 / scale.nodes_per_column() as f64;
        pairs * evaluations * (1.0 + products)
    }

    /// Draws samples of the prior.
    pub(crate) fn prior_samples(&mut self, rng: &mut impl Rng) -> PriorSamples {
        let mut samples = PriorSamples {
            variables: Vec::with_capacity(PRIOR_SAMPLES * self.variables),
            unknowns_mm: Vec::with_capacity(PRIOR_SAMPLES * self.unknowns_mm.len()),
            resistances_ohm: Vec::with_capacity(PRIOR_SAMPLES * self.problem.equations()),
        };
        for _ in 0..PRIOR_SAMPLES {
            let at = samples.variables.len();
            samples
                .variables
                .extend((0..self.variables).map(|_| standard_normal(rng)));
            self.deform(&samples.variables[at..]);
            self.problem.evaluate_residuals(&self.unknowns_mm);
            samples.unknowns_mm.extend_from_slice(&self.unknowns_mm);
            let resistances = (0..self.problem.equations()).map(|reading| self.problem.resistance_ohm(reading));
            samples.resistances_ohm.extend(resistances);
        }
        samples
    }

    /// Computes the medians of the posterior of these readings in ohm (M4), and the quantile of the deformation whose
    /// nodes are at `truth_mm` (3·M2).
    pub(crate) fn medians(
        &mut self,
        readings_ohm: &[f64],
        truth_mm: &[f64],
        prior: &PriorSamples,
        rng: &mut impl Rng,
    ) -> SampledMedians {
        self.problem.read(self.row, readings_ohm);
        let mut pooled: Vec<(Vec<Sample>, f64)> = Vec::new();
        let mut samples = self.weigh_prior(prior);
        let mut mixture: Option<Mixture> = None;
        let mut count = FIRST_ROUND;
        let mut enough = 0.0;
        let mut least = CURVATURES[0];
        for round in 0..=ROUNDS {
            let effective = effective_samples(&samples, 1.0);
            enough += effective;
            let is_last = enough >= SUFFICIENT || round == ROUNDS;
            if !is_last {
                let components = if round == 0 {
                    self.moved_to_readings(&samples, rng)
                } else {
                    if round == 1 {
                        least = best_curvature(&samples);
                    }
                    self.around_samples(&samples, least, rng)
                };
                mixture = Mixture::new(components);
            }
            pooled.push((samples, effective));
            let Some(mixture) = mixture.as_ref().filter(|_| !is_last) else {
                break;
            };
            samples = self.propose(mixture, count, rng);
            count += count / 2;
        }
        self.summary(&pooled, truth_mm)
    }

    fn weigh_prior(&self, prior: &PriorSamples) -> Vec<Sample> {
        let ohms = prior.resistances_ohm.chunks_exact(self.problem.equations());
        let unknowns = prior.unknowns_mm.chunks_exact(self.unknowns_mm.len());
        let samples = prior.variables.chunks_exact(self.variables).zip(unknowns).zip(ohms);
        let log_weights = samples.clone().map(|((variables, _), ohms)| {
            let drift = self.drift_of(variables);
            (self.likelihood).log_density(drift, (0..ohms.len()).map(|k| (self.problem.reading_ohm(k), ohms[k])))
        });
        let log_weights: Vec<f64> = log_weights.collect();
        let largest = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Samples with zero weight, even when tempered, are useless.
        let kept = samples
            .zip(log_weights)
            .map(|(((variables, unknowns), ohms), log_weight)| {
                let pairs = (0..ohms.len()).map(|k| (self.problem.reading_ohm(k), ohms[k]));
                (variables, unknowns, pairs, log_weight)
            });
        kept.filter(|(.., log_weight)| *log_weight > f64::NEG_INFINITY || largest == f64::NEG_INFINITY)
            .map(|(variables, unknowns, pairs, log_weight)| Sample {
                variables: variables.to_vec(),
                unknowns_mm: unknowns.to_vec(),
                explains: if log_weight > largest - 40.0 {
                    self.explains(pairs, log_weight)
                } else {
                    log_weight
                },
                log_weight,
                component: 0,
            })
            .collect()
    }

    /// Log-likelihood of resistances at the gain that explains the readings best.
    fn explains(&self, pairs: impl Iterator<Item = (f64, f64)> + Clone, log_density: f64) -> f64 {
        if !self.likelihood.has_drift() {
            return log_density;
        }
        let drift = self.likelihood.likeliest_drift_of(pairs.clone());
        self.likelihood.log_density(drift, pairs) - 0.5 * drift * drift
    }

    fn drift_of(&self, variables: &[f64]) -> f64 {
        if self.likelihood.has_drift() {
            variables[self.variables - 1]
        } else {
            0.0
        }
    }

    /// Sets the unknowns to those given by `variables`.
    fn deform(&mut self, variables: &[f64]) {
        self.latent.displacements(variables, &mut self.nodes_mm);
        let unknowns = self
            .nodes_mm
            .iter()
            .flat_map(|node| self.axes.iter().map(|&axis| node[axis]));
        (self.unknowns_mm.iter_mut().zip(unknowns)).for_each(|(unknown, value)| *unknown = value);
    }

    /// Evaluates the readings of `variables`; returns their log-likelihood, and that of the deformation at the best
    /// gain.
    fn evaluate(&mut self, variables: &[f64]) -> (f64, f64) {
        self.deform(variables);
        self.problem.evaluate_residuals(&self.unknowns_mm);
        let pairs =
            (0..self.problem.equations()).map(|k| (self.problem.reading_ohm(k), self.problem.resistance_ohm(k)));
        let log_density = self.likelihood.log_density(self.drift_of(variables), pairs.clone());
        (log_density, self.explains(pairs, log_density))
    }

    /// Evaluates the misfits w of the readings at `variables`, and their derivatives −∂w (readings × variables).
    fn linearise(&mut self, variables: &[f64]) -> (Vec<f64>, Vec<f64>) {
        /// Change of a variable for difference quotients, which only affect proposals.
        const CHANGE: f64 = 1e-6;
        let (m, n, d) = (self.problem.equations(), self.unknowns_mm.len(), self.variables);
        self.deform(variables);
        self.problem.evaluate(&self.unknowns_mm);
        let drift = self.drift_of(variables);
        let (misfits, scales) = self.likelihood.misfits_and_scales(&self.problem, drift);
        let mut by_variables = vec![0.0; n * d];
        let mut changed = variables.to_vec();
        for variable in 0..d - usize::from(self.likelihood.has_drift()) {
            // Towards the middle, where distribution functions are steeper.
            let change = -CHANGE.copysign(variables[variable]);
            changed[variable] += change;
            self.latent.displacements(&changed, &mut self.moved_mm);
            changed[variable] = variables[variable];
            let nodes = self.moved_mm.iter().zip(&self.nodes_mm);
            let slopes =
                nodes.flat_map(|(to, from)| self.axes.iter().map(move |&axis| (to[axis] - from[axis]) / change));
            (slopes.enumerate()).for_each(|(unknown, slope)| by_variables[unknown * d + variable] = slope);
        }
        let mut jacobian = vec![0.0; m * d];
        for ((reading, row), scale) in jacobian.chunks_exact_mut(d).enumerate().zip(&scales) {
            let slopes = self.problem.log_conductance_slopes(reading);
            for (slope, by_variables) in slopes.zip(by_variables.chunks_exact(d)) {
                (row.iter_mut().zip(by_variables)).for_each(|(value, by)| *value -= scale * slope * by);
            }
            if self.likelihood.has_drift() {
                row[d - 1] = scale * self.likelihood.log_gain_slope(drift);
            }
        }
        (misfits, jacobian)
    }

    /// Moves samples towards the readings; they are drawn by weights tempered to keep several of them.
    fn moved_to_readings(&mut self, samples: &[Sample], rng: &mut impl Rng) -> Vec<Component> {
        let power = tempered(samples, STARTS as f64);
        let starts = resampled(samples, power, STARTS, rng);
        let mut components = Vec::new();
        for start in starts {
            let (at, jacobian) = self.approach(&samples[start].variables);
            let around = CURVATURES.map(|least| Component::new(&at, &jacobian, least));
            components.extend(around.into_iter().flatten());
        }
        components
    }

    /// Takes Levenberg-Marquardt steps from `start` that minimise `‖w‖² + ‖v − start‖²`: directions that the readings
    /// do not determine keep their distribution.
    fn approach(&mut self, start: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let d = self.variables;
        let squares = |misfits: &[f64], at: &[f64]| {
            let apart = at
                .iter()
                .zip(start)
                .map(|(at, start)| (at - start).powi(2))
                .sum::<f64>();
            misfits.iter().map(|w| w * w).sum::<f64>() + apart
        };
        let mut at = start.to_vec();
        let (mut misfits, mut jacobian) = self.linearise(&at);
        let mut objective = squares(&misfits, &at);
        let mut damping = 1.0;
        for _ in 0..STEPS {
            let Some(component) = Component::new(&at, &jacobian, 1.0 + damping) else {
                break;
            };
            let mut gradient: Vec<f64> = start.iter().zip(&at).map(|(start, at)| start - at).collect();
            for (row, w) in jacobian.chunks_exact(d).zip(&misfits) {
                (gradient.iter_mut().zip(row)).for_each(|(sum, value)| *sum += value * w);
            }
            let step = component.solve(&gradient);
            let next: Vec<f64> = at.iter().zip(&step).map(|(at, step)| at + step).collect();
            let (next_misfits, next_jacobian) = self.linearise(&next);
            let next_objective = squares(&next_misfits, &next);
            if next_objective < objective {
                let gained = objective - next_objective;
                (at, misfits, jacobian, objective) = (next, next_misfits, next_jacobian, next_objective);
                damping *= 0.1;
                if gained < 0.01 {
                    break;
                }
            } else {
                damping = 10.0 * damping.max(1e-3);
            }
        }
        (at, jacobian)
    }

    /// Components around samples drawn by their weights, with the minimum curvature of the prior and with the curvature
    /// that proposed best.
    fn around_samples(&mut self, samples: &[Sample], least: f64, rng: &mut impl Rng) -> Vec<Component> {
        let power = tempered(samples, STARTS as f64);
        let mut starts = resampled(samples, power, 2 * STARTS, rng);
        starts.dedup();
        let mut components = Vec::new();
        for start in starts {
            let at = &samples[start].variables;
            let (_, jacobian) = self.linearise(at);
            components.extend(Component::new(at, &jacobian, least));
            if least > CURVATURES[0] {
                components.extend(Component::new(at, &jacobian, CURVATURES[0]));
            }
        }
        components
    }

    fn propose(&mut self, mixture: &Mixture, count: usize, rng: &mut impl Rng) -> Vec<Sample> {
        let mut samples = Vec::with_capacity(count);
        for number in 0..count {
            let share = (number as f64 + rng.random::<f64>()) / count as f64;
            let component = (share * mixture.components() as f64) as usize;
            let component = component.min(mixture.components() - 1);
            let variables = mixture.draw(component, rng);
            let (log_likelihood, explains) = self.evaluate(&variables);
            let log_prior = -0.5 * variables.iter().map(|value| value * value).sum::<f64>();
            let log_weight = log_prior + log_likelihood - mixture.log_density(&variables);
            if log_weight > f64::NEG_INFINITY {
                samples.push(Sample {
                    unknowns_mm: self.unknowns_mm.clone(),
                    variables,
                    explains,
                    log_weight,
                    component,
                });
            }
        }
        samples
    }

    /// Medians of the samples of all rounds, each round weighted by its effective sample size.
    fn summary(&mut self, rounds: &[(Vec<Sample>, f64)], truth_mm: &[f64]) -> SampledMedians {
        let mut weighted: Vec<(&Sample, f64)> = Vec::new();
        for (samples, effective) in rounds {
            let weights = weights(samples, 1.0);
            weighted.extend(
                samples
                    .iter()
                    .zip(weights)
                    .map(|(sample, weight)| (sample, effective * weight)),
            );
        }
        let total: f64 = weighted.iter().map(|(_, weight)| weight).sum();
        let squares: f64 = weighted.iter().map(|(_, weight)| weight * weight).sum();
        weighted.retain(|(_, weight)| *weight > 1e-9 * total);
        let mut medians_mm = vec![0.0; self.unknowns_mm.len()];
        for (unknown, median_mm) in medians_mm.iter_mut().enumerate() {
            weighted.sort_by(|(one, _), (other, _)| one.unknowns_mm[unknown].total_cmp(&other.unknowns_mm[unknown]));
            let mut below = 0.0;
            let middle = weighted.iter().find(|(_, weight)| {
                below += weight;
                below >= 0.5 * total
            });
            *median_mm = middle.map_or(f64::NAN, |(sample, _)| sample.unknowns_mm[unknown]);
        }
        let mut coordinates_mm = truth_mm.to_vec();
        self.problem.unknowns_of(truth_mm, &mut self.unknowns_mm);
        self.problem.evaluate_residuals(&self.unknowns_mm);
        let pairs =
            (0..self.problem.equations()).map(|k| (self.problem.reading_ohm(k), self.problem.resistance_ohm(k)));
        let truth = self.explains(pairs.clone(), self.likelihood.log_density(0.0, pairs));
        let below = weighted.iter().filter(|(sample, _)| sample.explains < truth);
        let rank_of_truth = below.map(|(_, weight)| weight).sum::<f64>() / total;
        self.problem.coordinates_of(&medians_mm, &mut coordinates_mm);
        SampledMedians {
            coordinates_mm,
            effective_samples: if total > 0.0 { total * total / squares } else { 0.0 },
            rank_of_truth,
        }
    }
}

/// Weights raised to this power and normalised.
fn weights(samples: &[Sample], power: f64) -> Vec<f64> {
    let largest = samples
        .iter()
        .map(|sample| sample.log_weight)
        .fold(f64::NEG_INFINITY, f64::max);
    let mut weights: Vec<f64> = samples
        .iter()
        .map(|sample| (power * (sample.log_weight - largest)).exp())
        .collect();
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= total);
    weights
}

/// The curvature whose components, in the order of [`CURVATURES`], proposed most of the posterior mass.
fn best_curvature(samples: &[Sample]) -> f64 {
    let mut found = [0.0; CURVATURES.len()];
    for (sample, weight) in samples.iter().zip(weights(samples, 1.0)) {
        found[sample.component % CURVATURES.len()] += weight;
    }
    let best = (0..found.len()).max_by(|&one, &other| found[one].total_cmp(&found[other]));
    best.map_or(CURVATURES[0], |best| CURVATURES[best])
}

/// (Σw)²/Σw² (Kish 1965).
fn effective_samples(samples: &[Sample], power: f64) -> f64 {
    if samples.is_empty() {
        return 0.0;
    }
    1.0 / weights(samples, power)
        .iter()
        .map(|weight| weight * weight)
        .sum::<f64>()
}

/// The maximum power, up to 1, at which weights have at least `wanted` effective samples.
fn tempered(samples: &[Sample], wanted: f64) -> f64 {
    /// Number of bisections.
    const STEPS: usize = 60;
    if effective_samples(samples, 1.0) >= wanted {
        return 1.0;
    }
    let (mut low, mut high) = (1e-12_f64, 1.0_f64);
    for _ in 0..STEPS {
        let middle = (low * high).sqrt();
        if effective_samples(samples, middle) >= wanted {
            low = middle;
        } else {
            high = middle;
        }
        if high < 1.1 * low {
            break;
        }
    }
    low
}

/// Indices of `count` samples drawn by their weights, systematically (Kitagawa 1996).
fn resampled(samples: &[Sample], power: f64, count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let weights = weights(samples, power);
    let mut point = rng.random::<f64>() / count as f64;
    let mut below = 0.0;
    let mut drawn = Vec::with_capacity(count);
    for (index, weight) in weights.iter().enumerate() {
        below += weight;
        while point < below && drawn.len() < count {
            drawn.push(index);
            point += 1.0 / count as f64;
        }
    }
    drawn
}
