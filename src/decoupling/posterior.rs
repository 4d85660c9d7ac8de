use faer::Mat;
use rand::Rng;

use super::{
    DecodeError,
    box_posterior::{BoxPosterior, Marginal},
    newton::Newton,
    newton_report::{NewtonReport, NewtonRules},
    row_prior::RowPrior,
    row_problem::{Range, RowProblem, ranges},
};
use crate::{
    scene::{NoiseSource, RelativeSpread, Scene},
    sensor::{SensorError, SensorModel},
};

/// Newton's method with noise and prior: iterates the posterior of the linearised equations, cut to the range of every
/// unknown, and answers with its median, the answer of the least expected distance.
///
/// With noise, the single best deformation is a poor answer: it lies in a corner of what is possible. The posterior
/// weighs all deformations that explain the readings.
#[derive(Clone, Debug)]
pub struct Posterior {
    problem: RowProblem,
    ranges: Vec<Range>,
    rows: Vec<usize>,
    priors: Vec<RowPrior>,
    noise: NoiseSource,
    /// Answers where noise is so small that the equations decide alone.
    newton: Newton,
}

/// What a row's posterior came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorReport {
    /// Linearisations.
    pub steps: usize,
    /// rms over readings of the relative misfit m/R − 1 at the answer.
    pub residual: f64,
    /// rms over unknowns of the posterior standard deviation; 0 without noise.
    pub spread_mm: f64,
}

impl PosteriorReport {
    /// Of readings without noise.
    fn exact(report: NewtonReport) -> Self {
        Self {
            steps: report.steps,
            residual: report.residual,
            spread_mm: 0.0,
        }
    }
}

/// Most linearisations: two nearly always do, for conductance is nearly linear.
const STEPS: usize = 8;
/// Change of a mean, relative to the range, below which the linearisation is taken as found.
const TOLERANCE: f64 = 1e-5;
/// Noise below which rounding in the normal equations would hide the prior; the equations decide alone there.
const SMALLEST_NOISE: f64 = 1e-8;

