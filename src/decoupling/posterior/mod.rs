//! The posterior of a row-wire's deformation given its readings, the noise and the prior of a scene.

mod expectation_propagation;
mod factor;
mod gaussian;
mod iteration;
mod likelihood;
mod linear_model;
mod linearised;
mod marginal;
mod pack;
mod report;
mod row_prior;
mod site;
mod truncated;

pub use report::PosteriorReport;

use rand::Rng;

use super::{
    DecodeError,
    row_problem::{Range, RowProblem, ranges},
};
use crate::{
    scene::Scene,
    sensor::{SensorError, SensorModel},
};
use expectation_propagation::{Propagation, TOLERANCE};
use likelihood::Likelihood;
use linear_model::LinearModel;
use linearised::Point;
use pack::LANES;
use row_prior::RowPrior;

/// Newton's method with noise and prior: iterates the posterior of the linearised equations, cut to the range of every
/// unknown, and answers with its median, the answer of the least expected distance.
///
/// With noise, the single best deformation is a poor answer: it lies in a corner of the possible ones. The posterior
/// weighs all deformations that explain the readings. Without noise the rounding of the readings takes its place: most
/// sensors then leave next to nothing unknown, but some deformations are seen so badly that rounding hides them.
#[derive(Clone, Debug)]
pub struct Posterior {
    problem: RowProblem,
    ranges: Vec<Range>,
    widths: Vec<f64>,
    rows: Vec<usize>,
    priors: Vec<RowPrior>,
    likelihood: Likelihood,
    propagation: Propagation,
    /// Rounds that each of the rows took when it was last solved: those that take the most begin.
    rounds: Vec<usize>,
}

/// Largest number of linearisations: two or three nearly always do, for conductance is nearly linear.
const STEPS: usize = 60;

