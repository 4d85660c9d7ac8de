//! The decoder that solves the equations of the sensor.

#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;

use super::{DecodeError, Decoder, Estimate, Estimator, Solution, SolvedRows};
use crate::{
    scene::{RowModel, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes every row of a frame by the [`Estimator`], with the noise and the prior of the scene: from its own starts, or
/// in a few steps from the answer of another decoder.
///
/// If rows are not known, it uses the row-wire that explains the readings best, or the one nearest to the first answer.
pub struct NewtonDecoder {
    /// Decoder whose answers are improved, if there is one.
    first: Option<Box<dyn Decoder>>,
    rows: Vec<usize>,
    solver: Solver,
    /// Row-wires of the rows that are being decoded.
    row_wires: Vec<usize>,
    solved: SolvedRows,
}

#[derive(Clone, Debug)]
struct Solver {
    model: SensorModel,
    estimator: Estimator,
    /// Maximum number of steps after the first answer, if there is one.
    steps: Option<usize>,
    /// Row-wires among which that of a reading is searched, with the logarithms of their resistances at rest; empty if
    /// it is known.
    searched: Vec<(usize, Vec<f64>)>,
    trial_mm: Vec<f64>,
}

impl NewtonDecoder {
    /// Creates a decoder for `rows` of `model` in `scene`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let at_rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let searched = match scene.rows.model() {
            RowModel::Each => &[],
            RowModel::Shared => rows,
        };
        let searched = searched.iter().map(|&row| {
            let readings = model.row_resistances(row, &at_rest)?;
            Ok((row, readings.into_iter().map(f64::ln).collect()))
        });
        Ok(Self {
            first: None,
            rows: rows.to_vec(),
            solver: Solver {
                model: *model,
                estimator: Estimator::new(model, scene, rows)?,
                steps: None,
                searched: searched.collect::<Result<_, SensorError>>()?,
                trial_mm: vec![0.0; model.scale.coordinates_per_row()],
            },
            row_wires: Vec::new(),
            solved: SolvedRows::default(),
        })
    }

    /// Returns the decoder that takes at most `steps` steps after `first`.
    #[must_use]
    pub fn after(mut self, first: Box<dyn Decoder>, steps: usize) -> Self {
        self.first = Some(first);
        self.solver.steps = Some(steps);
        self
    }
}

impl Solver {
    /// Solves rows of these row-wires, or of those that explain their readings best if rows are not known.
    fn solve_rows(&mut self, row_wires: &mut [usize], readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> SolvedRows {
        let (channels, outputs) = (self.model.scale.columns(), self.trial_mm.len());
        let mut solved = SolvedRows::default();
        match self.steps {
            None if !self.searched.is_empty() => {
                let rows = readings_ohm
                    .chunks_exact(channels)
                    .zip(coordinates_mm.chunks_exact_mut(outputs));
                for (readings_ohm, coordinates_mm) in rows {
                    solved.count(self.search(readings_ohm, coordinates_mm).solution);
                }
                return solved;
            }
            Some(_) if !self.searched.is_empty() => {
                for (row_wire, answer_mm) in row_wires.iter_mut().zip(coordinates_mm.chunks_exact(outputs)) {
                    *row_wire = self.nearest_row(answer_mm);
                }
            }
            _ => {}
        }
        let count = |found: Estimate| solved.count(found.solution);
        self.estimator
            .solve_rows(row_wires, readings_ohm, coordinates_mm, self.steps, count);
        solved
    }

    /// The row-wire whose x is nearest to the mean x of an answer.
    fn nearest_row(&self, coordinates_mm: &[f64]) -> usize {
        let x_mm = coordinates_mm.iter().step_by(3).sum::<f64>() / (coordinates_mm.len() / 3) as f64;
        let distance = |row: usize| (self.model.geometry.row_x_mm(row) - x_mm).abs();
        let rows = self.searched.iter().map(|(row, _)| *row);
        rows.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0)
    }

    /// Tries row-wires in order of similarity with their readings at rest: the first that explains exact readings, or the
    /// one of the highest evidence under the noise. Rows that mirror each other may be confused.
    fn search(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Estimate {
        let unlike = |rest: &[f64]| -> f64 {
            let differences = rest.iter().zip(readings_ohm).map(|(rest, ohm)| ohm.ln() - rest);
            differences.map(|difference| difference * difference).sum()
        };
        let mut order: Vec<(f64, usize)> = self.searched.iter().map(|(row, rest)| (unlike(rest), *row)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_exact = self.estimator.is_exact();
        for &(_, row) in &order {
            let found = self.estimator.in_lanes(&[row], readings_ohm, coordinates_mm, None)[0];
            if let Some(found) = found.filter(|found| found.solution != Solution::None) {
                return found;
            }
        }
        let mut chosen: Option<(f64, usize, Estimate)> = None;
        for (_, row) in order {
            let found = self.estimator.try_row(row, readings_ohm, &mut self.trial_mm);
            let is_enough = is_exact && found.solution != Solution::None;
            let score = if is_exact { found.residual } else { found.surprise };
            // Written so that NaN is replaced.
            if is_enough || !chosen.is_some_and(|(lowest, ..)| lowest <= score) {
                chosen = Some((score, row, found));
                coordinates_mm.copy_from_slice(&self.trial_mm);
            }
            if is_enough {
                break;
            }
        }
        let (_, row, found) = chosen.expect("a decoder has at least one row");
        if found.solution == Solution::None || is_exact && found.is_open() {
            return self.estimator.search(row, readings_ohm, coordinates_mm);
        }
        found
    }
}

impl Decoder for NewtonDecoder {
    fn channels(&self) -> usize {
        self.solver.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.solver.model.scale.coordinates_per_row()
    }

    /// Rows are solved in parallel if there are many.
    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        /// Number of rows from which threads pay.
        const PARALLEL: usize = 64;
        /// Rows per block: a multiple of those that are solved side by side.
        const BLOCK: usize = 16;
        let (channels, outputs) = (self.channels(), self.outputs());
        let sizes = (row_indices.len() * channels, row_indices.len() * outputs);
        assert_eq!((readings.len(), targets.len()), sizes, "whole rows");
        DecodeError::check(readings, channels)?;
        if let Some(first) = &mut self.first {
            first.decode_rows(row_indices, readings, targets)?;
        }
        self.row_wires.clear();
        self.row_wires.extend(row_indices.iter().map(|&index| self.rows[index]));
        if row_indices.len() < PARALLEL {
            self.solved += self.solver.solve_rows(&mut self.row_wires, readings, targets);
            return Ok(());
        }
        let solved = self
            .row_wires
            .par_chunks_mut(BLOCK)
            .zip(readings.par_chunks(BLOCK * channels))
            .zip(targets.par_chunks_mut(BLOCK * outputs))
            .map_with(self.solver.clone(), |solver, ((rows, readings), targets)| {
                solver.solve_rows(rows, readings, targets)
            });
        self.solved += solved.reduce(SolvedRows::default, |mut all, some| {
            all += some;
            all
        });
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }
}
