use faer::Mat;
use rand::Rng;

use super::{
    DecodeError,
    box_posterior::{BoxPosterior, Marginals},
    newton::Newton,
    newton_report::{NewtonReport, NewtonRules},
    row_prior::RowPrior,
    row_problem::{Range, RowProblem, ranges},
};
use crate::{
    scene::{NoiseSource, RelativeNoise, Scene},
    sensor::{SensorError, SensorModel},
};

/// Newton's method with noise and prior: iterates the posterior of the linearised equations, cut to the range of every
/// unknown, and answers with its median, the answer of the least expected distance.
///
/// With noise, the single best deformation is a poor answer: it lies in a corner of the possible ones. The posterior
/// weighs all deformations that explain the readings.
///
/// A reading m of the resistance R(u) has, to first order in the noise, a standard deviation proportional to R(u) itself,
/// so that with ρ = m/R(u) − 1 and C the covariance of the relative noise (own parts on the diagonal, drift in common)
///
/// `ln p(m|u) = −½ ρᵀ C⁻¹ ρ − ½ ln det C − Σ_k ln R_k(u)`.
///
/// The first term is quadratic in ρ, which is nearly linear in u. The last one, the normalisation of a density whose
/// spread depends on u, is linearised: with R = g/s it adds Σ_k ∂ ln s_k/∂u to the linear term of the posterior, a shift
/// of about 0.1 standard deviations at a noise of 0.1; its curvature is smaller than that of the first by noise². C is taken
/// at the linearisation point. Where noise in ohm makes it depend on u, the derivatives of the first two terms by C cancel
/// in expectation and are left out; rounding by a converter counts as Gaussian with its standard deviation.
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

/// Result of a row's posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorReport {
    /// Linearisations.
    pub steps: usize,
    /// rms over readings of the relative misfit m/R − 1 at the answer.
    pub residual: f64,
    /// rms over unknowns of the posterior standard deviation; `None` if the equations decided alone: without noise, or
    /// where they are so ill-conditioned that rounding hides the posterior.
    pub spread_mm: Option<f64>,
    /// True if the answer can be relied on: expectation propagation converged in the last linearisation, or there was no
    /// noise.
    pub converged: bool,
}

impl PosteriorReport {
    /// Report of equations that decided alone, which can be relied on unless the readings are noisy.
    fn of_equations(report: NewtonReport, is_noisy: bool) -> Self {
        Self {
            steps: report.steps,
            residual: report.residual,
            spread_mm: None,
            converged: !is_noisy,
        }
    }
}

/// Largest number of linearisations: two nearly always do, for conductance is nearly linear.
const STEPS: usize = 8;
/// Change of a mean, relative to the range, below which the linearisation has converged.
const TOLERANCE: f64 = 1e-5;
/// Noise below which rounding in the normal equations would hide the prior; the equations decide alone there.
const SMALLEST_NOISE: f64 = 1e-8;