impl Posterior {
    /// Prepares `rows` of `model`, with the noise and the prior of `scene`; `rng` draws the samples that estimate a prior
    /// without closed form.
    ///
    /// # Errors
    /// A sensor without resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Result<Self, SensorError> {
        let ranges = ranges(model, scene);
        Ok(Self {
            problem: RowProblem::new(model, scene.movement.axes()),
            widths: ranges.iter().map(|range| range.width()).collect(),
            ranges,
            rows: rows.to_vec(),
            priors: RowPrior::of_rows(model, scene, rows, rng),
            likelihood: Likelihood::new(scene.noise.in_test().source(model)?),
            propagation: Propagation::default(),
            rounds: vec![0; rows.len()],
        })
    }

    /// About how many bytes the priors of so many rows take while they are estimated.
    pub(crate) fn prior_bytes(scene: &Scene, rows: usize, unknowns_per_row: usize) -> u64 {
        RowPrior::bytes(scene.loading, rows, unknowns_per_row)
    }

    /// The same posterior of readings rounded to a part of `parts` of what they are taken to be rounded to: how finely they
    /// are is known to its order of magnitude only.
    pub(crate) fn rounded_finer(&self, parts: f64) -> Self {
        Self {
            likelihood: self.likelihood.rounded_finer(parts),
            ..self.clone()
        }
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
        Ok(self.solve_rows(&[row], readings_ohm, coordinates_mm)?[0])
    }

    /// As [`Self::solve`], several rows side by side (rows × M4 readings, rows × 3·M2 coordinates): each has the same bits as
    /// by itself.
    ///
    /// # Errors
    /// Readings that are no resistances; the error names their place among the rows.
    ///
    /// # Panics
    /// If one of `rows` is none of the rows given.
    pub(super) fn solve_rows(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<Vec<PosteriorReport>, DecodeError> {
        self.check(readings_ohm)?;
        let from_middle =
            |posterior: &mut Self, _, _: &[f64]| posterior.ranges.iter().map(|range| range.middle()).collect();
        Ok(self.iterate((rows, STEPS), readings_ohm, coordinates_mm, from_middle))
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
        Ok(self.polish_rows(&[row], readings_ohm, coordinates_mm, steps)?[0])
    }

    /// As [`Self::polish`], several rows side by side, as in [`Self::solve_rows`].
    ///
    /// # Errors
    /// Readings that are no resistances; the error names their place among the rows.
    ///
    /// # Panics
    /// If one of `rows` is none of the rows given.
    pub(super) fn polish_rows(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: usize,
    ) -> Result<Vec<PosteriorReport>, DecodeError> {
        self.check(readings_ohm)?;
        Ok(self.iterate((rows, steps), readings_ohm, coordinates_mm, Self::unknowns_of))
    }

    /// The unknowns of row-wire `row` nearest to these coordinates.
    fn unknowns_of(&mut self, row: usize, coordinates_mm: &[f64]) -> Vec<f64> {
        let mut unknowns_mm = vec![0.0; self.ranges.len()];
        self.problem.turn_to(row);
        self.problem.unknowns_of(coordinates_mm, &mut unknowns_mm);
        for (value, range) in unknowns_mm.iter_mut().zip(&self.ranges) {
            *value = range.clamp(*value);
        }
        unknowns_mm
    }

    /// Index of row-wire `row` among the rows given.
    fn place(&self, row: usize) -> usize {
        let place = self.rows.iter().position(|&known| known == row);
        place.expect("the row is one of those given")
    }

    fn check(&self, readings_ohm: &[f64]) -> Result<(), DecodeError> {
        for (row_index, readings) in readings_ohm.chunks_exact(self.problem.equations()).enumerate() {
            DecodeError::check(readings).map_err(|error| DecodeError { row_index, ..error })?;
        }
        Ok(())
    }

    /// Computes the medians of the posterior linearised at the true deformation of the row whose nodes are at `truth_mm`
    /// (3·M2), given noisy readings of it: the answer of a decoder that knows where to linearise. Writes absolute
    /// coordinates (3·M2) and returns true; or writes the truth and returns false if the posterior did not converge.
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn limit(&mut self, row: usize, readings_ohm: &[f64], truth_mm: &[f64], coordinates_mm: &mut [f64]) -> bool {
        self.limits(&[row], readings_ohm, truth_mm, coordinates_mm)
    }

    /// As [`Self::limit`], several rows side by side (rows × M4 readings, rows × 3·M2 coordinates). Returns `true` if all
    /// posteriors converged.
    ///
    /// # Panics
    /// If one of `rows` is none of the rows given.
    pub(crate) fn limits(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        truths_mm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> bool {
        let (channels, outputs) = (self.problem.equations(), self.problem.coordinates());
        coordinates_mm.copy_from_slice(truths_mm);
        let mut all_converged = true;
        let chunks = rows
            .chunks(LANES)
            .zip(readings_ohm.chunks(LANES * channels))
            .zip(coordinates_mm.chunks_mut(LANES * outputs));
        for ((rows, readings_ohm), coordinates_mm) in chunks {
            let mut lanes = [const { None }; LANES];
            let mut models = [const { None }; LANES];
            for (lane, &row) in rows.iter().enumerate() {
                let mut truth = Point {
                    displacements_mm: vec![0.0; self.ranges.len()],
                    drift: 0.0,
                };
                self.problem.read(row, &readings_ohm[lane * channels..][..channels]);
                self.problem.unknowns_of(
                    &coordinates_mm[lane * outputs..][..outputs],
                    &mut truth.displacements_mm,
                );
                self.problem.evaluate(&truth.displacements_mm);
                if self.likelihood.has_drift() {
                    truth.drift = self.likelihood.likeliest_drift(&self.problem);
                }
                let model = models[lane].insert(LinearModel::default());
                self.linearise(model, row, (&truth, 1.0), None);
                model.tolerance = TOLERANCE;
                lanes[lane] = Some((row, truth));
            }
            let found = self.propagation.marginals(&models);
            let lanes = lanes.into_iter().zip(&models).zip(found);
            for (((lane, model), marginals), coordinates_mm) in lanes.zip(coordinates_mm.chunks_exact_mut(outputs)) {
                let (Some((row, truth)), Some(model)) = (lane, model) else {
                    continue;
                };
                match marginals.filter(|marginals| marginals.converged) {
                    Some(marginals) => {
                        let found = self.linearised(model, &truth, 1.0, marginals);
                        self.problem.turn_to(row);
                        self.problem.coordinates_of(&self.medians_mm(&found), coordinates_mm);
                    }
                    None => all_converged = false,
                }
            }
        }
        all_converged
    }
}

#[cfg(test)]
mod tests {
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
        let cases: Vec<Case> = serde_json::from_str(include_str!("../../../tests/fixtures/posterior.json")).unwrap();
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
            // Gains and noise in ohm are linearised as well.
            let tolerance = if case.additive_ohm > 0.0 || case.drift > 0.0 {
                0.03
            } else {
                0.015
            };
            for ((ours, exact), deviation) in ours.iter().zip(&case.medians_mm).zip(&case.deviations_mm) {
                let apart = (ours - exact) / deviation;
                assert!(apart.abs() < tolerance, "{} {}: {apart}", case.array, case.relative);
            }
            let squares = case.deviations_mm.iter().map(|deviation| deviation * deviation);
            let spread_mm = (squares.sum::<f64>() / case.deviations_mm.len() as f64).sqrt();
            assert!((report.spread_mm / spread_mm - 1.0).abs() < 0.02);
        }
    }

    /// Mean errors of z of the limit and of the decoder, in proportion to those of the middle.
    fn shares(array: &str, movement: Movement, noise: Noise, samples: usize) -> (f64, f64) {
        let model = SensorModel::new(array.parse().unwrap());
        let scene = Scene {
            movement,
            noise,
            ..Scene::default()
        };
        let rows = model.scale.rows();
        let mut set = Dataset::simulate(&model, &scene, samples * rows, &mut Seed(1).rng(Stream::Test)).unwrap();
        set.disturb(&model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
            .unwrap();
        let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
        let (mut limits, mut answers, mut middles) = (0.0, 0.0, 0.0);
        for sample in (0..set.samples()).step_by(rows) {
            let (readings, truth) = (set.sample_readings(sample), set.sample_targets(sample));
            let mut limit = truth.to_vec();
            assert!(posterior.limit(0, readings, truth, &mut limit), "{array} {noise:?}");
            let mut answer = truth.to_vec();
            posterior.solve(0, readings, &mut answer).unwrap();
            for z in (2..truth.len()).step_by(3) {
                limits += (limit[z] - truth[z]).abs();
                answers += (answer[z] - truth[z]).abs();
                middles += (4.5 - truth[z]).abs();
            }
        }
        (limits / middles, answers / middles)
    }

    /// 30 sideways unknowns with a condition number near 1e14, and 6 unknowns with 4 readings: the smallest noise leaves
    /// something unknown, and more noise never leaves less.
    #[test]
    fn no_noise_is_too_small_for_a_posterior() {
        for (array, movement) in [("10x10_5x30", Movement::SIDEWAYS), ("2x6_3x4", Movement::Z)] {
            let mut last = 0.0;
            for noise in [0.0, 1e-15, 1e-12, 9.9e-9, 1.01e-8, 1e-7, 1e-5, 1e-3] {
                let (limit, answer) = shares(array, movement, Noise::relative(noise), 6);
                assert!(
                    limit > 1e-3 && limit < 1.0 && limit > 0.98 * last,
                    "{array} {noise}: {limit} {last:?}"
                );
                // Where 14 decades lie between the patterns, whoever does not know where to linearise stays behind.
                let most = (1.05 * limit).max(if movement == Movement::Z { 0.0 } else { 0.6 });
                assert!(answer < most, "{array} {noise}: {answer} {limit}");
                last = limit;
            }
        }
    }

    #[test]
    fn noise_that_says_nothing_leaves_the_middle() {
        let additive = |additive_ohm| Noise {
            additive_ohm,
            ..Noise::default()
        };
        for noise in [1e3, 1e4, 1e100, 1e155, 1e300].map(additive) {
            let (limit, answer) = shares("2x2_2x6", Movement::Z, noise, 300);
            assert!(
                (limit - 1.0).abs() < 0.02 && (answer - 1.0).abs() < 0.02,
                "{noise:?}: {limit} {answer}"
            );
        }
    }

    #[test]
    fn no_converter_leaves_more_than_the_middle() {
        let mut last = 0.0;
        for converter_bits in [32, 24, 16, 12, 8, 6, 4, 2, 1].map(Some) {
            let noise = Noise {
                converter_bits,
                ..Noise::default()
            };
            let (limit, answer) = shares("2x2_2x6", Movement::Z, noise, 100);
            assert!(
                limit < 1.02 && limit > 0.98 * last,
                "{converter_bits:?}: {limit} after {last}"
            );
            assert!(answer < 1.02, "{converter_bits:?}: {answer}");
            last = limit;
        }
    }

    /// From 1e-3 down to none at all, past the rounding of the readings, below which noise adds nothing.
    #[test]
    fn noise_passes_into_rounding_without_a_step() {
        let model = SensorModel::new("2x4_2x12".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(1).rng(Stream::Test)).unwrap();
        let solved = |noise| {
            let noise = Noise::relative(noise);
            let scene = Scene {
                noise,
                ..Scene::default()
            };
            let mut posterior = Posterior::new(&model, &scene, &[1], &mut Seed(1).rng(Stream::Expectation)).unwrap();
            let mut coordinates = vec![0.0; 12];
            let report = posterior.solve(1, set.sample_readings(3), &mut coordinates).unwrap();
            assert!(report.converged, "{noise:?}: {report:?}");
            let errors = coordinates
                .iter()
                .zip(set.sample_targets(3))
                .map(|(a, b)| (a - b).abs());
            (report, errors.fold(0.0, f64::max))
        };
        let mut last = f64::INFINITY;
        for noise in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-18] {
            let (report, error_mm) = solved(noise);
            assert!(report.spread_mm < last, "{noise}: {report:?} {last}");
            assert!(error_mm < 10.0 * report.spread_mm, "{noise}: {error_mm} {report:?}");
            last = report.spread_mm;
        }
        let (report, error_mm) = solved(0.0);
        assert!((report.spread_mm / last - 1.0).abs() < 1e-5, "{report:?} {last}");
        assert!(
            report.determined && report.spread_mm < 1e-10 && error_mm < 1e-10,
            "{report:?} {error_mm}"
        );
    }
}
