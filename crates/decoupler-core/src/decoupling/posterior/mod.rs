//! The posterior of a row-wire's deformation given its readings, the noise and the prior of a scene.

mod expectation_propagation;
mod factor;
mod gaussian;
mod iteration;
mod likelihood;
mod pack;
mod sampled;
mod truncated;

pub(crate) use sampled::SampledPosterior;

use expectation_propagation::{Propagation, TOLERANCE};
use gaussian::{LinearModel, Point};
use likelihood::Likelihood;
use pack::LANES;
use rand::Rng;

use super::{
    DecodeError,
    row_problem::{GaussianPrior, Range, RowProblem, ranges},
};
use crate::{
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Newton's method with noise and prior: iterates the posterior of the linearised equations, truncated to the range
/// of every unknown, and answers with its median, which has the minimum expected absolute error.
///
/// With noise, the single best deformation is a poor answer: it is in a corner of the possible ones. The posterior
/// includes all deformations that explain the readings. Without noise, the rounding of the readings takes its place:
/// most sensors then leave next to nothing undetermined, but some deformations are so ill-conditioned that rounding
/// hides them.
#[derive(Clone, Debug)]
pub struct Posterior {
    problem: RowProblem,
    ranges: Vec<Range>,
    widths: Vec<f64>,
    rows: Vec<usize>,
    /// One per row, truncated to the ranges; empty if nodes move independently and uniformly within their ranges.
    priors: Vec<GaussianPrior>,
    likelihood: Likelihood,
    propagation: Propagation,
    /// EP sweeps of each row when it was last solved: the slowest rows start first.
    rounds: Vec<usize>,
}

/// Minimum prior standard deviation of a pattern, relative to the range.
const SMALLEST_SPREAD: f64 = 1e-3;
/// Maximum number of linearisations. Usually six are enough, since conductance is nearly linear.
const STEPS: usize = 60;

impl Posterior {
    /// Prepares `rows` of `model`, with the noise and the prior of `scene`; `rng` draws the samples that estimate a prior
    /// without closed form.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rng: &mut impl Rng) -> Result<Self, SensorError> {
        let ranges = ranges(model, scene);
        Ok(Self {
            problem: RowProblem::new(model, scene.movement.axes()),
            widths: ranges.iter().map(|range| range.width()).collect(),
            ranges,
            rows: rows.to_vec(),
            priors: match scene.loading {
                Loading::RandomNodes => Vec::new(),
                _ => GaussianPrior::of_rows(model, scene, rows, SMALLEST_SPREAD, rng),
            },
            likelihood: Likelihood::new(scene.noise.in_test().source(model)?),
            propagation: Propagation::default(),
            rounds: vec![0; rows.len()],
        })
    }

    /// Approximate number of bytes for estimating the priors of this many rows.
    pub(crate) fn prior_bytes(scene: &Scene, rows: usize, unknowns_per_row: usize) -> u64 {
        GaussianPrior::bytes(scene.loading, rows, unknowns_per_row)
    }

    /// Returns the posterior for readings rounded to 1/`parts` of the assumed rounding, which is known only to its
    /// order of magnitude.
    pub(crate) fn rounded_finer(&self, parts: f64) -> Self {
        Self {
            likelihood: self.likelihood.rounded_finer(parts),
            ..self.clone()
        }
    }

    /// Decodes one of the given row-wires from its readings in ohm (M4); writes absolute coordinates (3·M2).
    ///
    /// # Errors
    /// If a reading is not a resistance.
    ///
    /// # Panics
    /// If `row` is not one of the given rows.
    pub fn solve(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<PosteriorReport, DecodeError> {
        Ok(self.solve_rows(&[row], readings_ohm, coordinates_mm)?[0])
    }

    /// As [`Self::solve`], for several rows side by side (rows × M4 readings, rows × 3·M2 coordinates), with
    /// bit-identical results.
    ///
    /// # Errors
    /// If a reading is not a resistance; the error contains its index among the rows.
    ///
    /// # Panics
    /// If one of `rows` is not one of the given rows.
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

    /// As [`Self::solve`], in at most `steps` steps from the answer of another decoder in `coordinates_mm`, which is
    /// replaced.
    ///
    /// # Errors
    /// If a reading is not a resistance.
    ///
    /// # Panics
    /// If `row` is not one of the given rows.
    pub fn polish(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: usize,
    ) -> Result<PosteriorReport, DecodeError> {
        Ok(self.polish_rows(&[row], readings_ohm, coordinates_mm, steps)?[0])
    }

    /// As [`Self::polish`], for several rows side by side, as in [`Self::solve_rows`].
    ///
    /// # Errors
    /// If a reading is not a resistance; the error contains its index among the rows.
    ///
    /// # Panics
    /// If one of `rows` is not one of the given rows.
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

    /// Unknowns of row-wire `row` nearest to these coordinates.
    fn unknowns_of(&mut self, row: usize, coordinates_mm: &[f64]) -> Vec<f64> {
        let mut unknowns_mm = vec![0.0; self.ranges.len()];
        self.problem.turn_to(row);
        self.problem.unknowns_of(coordinates_mm, &mut unknowns_mm);
        for (value, range) in unknowns_mm.iter_mut().zip(&self.ranges) {
            *value = range.clamp(*value);
        }
        unknowns_mm
    }

    /// Index of row-wire `row` among the given rows.
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
}

/// Result of a row's posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorReport {
    /// Number of linearisations.
    pub steps: usize,
    /// Number of EP sweeps, over all linearisations.
    pub rounds: usize,
    /// rms over readings of the relative misfit m/(γR) − 1 at the answer, with the gain γ of [`Self::drift`].
    pub residual: f64,
    /// Mean of the gain error of the snapshot, in standard deviations of the scene's drift; 0 without drift.
    pub drift: f64,
    /// rms over unknowns of the posterior standard deviation.
    pub spread_mm: f64,
    /// True if no unknown has a posterior standard deviation above
    /// [`LARGEST_ERROR`](crate::decoupling::LARGEST_ERROR) of its range.
    pub determined: bool,
    /// True if the answer is reliable: expectation propagation converged, and the last linearisation was accurate
    /// compared with the noise.
    pub converged: bool,
}

impl Posterior {
    /// Computes the medians of the posterior linearised at the true deformation of the row whose nodes are at
    /// `truth_mm` (3·M2), given noisy readings of it: the answer of a decoder with the ideal linearisation point.
    /// Writes absolute coordinates (3·M2) and returns true; or writes the truth and returns false if the posterior
    /// did not converge.
    ///
    /// # Panics
    /// If `row` is not one of the given rows.
    pub fn limit(&mut self, row: usize, readings_ohm: &[f64], truth_mm: &[f64], coordinates_mm: &mut [f64]) -> bool {
        self.limits(&[row], readings_ohm, truth_mm, coordinates_mm)
    }

    /// As [`Self::limit`], for several rows side by side (rows × M4 readings, rows × 3·M2 coordinates). Returns
    /// `true` if all posteriors converged.
    ///
    /// # Panics
    /// If one of `rows` is not one of the given rows.
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
mod tests;