impl Posterior {
    /// Prepares `rows` of `model`, with the noise and the prior of `scene`; `rng` draws the samples that estimate a prior
    /// without closed form.
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
        Ok(PosteriorReport::of_equations(report, is_noisy))
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
        Ok(PosteriorReport::of_equations(report?, is_noisy))
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
        let mut answer: Option<Marginals> = None;
        let mut steps = 0;
        while steps < most_steps {
            steps += 1;
            let Some(marginals) = self.linearised(row, &at) else {
                if let Some(Marginals { converged, .. }) = &mut answer {
                    *converged = false;
                }
                break;
            };
            let moved = at.iter().zip(&marginals.of_unknowns).zip(&self.ranges);
            let moved = moved.map(|((at, marginal), range)| (marginal.mean - at).abs() / range.width());
            let largest = moved.fold(0.0, f64::max);
            at = marginals.of_unknowns.iter().map(|marginal| marginal.mean).collect();
            answer = Some(marginals);
            if largest < TOLERANCE {
                break;
            }
        }
        let Marginals { of_unknowns, converged } = answer?;
        let medians: Vec<f64> = of_unknowns.iter().map(|marginal| marginal.median).collect();
        let residual = self.problem.evaluate(&medians);
        self.problem.coordinates_of(&medians, coordinates_mm);
        let variance = of_unknowns.iter().map(|marginal| marginal.variance).sum::<f64>() / of_unknowns.len() as f64;
        Some(PosteriorReport {
            steps,
            residual,
            spread_mm: Some(variance.sqrt()),
            converged,
        })
    }

    /// Computes the medians of the posterior linearised at the true deformation of the row whose nodes are at `truth_mm`
    /// (3·M2), given noisy readings of it: the answer of a decoder that knows where to linearise. Writes absolute
    /// coordinates (3·M2) and returns true; or writes the truth and returns false if the posterior did not converge or
    /// is hidden by rounding.
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn limit(&mut self, row: usize, readings_ohm: &[f64], truth_mm: &[f64], coordinates_mm: &mut [f64]) -> bool {
        coordinates_mm.copy_from_slice(truth_mm);
        if self.largest_noise(readings_ohm) < SMALLEST_NOISE {
            return true;
        }
        self.problem.read(row, readings_ohm);
        let mut truth = vec![0.0; self.ranges.len()];
        self.problem.unknowns_of(truth_mm, &mut truth);
        match self.linearised(row, &truth) {
            Some(Marginals { of_unknowns, converged }) if converged => {
                let medians: Vec<f64> = of_unknowns.iter().map(|marginal| marginal.median).collect();
                self.problem.coordinates_of(&medians, coordinates_mm);
                true
            }
            _ => false,
        }
    }

    fn largest_noise(&self, readings_ohm: &[f64]) -> f64 {
        let noises = readings_ohm.iter().map(|&ohm| self.noise.relative_to(ohm));
        noises.map(|noise| noise.own.max(noise.common)).fold(0.0, f64::max)
    }

    /// The posterior of the equations linearised at `at`.
    fn linearised(&mut self, row: usize, at: &[f64]) -> Option<Marginals> {
        self.problem.evaluate(at);
        let (n, equations) = (at.len(), self.problem.equations());
        // ρ(u) ≈ ρ(at) + J (u − at) has the covariance of the noise: J and the right side J·at − ρ, whitened.
        let noise_at = |reading| self.noise.relative_to(self.problem.resistance_ohm(reading));
        let noises: Vec<RelativeNoise> = (0..equations).map(noise_at).collect();
        let mut system = Mat::from_fn(equations, n + 1, |k, i| {
            let own = noises[k].own.max(SMALLEST_NOISE);
            let value = if i < n {
                self.problem.derivative(k, i)
            } else {
                let forward: f64 = (0..n).map(|i| self.problem.derivative(k, i) * at[i]).sum();
                forward - self.problem.residuals()[k]
            };
            value / own
        });
        remove_common(&mut system, &noises);
        let products = system.transpose() * &system;
        let mut precision = products.submatrix(0, 0, n, n).to_owned();
        let mut linear: Vec<f64> = (0..n)
            .map(|i| products[(i, n)] + self.problem.log_conductance_slope(i))
            .collect();
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
fn remove_common(system: &mut Mat<f64>, noises: &[RelativeNoise]) {
    let q: Vec<f64> = noises
        .iter()
        .map(|noise| noise.common / noise.own.max(SMALLEST_NOISE))
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
        scene::{Movement, Noise},
    };

    /// A case of `tests/fixtures/posterior.py`, which integrates or samples the exact posterior.
    #[derive(serde::Deserialize)]
    struct Case {
        array: String,
        relative: f64,
        additive_ohm: f64,
        drift: f64,
        readings_ohm: Vec<f64>,
        medians_mm: Vec<f64>,
        deviations_mm: Vec<f64>,
    }

    #[test]
    fn medians_are_those_of_the_exact_posterior() {
        let cases: Vec<Case> = serde_json::from_str(include_str!("../../tests/fixtures/posterior.json")).unwrap();
        for case in cases {
            let model = SensorModel::new(case.array.parse().unwrap());
            let scene = Scene {
                noise: Noise {
                    relative: case.relative,
                    additive_ohm: case.additive_ohm,
                    drift: case.drift,
                    ..Noise::default()
                },
                ..Scene::default()
            };
            let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
            let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
            let report = posterior.solve(0, &case.readings_ohm, &mut coordinates).unwrap();
            let ours: Vec<f64> = coordinates
                .chunks_exact(3)
                .map(|node| model.geometry.height_mm - node[2])
                .collect();
            // The derivatives by C that are left out count where there is noise in ohm.
            let tolerance = if case.additive_ohm > 0.0 { 0.05 } else { 0.015 };
            for ((ours, exact), deviation) in ours.iter().zip(&case.medians_mm).zip(&case.deviations_mm) {
                let apart = (ours - exact) / deviation;
                assert!(apart.abs() < tolerance, "{} {}: {apart}", case.array, case.relative);
            }
            let squares = case.deviations_mm.iter().map(|deviation| deviation * deviation);
            let spread_mm = (squares.sum::<f64>() / case.deviations_mm.len() as f64).sqrt();
            assert!((report.spread_mm.unwrap() / spread_mm - 1.0).abs() < 0.02);
        }
    }

    /// 30 sideways unknowns with a condition number near 1e14: at a noise of 1e-8 rounding hides the posterior, and an
    /// answer given all the same would pass for the limit of physics.
    #[test]
    fn a_posterior_that_rounding_hides_is_reported() {
        let model = SensorModel::new(crate::sensor::ArrayScale::default());
        for (noise, expected) in [(1e-8, false), (1e-3, true)] {
            let scene = Scene {
                movement: Movement::SIDEWAYS,
                noise: Noise::relative(noise),
                ..Scene::default()
            };
            let mut set = Dataset::simulate(&model, &scene, 10, &mut Seed(1).rng(Stream::Test)).unwrap();
            set.disturb(&model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
                .unwrap();
            let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
            let readings = set.sample_readings(0).to_vec();
            let truth = set.sample_targets(0).to_vec();
            let mut coordinates = truth.clone();
            assert_eq!(
                posterior.solve(0, &readings, &mut coordinates).unwrap().converged,
                expected
            );
            assert_eq!(posterior.limit(0, &readings, &truth, &mut coordinates), expected);
            assert_eq!(coordinates == truth, !expected);
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
        assert_eq!((report.spread_mm, report.converged), (None, true));
        for (ours, truth) in coordinates.iter().zip(set.sample_targets(3)) {
            assert!((ours - truth).abs() < 1e-9);
        }
    }

    #[test]
    fn a_common_error_is_whitened_as_the_dense_inverse_says() {
        let noises = [0.1, 0.2, 0.4].map(|own| RelativeNoise { own, common: 0.3 });
        let mut system = Mat::from_fn(3, 1, |k, _| (k as f64 + 1.0) / noises[k].own);
        remove_common(&mut system, &noises);
        let covariance = Mat::from_fn(3, 3, |i, j| 0.09 + if i == j { noises[i].own.powi(2) } else { 0.0 });
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