impl Posterior {
    /// For `rows` of `model`, with the noise and the prior of `scene`; `rng` draws what a prior without closed form
    /// needs.
    ///
    /// # Errors
    /// A sensor without resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Result<Self, SensorError> {
        Ok(Self {
            problem: RowProblem::new(model, scene.movement.axes()),
            ranges: ranges(model, scene),
            rows: rows.to_vec(),
            priors: if scene.noise.in_test().is_none() {
                // The equations decide alone.
                Vec::new()
            } else {
                RowPrior::of_rows(model, scene, rows, rng)
            },
            noise: scene.noise.in_test().source(model)?,
            newton: Newton::new(model, scene, NewtonRules::default()),
        })
    }

    /// Decodes one row-wire of those given, from its readings in ohm (M4); writes absolute coordinates (3·M2).
    ///
    /// # Errors
    /// Readings that are no resistances.
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn solve(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<PosteriorReport, DecodeError> {
        let is_noisy = DecodeError::check(readings_ohm).map(|()| self.largest_noise(readings_ohm) >= SMALLEST_NOISE)?;
        let middle: Vec<f64> = self.ranges.iter().map(|range| range.middle()).collect();
        if is_noisy && let Some(report) = self.iterate(row, readings_ohm, middle, STEPS, coordinates_mm) {
            return Ok(report);
        }
        let report = self.newton.solve(row, readings_ohm, coordinates_mm)?;
        Ok(PosteriorReport::exact(report))
    }

    /// As [`Self::solve`], by at most `steps` steps from the answer of another decoder in `coordinates_mm`, which is
    /// replaced.
    ///
    /// # Errors
    /// Readings that are no resistances.
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn polish(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: usize,
    ) -> Result<PosteriorReport, DecodeError> {
        let is_noisy = DecodeError::check(readings_ohm).map(|()| self.largest_noise(readings_ohm) >= SMALLEST_NOISE)?;
        if is_noisy {
            let mut first = vec![0.0; self.ranges.len()];
            self.problem.read(row, readings_ohm);
            self.problem.unknowns_of(coordinates_mm, &mut first);
            for (value, range) in first.iter_mut().zip(&self.ranges) {
                *value = range.clamp(*value);
            }
            if let Some(report) = self.iterate(row, readings_ohm, first, steps, coordinates_mm) {
                return Ok(report);
            }
        }
        let rules = NewtonRules {
            steps,
            ..NewtonRules::default()
        };
        self.newton.set_rules(rules);
        let report = self.newton.polish(row, readings_ohm, coordinates_mm);
        self.newton.set_rules(NewtonRules::default());
        Ok(PosteriorReport::exact(report?))
    }

    /// Linearises anew at each mean, from `at` on; writes the medians. `None` if a posterior has no marginals.
    fn iterate(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        mut at: Vec<f64>,
        most_steps: usize,
        coordinates_mm: &mut [f64],
    ) -> Option<PosteriorReport> {
        self.problem.read(row, readings_ohm);
        let mut answer = None;
        let mut steps = 0;
        while steps < most_steps {
            steps += 1;
            let Some(marginals) = self.linearised(row, readings_ohm, &at) else {
                break;
            };
            let moved = at.iter().zip(&marginals).zip(&self.ranges);
            let moved = moved.map(|((at, marginal), range)| (marginal.mean - at).abs() / range.width());
            let largest = moved.fold(0.0, f64::max);
            at = marginals.iter().map(|marginal| marginal.mean).collect();
            answer = Some(marginals);
            if largest < TOLERANCE {
                break;
            }
        }
        let marginals = answer?;
        let medians: Vec<f64> = marginals.iter().map(|marginal| marginal.median).collect();
        let residual = self.problem.evaluate(&medians);
        self.problem.coordinates_of(&medians, coordinates_mm);
        let variance = marginals.iter().map(|marginal| marginal.variance).sum::<f64>() / marginals.len() as f64;
        Some(PosteriorReport {
            steps,
            residual,
            spread_mm: variance.sqrt(),
        })
    }

    /// The medians of the posterior linearised at the true deformation of the row whose nodes are at `truth_mm`
    /// (3·M2), given noisy readings of it: what
    /// a decoder would answer that knew the sensor perfectly. Writes absolute coordinates (3·M2).
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn limit(&mut self, row: usize, readings_ohm: &[f64], truth_mm: &[f64], coordinates_mm: &mut [f64]) {
        coordinates_mm.copy_from_slice(truth_mm);
        if self.largest_noise(readings_ohm) < SMALLEST_NOISE {
            return;
        }
        self.problem.read(row, readings_ohm);
        let mut truth = vec![0.0; self.ranges.len()];
        self.problem.unknowns_of(truth_mm, &mut truth);
        if let Some(marginals) = self.linearised(row, readings_ohm, &truth) {
            let medians: Vec<f64> = marginals.iter().map(|marginal| marginal.median).collect();
            self.problem.coordinates_of(&medians, coordinates_mm);
        }
    }

    fn largest_noise(&self, readings_ohm: &[f64]) -> f64 {
        let spreads = readings_ohm.iter().map(|&ohm| self.noise.spread(ohm));
        spreads.map(|spread| spread.own.max(spread.common)).fold(0.0, f64::max)
    }

    /// The posterior of the equations linearised at `at`.
    fn linearised(&mut self, row: usize, readings_ohm: &[f64], at: &[f64]) -> Option<Vec<Marginal>> {
        self.problem.evaluate(at);
        let (n, equations) = (at.len(), self.problem.equations());
        // ρ(u) ≈ ρ(at) + J (u − at) has the covariance of the noise: J and the right side J·at − ρ, whitened.
        let spreads: Vec<RelativeSpread> = readings_ohm.iter().map(|&ohm| self.noise.spread(ohm)).collect();
        let mut system = Mat::from_fn(equations, n + 1, |k, i| {
            let own = spreads[k].own.max(SMALLEST_NOISE);
            let value = if i < n {
                self.problem.derivative(k, i)
            } else {
                let forward: f64 = (0..n).map(|i| self.problem.derivative(k, i) * at[i]).sum();
                forward - self.problem.residuals()[k]
            };
            value / own
        });
        remove_common(&mut system, &spreads);
        let products = system.transpose() * &system;
        let mut precision = products.submatrix(0, 0, n, n).to_owned();
        let mut linear: Vec<f64> = (0..n).map(|i| products[(i, n)]).collect();
        let place = self.rows.iter().position(|&known| known == row);
        let place = place.expect("the row is one of those given");
        if let RowPrior::Gaussian {
            precision: of_prior,
            linear: prior_linear,
        } = &self.priors[place]
        {
            precision += of_prior;
            linear
                .iter_mut()
                .zip(prior_linear)
                .for_each(|(sum, value)| *sum += value);
        }
        BoxPosterior::new(precision, linear, self.ranges.clone()).marginals()
    }
}

