use std::sync::{Arc, OnceLock};

use super::{
    Estimate, LARGEST_ERROR, Misfits, Solution,
    estimator::TOLERANCE,
    row_problem::{Range, RowProblem, ranges, smallest_gap_mm, wide_ranges},
    side_by_side::{LANES, SideBySide, write_normal_equations},
    symmetry::Symmetry,
};
use crate::{
    decoupling::affine_map::AffineStart,
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// Plain Gauss-Newton steps for several row-wires with exact readings at once, which suffice for nearly all rows: no
/// prior, no damping, no bounds, one evaluation of Eq. (2) and one Cholesky factorisation per step, and no allocation.
/// Other rows are given up and left to the [`Estimator`](super::Estimator).
///
/// A step is the last one if its linearisation error is within the rounding of the residuals: a step of length δ
/// changes 1/d by at most δ²/d³ more than predicted by its derivatives, since no second derivative of 1/d exceeds
/// 2/d³. Residuals at the answer are then those of the linear equations, and need no further evaluation.
#[derive(Clone, Debug)]
pub(super) struct Lanes {
    model: SensorModel,
    problem: RowProblem,
    ranges: Vec<Range>,
    wide: Vec<Range>,
    /// Maximum length of a last step.
    last_length_mm: f64,
    symmetry: Symmetry,
    /// Affine estimate for each row-wire that was read, if nodes move along z only.
    starts: Arc<[OnceLock<AffineStart>]>,
    entries: Vec<f64>,
    equations: SideBySide,
    lanes: Vec<Lane>,
}

/// A row that is being solved.
#[derive(Clone, Debug)]
struct Lane {
    row: usize,
    readings_ohm: Vec<f64>,
    unknowns_mm: Vec<f64>,
    /// Jacobian in units of the ranges, unknown by unknown, then −ρ: each padded to whole registers.
    system: Vec<f64>,
    first_residual: f64,
    residual: f64,
    length: f64,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Moving,
    /// The last step was taken; the equations are still those before it.
    Arrived,
    GivenUp,
    Judged(Estimate),
}

/// Smallest fraction of a step; a shorter one would lead out of the sensor.
const SHORTEST_SHARE: f64 = 1e-3;
/// Maximum memory for the estimates of all row-wires; above it, rows start from the middle, which takes one more step.
const LARGEST_STARTS_BYTES: usize = 256 << 20;
/// Maximum number of steps; quadratic convergence needs no more.
const MAX_STEPS: usize = 12;
/// Initial steps exempt from the contraction test.
const EXEMPT_STEPS: usize = 2;

impl Lanes {
    /// Creates lanes for `rows` of `model`; `None` if plain steps alone never solve a row of `scene`.
    pub(super) fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Option<Self> {
        let (axes, ranges, wide) = (scene.movement.axes(), ranges(model, scene), wide_ranges(model, scene));
        let (unknowns, readings) = (ranges.len(), model.scale.columns());
        let length = padded(readings);
        let problem = RowProblem::refined(model, scene)?;
        let lane = Lane {
            row: 0,
            readings_ohm: vec![0.0; readings],
            unknowns_mm: vec![0.0; unknowns],
            system: vec![0.0; (unknowns + 1) * length],
            first_residual: 0.0,
            residual: 0.0,
            length: 0.0,
            state: State::GivenUp,
        };
        let has_starts = axes == Axes::Z && model.scale.rows() * AffineStart::bytes(model) <= LARGEST_STARTS_BYTES;
        let starts = if has_starts { model.scale.rows() } else { 0 };
        problem.is_redundant(problem.equations()).then(|| Self {
            model: *model,
            problem,
            last_length_mm: smallest_gap_mm(model, scene) * f64::EPSILON.sqrt() / (axes.count() as f64).sqrt(),
            ranges,
            wide,
            symmetry: Symmetry::new(model, scene, rows),
            starts: (0..starts).map(|_| OnceLock::new()).collect(),
            entries: vec![0.0; (unknowns + 1) * (unknowns + 2) / 2],
            equations: SideBySide::new(unknowns),
            lanes: vec![lane; LANES],
        })
    }

    /// Solves up to [`LANES`] row-wires for their valid readings in ohm (rows × M4), and writes the absolute coordinates
    /// (rows × 3·M2) of those that plain steps solve; returns their estimates. With `steps`, it takes at most that many from
    /// the answers of another decoder in `coordinates_mm`, and gives up answers whose misfit grew.
    pub(super) fn solve(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: Option<usize>,
    ) -> [Option<Estimate>; LANES] {
        let readings = readings_ohm.chunks_exact(self.problem.equations());
        let coordinates = coordinates_mm.chunks_exact(self.problem.coordinates());
        let rows_read = rows.iter().zip(readings).zip(coordinates);
        for (lane, ((&row, readings_ohm), coordinates_mm)) in self.lanes.iter_mut().zip(rows_read) {
            lane.read(row, readings_ohm);
            if steps.is_some() {
                self.problem.turn_to(row);
                self.problem.unknowns_of(coordinates_mm, &mut lane.unknowns_mm);
            } else if let Some(start) = self.starts.get(row) {
                let (model, stroke) = (&self.model, self.ranges[0]);
                let start = start.get_or_init(|| AffineStart::new(model, row, stroke));
                start.estimate(readings_ohm, &mut lane.unknowns_mm);
            } else {
                let middles = lane.unknowns_mm.iter_mut().zip(&self.ranges);
                middles.for_each(|(unknown, range)| *unknown = range.middle());
            }
            lane.clamp(&self.ranges);
        }
        self.take_steps(steps.unwrap_or(MAX_STEPS));
        if let Some(steps) = steps {
            self.judge_moving(steps);
        }
        self.write_answers(rows, coordinates_mm)
    }

    fn write_answers(&mut self, rows: &[usize], coordinates_mm: &mut [f64]) -> [Option<Estimate>; LANES] {
        let mut estimates = [None; LANES];
        let coordinates = coordinates_mm.chunks_exact_mut(self.problem.coordinates());
        for ((lane, estimate), (&row, coordinates_mm)) in
            self.lanes.iter().zip(&mut estimates).zip(rows.iter().zip(coordinates))
        {
            if let State::Judged(found) = lane.state {
                self.problem.turn_to(row);
                self.problem.coordinates_of(&lane.unknowns_mm, coordinates_mm);
                *estimate = Some(found);
            }
        }
        self.lanes.iter_mut().for_each(|lane| lane.state = State::GivenUp);
        estimates
    }

    /// Judges the answers of lanes that took all `steps`.
    fn judge_moving(&mut self, steps: usize) {
        if !self.lanes.iter().any(|lane| lane.state == State::Moving) {
            return;
        }
        for lane in 0..LANES {
            if self.lanes[lane].state == State::Moving {
                self.lanes[lane].clamp(&self.ranges);
                if steps == 0 {
                    self.linearise(lane);
                } else {
                    let lane = &mut self.lanes[lane];
                    self.problem.read(lane.row, &lane.readings_ohm);
                    lane.residual = self.problem.evaluate_residuals(&lane.unknowns_mm);
                    lane.write_misfits(&self.problem);
                }
            }
        }
        // The derivatives before the last step are used: if the error is small enough to count, the step was so short
        // that they hardly changed.
        if steps == 0 {
            self.equations.solve();
        }
        let inverse_rows = self.equations.largest_inverse_rows();
        for (index, inverse_row) in inverse_rows.into_iter().enumerate() {
            let lane = &mut self.lanes[index];
            if lane.state != State::Moving {
                continue;
            }
            lane.state = State::GivenUp;
            if lane.residual <= lane.first_residual && self.equations.is_well_conditioned(index) {
                let found = self.judge(index, inverse_row, (false, steps));
                self.lanes[index].state = State::Judged(found);
            }
        }
    }

    /// Takes at most `steps` steps from the starts of the rows that were read; those that converge to a determined
    /// answer are judged.
    fn take_steps(&mut self, steps: usize) {
        for step in 1..=steps.min(MAX_STEPS) {
            for lane in 0..LANES {
                if self.lanes[lane].state == State::Moving {
                    self.linearise(lane);
                }
            }
            if !self.lanes.iter().any(|lane| lane.state == State::Moving) {
                return;
            }
            self.equations.solve();
            for lane in 0..LANES {
                if self.lanes[lane].state == State::Moving {
                    self.lanes[lane].state = self.move_on(lane, step);
                }
            }
            if self.lanes.iter().any(|lane| lane.state == State::Arrived) {
                let inverse_rows = self.equations.largest_inverse_rows();
                for (lane, inverse_row) in inverse_rows.into_iter().enumerate() {
                    if self.lanes[lane].state == State::Arrived {
                        let found = self.judge(lane, inverse_row, (true, step));
                        let is_determined = found.spread <= LARGEST_ERROR;
                        self.lanes[lane].state = if is_determined {
                            State::Judged(found)
                        } else {
                            State::GivenUp
                        };
                    }
                }
            }
        }
    }

    /// Evaluates Eq. (2) for the row in a lane and sets its normal equations.
    fn linearise(&mut self, index: usize) {
        let lane = &mut self.lanes[index];
        self.problem.read(lane.row, &lane.readings_ohm);
        lane.residual = self.problem.evaluate(&lane.unknowns_mm);
        lane.write_misfits(&self.problem);
        let length = padded(lane.readings_ohm.len());
        let columns = lane.system.chunks_exact_mut(length).zip(&self.ranges);
        for (unknown, (slopes, range)) in columns.enumerate() {
            self.problem.write_slopes(unknown, range.width(), slopes);
        }
        if lane.length.is_infinite() {
            lane.first_residual = lane.residual;
        }
        write_normal_equations(&lane.system, length, &mut self.entries);
        self.equations.set(index, &self.entries);
    }

    /// Takes one step of the row in a lane.
    fn move_on(&mut self, index: usize, step: usize) -> State {
        let lane = &mut self.lanes[index];
        if !self.equations.is_well_conditioned(index) {
            return State::GivenUp;
        }
        let (mut length, mut length_mm, mut part, mut is_finite) = (0.0_f64, 0.0_f64, 1.0_f64, true);
        let unknowns = lane.unknowns_mm.iter().zip(&self.ranges).zip(&self.wide);
        for (place, ((&unknown, range), wide)) in unknowns.enumerate() {
            let share = self.equations.solution(index, place);
            let step_mm = share * range.width();
            let room_mm = if step_mm > 0.0 { wide.highest } else { wide.lowest } - unknown;
            if step_mm != 0.0 {
                part = part.min(room_mm / step_mm);
            }
            is_finite &= step_mm.is_finite();
            length = length.max(share.abs());
            length_mm = length_mm.max(step_mm.abs());
        }
        if !is_finite || part < SHORTEST_SHARE || step > EXEMPT_STEPS && length > 0.5 * lane.length {
            return State::GivenUp;
        }
        for (place, (unknown, range)) in lane.unknowns_mm.iter_mut().zip(&self.ranges).enumerate() {
            *unknown += part * self.equations.solution(index, place) * range.width();
        }
        lane.length = length;
        if part < 1.0 || length_mm > self.last_length_mm {
            return State::Moving;
        }
        // The residuals at the answer, clamped to its ranges.
        let readings = padded(lane.readings_ohm.len());
        let (jacobian, misfits) = lane.system.split_at_mut(lane.unknowns_mm.len() * readings);
        for (place, (unknown, range)) in lane.unknowns_mm.iter_mut().zip(&self.ranges).enumerate() {
            let within = range.clamp(*unknown);
            let beyond = (*unknown - within) / range.width();
            if beyond.abs() > TOLERANCE {
                return State::GivenUp;
            }
            *unknown = within;
            let share = self.equations.solution(index, place) - beyond;
            let slopes = &jacobian[place * readings..(place + 1) * readings];
            misfits
                .iter_mut()
                .zip(slopes)
                .for_each(|(misfit, slope)| *misfit -= slope * share);
        }
        State::Arrived
    }

    /// Judges the answer in a lane by its residuals.
    fn judge(&self, index: usize, inverse_row: f64, (has_converged, steps): (bool, usize)) -> Estimate {
        let lane = &self.lanes[index];
        let readings = lane.readings_ohm.len();
        let (jacobian, misfits) = lane.system.split_at(lane.unknowns_mm.len() * padded(readings));
        let mut all = Misfits::default();
        for (k, misfit) in misfits[..readings].iter().enumerate() {
            all.add(*misfit, jacobian.iter().skip(k).step_by(padded(readings)).copied());
        }
        let spread = all.norm() * inverse_row;
        let is_only = || spread <= LARGEST_ERROR && !self.symmetry.has_twin(lane.row, &lane.unknowns_mm);
        Estimate {
            has_converged,
            steps,
            residual: all.residual(readings),
            drift: 0.0,
            spread,
            solution: Solution::of(all.are_explained(spread), is_only),
            surprise: f64::NAN,
        }
    }
}

impl Lane {
    fn read(&mut self, row: usize, readings_ohm: &[f64]) {
        self.row = row;
        self.readings_ohm.copy_from_slice(readings_ohm);
        self.length = f64::INFINITY;
        self.state = State::Moving;
    }

    /// Writes −ρ of the last evaluation.
    fn write_misfits(&mut self, problem: &RowProblem) {
        let misfits = &mut self.system[self.unknowns_mm.len() * padded(self.readings_ohm.len())..];
        let pairs = misfits.iter_mut().zip(problem.residuals());
        pairs.for_each(|(misfit, residual)| *misfit = -residual);
    }

    fn clamp(&mut self, ranges: &[Range]) {
        for (unknown, range) in self.unknowns_mm.iter_mut().zip(ranges) {
            *unknown = range.clamp(*unknown);
        }
    }
}

/// Number of readings rounded up to whole vector registers.
fn padded(readings: usize) -> usize {
    readings.next_multiple_of(LANES)
}
