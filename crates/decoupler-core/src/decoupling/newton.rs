use std::fmt;

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::{
    DecodeError,
    gauss_newton::{LinearisedRow, Twins},
    plain_newton::{PlainNewton, SHORTEST_SHARE},
    row_problem::{Range, RowProblem, ranges, wide_ranges},
    side_by_side::LANES,
};
use crate::{scene::Scene, sensor::SensorModel};

/// Gauss-Newton method with Levenberg's damping and bounds for Eq. (2) of one known row-wire. Its unknowns are the
/// displacements that the scene allows.
///
/// Plain steps are tried first and solve nearly all rows. If they fail, each step solves `min ‖J δ + ρ‖² + μ ‖δ‖²` by
/// QR over the unknowns that are not held at a bound, and is clamped to the bounds. μ is 0 until a step fails to
/// lower the misfit; it is then multiplied by ten, and divided by ten after successful steps.
///
/// The misfit has local minima that are not solutions. An answer counts as the [solution](Solution) only if the
/// remaining misfit, or the rounding of readings and model if that is larger, implies an error below
/// [`LARGEST_ERROR`](super::LARGEST_ERROR); otherwise the method restarts elsewhere.
#[derive(Clone, Debug)]
pub struct Newton {
    plain: PlainNewton,
    problem: RowProblem,
    ranges: Vec<Range>,
    /// Ranges that plain steps may not leave.
    wide: Vec<Range>,
    rules: NewtonRules,
    linearised: LinearisedRow,
    twins: Twins,
    /// Buffer for the start of a row that is polished.
    start_mm: Vec<f64>,
}

/// Damping of the first retry after a failed step, relative to the largest diagonal entry of JᵀJ.
const FIRST_DAMPING: f64 = 1e-12;
/// Relative damping beyond which steps only get shorter.
const LARGEST_DAMPING: f64 = 1e6;
/// Distance, relative to the range, within which minima found from different starts count as the same.
const SAME: f64 = 1e-3;
/// Number of starts that must lead to the same minimum before the search ends without a solution.
const AGREEING_STARTS: usize = 6;

impl Newton {
    /// Largest number of plain steps before damped ones.
    pub(super) const MAX_PLAIN_STEPS: usize = 25;

    /// Creates a solver for rows of `model` in `scene`.
    pub fn new(model: &SensorModel, scene: &Scene, rules: NewtonRules) -> Self {
        let problem = RowProblem::new(model, scene.movement.axes());
        Self {
            plain: PlainNewton::new(model, scene),
            linearised: LinearisedRow::new(problem.unknowns()),
            problem,
            wide: wide_ranges(model, scene),
            ranges: ranges(model, scene),
            rules,
            twins: Twins::new(model, scene),
            start_mm: vec![0.0; ranges(model, scene).len()],
        }
    }

    /// Replaces the stopping rules.
    pub(super) fn set_rules(&mut self, rules: NewtonRules) {
        self.rules = rules;
    }

    /// Number of unknowns per row.
    pub fn unknowns(&self) -> usize {
        self.problem.unknowns()
    }