/// Whitens against an error common to all readings, of which `system` (readings × anything) is already divided by
/// each reading's own spread: with q = common/own, `(I + q qᵀ)^(−1/2) = I − (1 − 1/√(1 + |q|²)) q qᵀ/|q|²`.
fn remove_common(system: &mut Mat<f64>, spreads: &[RelativeSpread]) {
    let q: Vec<f64> = spreads
        .iter()
        .map(|spread| spread.common / spread.own.max(SMALLEST_NOISE))
        .collect();
    let length2: f64 = q.iter().map(|q| q * q).sum();
    if length2 == 0.0 {
        return;
    }
    let factor = (1.0 - 1.0 / (1.0 + length2).sqrt()) / length2;
    for column in 0..system.ncols() {
        let along: f64 = q.iter().enumerate().map(|(k, q)| q * system[(k, column)]).sum();
        for (k, q) in q.iter().enumerate() {
            system[(k, column)] -= factor * along * q;
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::linalg::solvers::DenseSolveCore;

    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        scene::Noise,
    };
    use rand::RngExt;

    /// Posterior means of the exact, nonlinear problem by weighing draws from the prior.
    fn by_sampling(model: &SensorModel, readings: &[f64], noise: f64, stroke_mm: f64) -> Vec<f64> {
        let mut rng = Seed(9).rng(Stream::Expectation);
        let nodes = model.scale.nodes_per_row();
        let mut total = 0.0;
        let mut means = vec![0.0; nodes];
        for _ in 0..200_000 {
            let z: Vec<f64> = (0..nodes).map(|_| stroke_mm * rng.random::<f64>()).collect();
            let at: Vec<glam::DVec3> = z.iter().map(|&z| glam::DVec3::new(0.0, 0.0, z)).collect();
            let resistances = model.row_resistances(0, &at).unwrap();
            let misfit: f64 = resistances
                .iter()
                .zip(readings)
                .map(|(r, m)| (m / r - 1.0).powi(2))
                .sum();
            let weight = (-0.5 * misfit / (noise * noise)).exp();
            total += weight;
            means.iter_mut().zip(&z).for_each(|(mean, z)| *mean += weight * z);
        }
        means.iter().map(|mean| mean / total).collect()
    }

    #[test]
    fn a_small_nonlinear_problem_agrees_with_sampling_of_the_exact_posterior() {
        let model = SensorModel::new("1x2_2x6".parse().unwrap());
        for noise in [3e-3, 3e-2] {
            let scene = Scene {
                noise: Noise::relative(noise),
                ..Scene::default()
            };
            let mut set = Dataset::simulate(&model, &scene, 6, &mut Seed(1).rng(Stream::Test)).unwrap();
            set.disturb(&model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
                .unwrap();
            let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
            for sample in 0..set.samples() {
                let readings = set.sample_readings(sample).to_vec();
                let exact = by_sampling(&model, &readings, noise, 1.0);
                posterior.problem.read(0, &readings);
                let mut at = vec![0.5; 2];
                for _ in 0..4 {
                    let marginals = posterior.linearised(0, &readings, &at).unwrap();
                    at = marginals.iter().map(|m| m.mean).collect();
                }
                for (ours, exact) in at.iter().zip(exact) {
                    assert!((ours - exact).abs() < 0.02, "{noise} {sample}: {ours} {exact}");
                }
            }
        }
    }

    #[test]
    fn without_noise_it_is_newtons_answer() {
        let model = SensorModel::new("2x4_2x12".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(1).rng(Stream::Test)).unwrap();
        let mut rng = Seed(1).rng(Stream::Expectation);
        let mut posterior = Posterior::new(&model, &Scene::default(), &[0, 1], &mut rng).unwrap();
        let mut coordinates = vec![0.0; 12];
        let report = posterior.solve(1, set.sample_readings(3), &mut coordinates).unwrap();
        assert_eq!(report.spread_mm, 0.0);
        for (ours, truth) in coordinates.iter().zip(set.sample_targets(3)) {
            assert!((ours - truth).abs() < 1e-9);
        }
    }

    #[test]
    fn a_common_error_is_whitened_as_the_dense_inverse_says() {
        let spreads: Vec<RelativeSpread> = [0.1, 0.2, 0.4].map(|own| RelativeSpread { own, common: 0.3 }).to_vec();
        let mut system = Mat::from_fn(3, 1, |k, _| (k as f64 + 1.0) / spreads[k].own);
        remove_common(&mut system, &spreads);
        let covariance = Mat::from_fn(3, 3, |i, j| 0.09 + if i == j { spreads[i].own.powi(2) } else { 0.0 });
        let inverse = covariance.partial_piv_lu().inverse();
        let mut expected = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                expected += (i as f64 + 1.0) * inverse[(i, j)] * (j as f64 + 1.0);
            }
        }
        assert!((system.squared_norm_l2() / expected - 1.0).abs() < 1e-12);
    }
}
