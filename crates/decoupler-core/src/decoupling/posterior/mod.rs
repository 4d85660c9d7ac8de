//! The posterior of a row-wire's deformation given its readings, the noise and the prior of a scene.

mod evidence;
mod expectation_propagation;
mod factor;
mod gaussian;
mod iteration;
mod likelihood;
mod limit;
mod linear_model;
mod linearised;
mod marginal;
mod mixture;
mod pack;
mod products;
mod report;
mod row_prior;
mod sampled;
mod site;
mod truncated;

pub use report::PosteriorReport;
pub(crate) use sampled::SampledPosterior;

use rand::Rng;

use super::{
    DecodeError,
    row_problem::{Range, RowProblem, ranges},
};
use crate::{
    scene::Scene,
    sensor::{SensorError, SensorModel},
};
use expectation_propagation::Propagation;
use likelihood::Likelihood;
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

/// Largest number of linearisations. Six do as a rule, for conductance is nearly linear.
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

    /// About how many bytes the priors of this many rows take while they are estimated.
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
}

#[cfg(test)]
mod tests;