    /// Solves row-wire `row` for its readings in ohm (M4), and writes absolute coordinates (3·M2). Starts from an
    /// affine estimate, and restarts elsewhere if that leads to no solution.
    ///
    /// # Errors
    /// If readings are not resistances.
    pub fn solve(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<NewtonReport, DecodeError> {
        DecodeError::check(readings_ohm)?;
        match self.solve_plainly(&[row], readings_ohm, coordinates_mm)[0] {
            Some(report) => Ok(report),
            None => Ok(self.solve_carefully(row, readings_ohm, coordinates_mm)),
        }
    }

    /// Solves up to [`LANES`] row-wires at once by plain steps alone, for their valid readings in ohm (rows × M4),
    /// and writes the absolute coordinates (rows × 3·M2) of those with a unique solution; returns their reports.
    pub(super) fn solve_plainly(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> [Option<NewtonReport>; LANES] {
        if !self.plain.is_fit() {
            return [None; LANES];
        }
        let readings = readings_ohm.chunks_exact(self.problem.equations());
        for (lane, (&row, readings_ohm)) in rows.iter().zip(readings).enumerate() {
            self.plain.load(lane, row, readings_ohm);
        }
        self.plain.solve(self.rules);
        self.write_plain_answers(rows, coordinates_mm)
    }

    /// Polishes up to [`LANES`] row-wires at once, as [`Self::polish`], by plain steps alone; returns the reports of
    /// those for which they suffice.
    pub(super) fn polish_plainly(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> [Option<NewtonReport>; LANES] {
        if !self.plain.is_fit() {
            return [None; LANES];
        }
        let readings = readings_ohm.chunks_exact(self.problem.equations());
        let coordinates = coordinates_mm.chunks_exact(self.problem.coordinates());
        for (lane, ((&row, readings_ohm), coordinates_mm)) in rows.iter().zip(readings).zip(coordinates).enumerate() {
            self.problem.turn_to(row);
            self.problem.unknowns_of(coordinates_mm, &mut self.start_mm);
            self.plain.load_from(lane, row, readings_ohm, &self.start_mm);
        }
        self.plain.polish(self.rules);
        self.write_plain_answers(rows, coordinates_mm)
    }

    fn write_plain_answers(&mut self, rows: &[usize], coordinates_mm: &mut [f64]) -> [Option<NewtonReport>; LANES] {
        let mut reports = [None; LANES];
        let coordinates = coordinates_mm.chunks_exact_mut(self.problem.coordinates());
        for (lane, (&row, coordinates_mm)) in rows.iter().zip(coordinates).enumerate() {
            if let Some((report, unknowns_mm)) = self.plain.answer(lane) {
                self.problem.turn_to(row);
                self.problem.coordinates_of(unknowns_mm, coordinates_mm);
                reports[lane] = Some(report);
            }
        }
        self.plain.clear();
        reports
    }

    /// Solves with damping and bounds, from the middle of the ranges, with restarts if that leads to no solution.
    fn solve_carefully(&mut self, row: usize, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> NewtonReport {
        self.problem.read(row, readings_ohm);
        let mut starts = Starts::default();
        let (mut best, mut answer) = self.run(row, starts.next_mm(&self.ranges));
        let mut agreeing = 1;
        let max_starts = if self.is_redundant() { self.rules.starts } else { 1 };
        for _ in 1..max_starts {
            // Underdetermined readings have several answers from any start.
            if best.solution != Solution::None || agreeing == AGREEING_STARTS {
                break;
            }
            let (mut report, unknowns) = self.run(row, starts.next_mm(&self.ranges));
            report.steps += best.steps;
            let pairs = unknowns.iter().zip(&answer).zip(&self.ranges);
            let is_same = pairs
                .into_iter()
                .all(|((a, b), range)| (a - b).abs() <= SAME * range.width());
            if is_same {
                agreeing += 1;
            }
            if report.solution != Solution::None || report.residual < best.residual {
                if !is_same {
                    agreeing = 1;
                }
                (best, answer) = (report, unknowns);
            } else {
                best.steps = report.steps;
            }
        }
        self.problem.coordinates_of(&answer, coordinates_mm);
        best
    }

    /// Solves as [`Self::solve`], but only from the answer of another decoder in `coordinates_mm`, which is
    /// overwritten.
    ///
    /// # Errors
    /// If readings are not resistances.
    pub fn polish(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<NewtonReport, DecodeError> {
        DecodeError::check(readings_ohm)?;
        if let Some(report) = self.polish_plainly(&[row], readings_ohm, coordinates_mm)[0] {
            return Ok(report);
        }
        self.problem.read(row, readings_ohm);
        let mut start = vec![0.0; self.problem.unknowns()];
        self.problem.unknowns_of(coordinates_mm, &mut start);
        let (report, answer) = self.run(row, start);
        self.problem.coordinates_of(&answer, coordinates_mm);
        Ok(report)
    }

    /// Runs plain Gauss-Newton steps first, which converge from anywhere nearby, though the misfit may rise on the
    /// way. If they end out of bounds or do not converge, as with noise, damped steps within the bounds follow.
    /// Damped steps alone would take up to three times as long, and solve only half as many rows whose nodes move
    /// sideways.
    fn run(&mut self, row: usize, start: Vec<f64>) -> (NewtonReport, Vec<f64>) {
        let mut unknowns = start;
        self.clamp(&mut unknowns);
        let first = unknowns.clone();
        let before = self.problem.evaluate(&first);
        let (mut stop, mut steps) = self.take_plain_steps(&mut unknowns);
        let tolerance = self.rules.tolerance;
        let outside = |(value, range): (&f64, &Range)| {
            let apart = (value - range.clamp(*value)).abs();
            apart.is_nan() || apart > tolerance * range.width()
        };
        let is_out = unknowns.iter().zip(&self.ranges).any(outside);
        self.clamp(&mut unknowns);
        let mut residual = self.problem.evaluate(&unknowns);
        if residual > before || residual.is_nan() {
            unknowns = first;
            stop = NewtonStop::StepsTaken;
        }
        if steps < self.rules.steps && (is_out || stop != NewtonStop::Converged) {
            let more = self.descend(&mut unknowns, self.rules.steps - steps);
            stop = more.0;
            steps += more.1;
        }
        residual = self.problem.evaluate(&unknowns);
        let (solution, largest_error) = self.judge(row, &unknowns);
        let report = NewtonReport {
            stop,
            steps,
            residual,
            solution,
            largest_error,
        };
        (report, unknowns)
    }

    /// Judges an answer: to first order, errors of the readings with the norm e cause errors of the unknowns up to e
    /// times the largest norm of a row of J⁺.
    fn judge(&mut self, row: usize, unknowns: &[f64]) -> (Solution, f64) {
        self.linearised
            .linearise(&mut self.problem, &self.ranges, unknowns, false);
        let mut is_explained = true;
        let (mut squares, mut excess) = (0.0, 0.0);
        for (k, residual) in self.problem.residuals().iter().enumerate() {
            // Unknowns are rounded too, which matters where a node nearly touches an electrode.
            let rounding = ROUNDING + f64::EPSILON * self.linearised.reach(k);
            squares += rounding * rounding;
            excess += residual * residual;
            is_explained &= residual.abs() <= rounding;
        }
        let largest_error = self.linearised.largest_error(f64::max(squares, excess).sqrt());
        let is_only = || self.is_redundant() && !self.twins.has(row, unknowns);
        let solution = Solution::of(largest_error, is_explained, is_only);
        (solution, largest_error)
    }

    /// Returns `true` if there are more readings than unknowns. With as many equations as unknowns there are often
    /// several solutions that nothing distinguishes; with one unknown, the resistance is monotonic in the
    /// compression.
    fn is_redundant(&self) -> bool {
        let (equations, unknowns) = (self.problem.equations(), self.problem.unknowns());
        equations > unknowns || unknowns == 1
    }

    fn clamp(&self, unknowns: &mut [f64]) {
        for (value, range) in unknowns.iter_mut().zip(&self.ranges) {
            *value = range.clamp(*value);
        }
    }

    /// Takes plain steps, each shortened to stay within the domain of the model.
    fn take_plain_steps(&mut self, unknowns: &mut [f64]) -> (NewtonStop, usize) {
        let most = self.rules.steps.min(Self::MAX_PLAIN_STEPS);
        for steps in 1..=most {
            let Self {
                linearised,
                problem,
                wide,
                ranges,
                ..
            } = self;
            linearised.linearise(problem, ranges, unknowns, false);
            linearised.solve(ranges, 0.0);
            let mut share = 1.0_f64;
            let mut length = 0.0_f64;
            let step_mm = &linearised.step_mm;
            for (((&step, &value), wide), range) in step_mm.iter().zip(&*unknowns).zip(&*wide).zip(&*ranges) {
                let room = if step > 0.0 {
                    wide.highest - value
                } else {
                    wide.lowest - value
                };
                if step != 0.0 {
                    share = share.min(room / step);
                }
                length = length.max((step / range.width()).abs());
            }
            let is_finite = step_mm.iter().all(|step| step.is_finite());
            // Written so that NaN also ends the iteration.
            if !(share >= SHORTEST_SHARE && is_finite) {
                return (NewtonStop::NoStepHelps, steps - 1);
            }
            unknowns
                .iter_mut()
                .zip(step_mm)
                .for_each(|(value, step)| *value += share * step);
            if length <= self.rules.tolerance {
                return (NewtonStop::Converged, steps);
            }
        }
        (NewtonStop::StepsTaken, most)
    }

    /// Takes damped steps within the bounds, each of which lowers the misfit.
    fn descend(&mut self, unknowns: &mut Vec<f64>, max_steps: usize) -> (NewtonStop, usize) {
        let mut residual = self.problem.evaluate(unknowns);
        let mut damping = 0.0;
        for steps in 1..=max_steps {
            let Self {
                linearised,
                problem,
                ranges,
                ..
            } = self;
            linearised.linearise(problem, ranges, unknowns, true);
            if linearised.is_held() {
                return (NewtonStop::Converged, steps);
            }
            let (next, length, next_residual) = loop {
                linearised.solve(ranges, damping);
                let mut next = unknowns.clone();
                let mut length = 0.0_f64;
                for ((value, step), range) in next.iter_mut().zip(&linearised.step_mm).zip(&*ranges) {
                    let from = *value;
                    *value = range.clamp(from + step);
                    length = length.max((*value - from).abs() / range.width());
                }
                let is_finite = linearised.step_mm.iter().all(|step| step.is_finite());
                let next_residual = if is_finite {
                    problem.evaluate(&next)
                } else {
                    f64::INFINITY
                };
                // A step this short is within rounding: the misfit cannot decrease further.
                let short = is_finite && length <= self.rules.tolerance;
                if next_residual < residual || short || damping > LARGEST_DAMPING {
                    break (next, length, next_residual);
                }
                damping = (10.0 * damping).max(FIRST_DAMPING);
            };
            if damping > LARGEST_DAMPING {
                return (NewtonStop::NoStepHelps, steps);
            }
            *unknowns = next;
            residual = next_residual;
            damping = if damping > 10.0 * FIRST_DAMPING {
                0.1 * damping
            } else {
                0.0
            };
            if length <= self.rules.tolerance {
                return (NewtonStop::Converged, steps);
            }
        }
        (NewtonStop::StepsTaken, max_steps)
    }
}

/// Stopping rules of the Gauss-Newton method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonRules {
    /// Maximum number of steps from one start. A step that is rejected and shortened counts as one.
    pub steps: usize,
    /// Step length, relative to the range of the unknown, below which the method has converged. Plain steps also end
    /// if another one could only lower residuals within their rounding.
    pub tolerance: f64,
    /// Maximum number of starts; the method restarts if one does not lead to a solution.
    pub starts: usize,
}

impl Default for NewtonRules {
    /// Returns limits of 50 steps and 16 starts, and a tolerance of a tenth of a picometre for a stroke of a
    /// millimetre, where rounding of the readings begins to show in the worst-determined pattern of the paper's
    /// largest array (singular value 1e-5 per mm).
    fn default() -> Self {
        Self {
            steps: 50,
            tolerance: 1e-10,
            starts: 16,
        }
    }
}

/// Reason for stopping the Gauss-Newton method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewtonStop {
    /// The last step was shorter than the tolerance.
    Converged,
    /// All allowed steps were taken.
    StepsTaken,
    /// No damping yields a step that lowers the misfit.
    NoStepHelps,
}

impl fmt::Display for NewtonStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Converged => "converged",
            Self::StepsTaken => "all steps taken",
            Self::NoStepHelps => {
                "no step lowers the misfit: readings do not come from this sensor, or leave it undetermined"
            }
        })
    }
}

/// Status of an answer to the equations of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solution {
    /// The answer explains the readings and no other one does: its error is at most [`LARGEST_ERROR`] of the range.
    Unique,
    /// The answer does not explain the readings: it is a local minimum of the misfit, not a solution.
    None,
    /// The answer explains the readings to rounding, but others do as well: the readings do not determine it.
    Undetermined,
}

impl Solution {
    /// Judges an answer by the largest error that its remaining misfit implies; `is_explained` states that rounding
    /// explains the misfit, and `is_only` that no other answer is as good.
    pub(super) fn of(largest_error: f64, is_explained: bool, is_only: impl FnOnce() -> bool) -> Self {
        if largest_error <= LARGEST_ERROR {
            if is_only() { Self::Unique } else { Self::Undetermined }
        } else if is_explained {
            Self::Undetermined
        } else {
            Self::None
        }
    }
}

/// Maximum rounding error of a residual: of the true resistance and the modelled one (4 units in the last place each),
/// of the reading and of the residual itself.
pub(super) const ROUNDING: f64 = 10.0 * f64::EPSILON;
/// Largest error of an unknown, relative to its range, of an answer that counts as the solution.
pub const LARGEST_ERROR: f64 = 1e-6;

/// Outcome of solving a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Reason for stopping.
    pub stop: NewtonStop,
    /// Number of steps, over all starts.
    pub steps: usize,
    /// Root mean square over readings of the relative misfit m/R − 1.
    pub residual: f64,
    /// Status of the answer.
    pub solution: Solution,
    /// Largest error of an unknown, relative to its range, caused by misfit and rounding to first order.
    pub largest_error: f64,
}

/// Starts of the Gauss-Newton method in order: the middle of the ranges, which is closest to any answer, the
/// undeformed state, the full stroke, then random ones, the same for every row.
#[derive(Default)]
pub(super) struct Starts {
    given: usize,
    /// Seeded only when needed, which is rare.
    rng: Option<ChaCha8Rng>,
}

impl Starts {
    /// Returns the unknowns of the next start in millimetres.
    pub(super) fn next_mm(&mut self, ranges: &[Range]) -> Vec<f64> {
        self.given += 1;
        let ranges = ranges.iter();
        match self.given {
            1 => ranges.map(|range| range.middle()).collect(),
            2 => ranges.map(|range| range.clamp(0.0)).collect(),
            3 => ranges.map(|range| range.highest).collect(),
            _ => {
                let rng = self.rng.get_or_insert_with(|| ChaCha8Rng::seed_from_u64(0));
                ranges
                    .map(|range| range.lowest + range.width() * rng.random_range(0.0..=1.0))
                    .collect()
            }
        }
    }
}

#[cfg(test)]
mod tests;
