use glam::DVec3;

use super::{
    affine_map::AffineStart,
    gauss_newton::Twins,
    newton::{NewtonReport, NewtonRules, NewtonStop, ROUNDING, Solution},
    row_problem::{Range, ranges, wide_ranges},
    side_by_side::{LANES, SideBySide, write_normal_equations},
};
use crate::{
    scene::Scene,
    sensor::{Axes, RowConductance, SensorModel},
};

/// Plain Gauss-Newton steps for several row-wires at once, which suffice for nearly all rows: no damping, no bounds,
/// one evaluation of Eq. (2) and one Cholesky factorisation per step, and no allocation. Other rows are given up and
/// left to [`Newton`](super::Newton).
///
/// A step is the last one if its linearisation error is within the rounding of the residuals: a step of length δ
/// changes 1/d by at most δ²/d³ more than predicted by its derivatives, since no second derivative of 1/d exceeds
/// 2/d³. Residuals at the answer are then those of the linear equations, and need no further evaluation.
#[derive(Clone, Debug)]
pub(super) struct PlainNewton {
    model: SensorModel,
    axes: Axes,
    ranges: Vec<Range>,
    wide: Vec<Range>,
    /// Maximum length of a last step.
    last_length_mm: f64,
    /// False if plain steps alone never solve a row.
    is_fit: bool,
    twins: Twins,
    /// Start for each row-wire that was read.
    starts: Vec<Option<AffineStart>>,
    conductance: RowConductance,
    displacements_mm: Vec<DVec3>,
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
    Judged(NewtonReport),
}

/// Smallest fraction of a step; a shorter one would lead out of the sensor.
pub(super) const SHORTEST_SHARE: f64 = 1e-3;
/// Maximum memory for the estimates of all row-wires; above it, rows start from the middle, which takes one more step.
const LARGEST_STARTS_BYTES: usize = 256 << 20;
/// Maximum number of steps; quadratic convergence needs no more.
const MAX_STEPS: usize = 12;
/// Initial steps exempt from the contraction test.
const EXEMPT_STEPS: usize = 2;

impl PlainNewton {
    pub(super) fn new(model: &SensorModel, scene: &Scene) -> Self {
        let (axes, ranges, wide) = (scene.movement.axes(), ranges(model, scene), wide_ranges(model, scene));
        let (unknowns, readings) = (ranges.len(), model.scale.columns());
        let length = padded(readings);
        let deepest_mm = wide.iter().skip(axes.count() - 1).step_by(axes.count());
        let deepest_mm = deepest_mm.map(|range| range.highest).fold(0.0, f64::max);
        let gap_mm = model.geometry.height_mm - deepest_mm;
        let largest_mm = wide
            .iter()
            .fold(0.0, |most: f64, range| most.max(-range.lowest).max(range.highest));
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
        Self {
            model: *model,
            axes,
            last_length_mm: gap_mm * f64::EPSILON.sqrt() / (axes.count() as f64).sqrt(),
            is_fit: (readings > unknowns || unknowns == 1)
                && RowConductance::is_within_reach(model, gap_mm, largest_mm),
            ranges,
            wide,
            twins: Twins::new(model, scene),
            starts: vec![None; model.scale.rows()],
            conductance: RowConductance::new(model, axes),
            displacements_mm: vec![DVec3::ZERO; model.scale.nodes_per_row()],
            entries: vec![0.0; (unknowns + 1) * (unknowns + 2) / 2],
            equations: SideBySide::new(unknowns),
            lanes: vec![lane; LANES],
        }
    }

    /// Returns `true` if plain steps alone may solve a row.
    pub(super) fn is_fit(&self) -> bool {
        self.is_fit
    }

    /// Loads row-wire `row` with its valid readings into `lane`, starting from the affine estimate.
    pub(super) fn load(&mut self, lane: usize, row: usize, readings_ohm: &[f64]) {
        let lane = &mut self.lanes[lane];
        lane.read(row, readings_ohm);
        let bytes = self.model.scale.rows() * AffineStart::bytes(&self.model);
        if self.axes == Axes::Z && bytes <= LARGEST_STARTS_BYTES {
            let (model, stroke) = (&self.model, self.ranges[0]);
            let start = self.starts[row].get_or_insert_with(|| AffineStart::new(model, row, stroke));
            start.estimate(readings_ohm, &mut lane.unknowns_mm);
        } else {
            let middles = lane.unknowns_mm.iter_mut().zip(&self.ranges);
            middles.for_each(|(unknown, range)| *unknown = range.middle());
        }
        lane.clamp(&self.ranges);
    }

    /// Loads row-wire `row` with its valid readings into `lane`, starting from `unknowns_mm`.
    pub(super) fn load_from(&mut self, lane: usize, row: usize, readings_ohm: &[f64], unknowns_mm: &[f64]) {
        let lane = &mut self.lanes[lane];
        lane.read(row, readings_ohm);
        lane.unknowns_mm.copy_from_slice(unknowns_mm);
        lane.clamp(&self.ranges);
    }

    pub(super) fn clear(&mut self) {
        self.lanes.iter_mut().for_each(|lane| lane.state = State::GivenUp);
    }

    /// Returns the report on the row in `lane` and its unknowns, unless it was given up.
    pub(super) fn answer(&self, lane: usize) -> Option<(NewtonReport, &[f64])> {
        match self.lanes[lane].state {
            State::Judged(report) => Some((report, &self.lanes[lane].unknowns_mm)),
            State::Moving | State::Arrived | State::GivenUp => None,
        }
    }

    /// Solves the loaded rows: those that reach a unique solution are judged, others are given up.
    pub(super) fn solve(&mut self, rules: NewtonRules) {
        self.take_steps(rules);
        for lane in &mut self.lanes {
            if lane.state == State::Moving {
                lane.state = State::GivenUp;
            }
        }
    }

    /// Takes at most the steps of `rules` from the starts of the loaded rows, and judges the results, unless the
    /// misfit grew.
    pub(super) fn polish(&mut self, rules: NewtonRules) {
        self.take_steps(rules);
        if !self.lanes.iter().any(|lane| lane.state == State::Moving) {
            return;
        }
        for lane in 0..LANES {
            if self.lanes[lane].state == State::Moving {
                self.lanes[lane].clamp(&self.ranges);
                if rules.steps == 0 {
                    self.linearise(lane);
                } else {
                    self.evaluate_misfits(lane);
                }
            }
        }
        // The derivatives before the last step are used: if the error is small enough to count, the step was so short
        // that they hardly changed.
        if rules.steps == 0 {
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
                let report = self.judge(index, inverse_row, (NewtonStop::StepsTaken, rules.steps));
                self.lanes[index].state = State::Judged(report);
            }
        }
    }

    fn take_steps(&mut self, rules: NewtonRules) {
        for step in 1..=rules.steps.min(MAX_STEPS) {
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
                    self.lanes[lane].state = self.move_on(lane, step, rules.tolerance);
                }
            }
            if self.lanes.iter().any(|lane| lane.state == State::Arrived) {
                let inverse_rows = self.equations.largest_inverse_rows();
                for (lane, inverse_row) in inverse_rows.into_iter().enumerate() {
                    if self.lanes[lane].state == State::Arrived {
                        let report = self.judge(lane, inverse_row, (NewtonStop::Converged, step));
                        let is_only = report.solution == Solution::Unique;
                        self.lanes[lane].state = if is_only { State::Judged(report) } else { State::GivenUp };
                    }
                }
            }
        }
    }

    /// Evaluates Eq. (2) for the row in `lane` and sets its normal equations.
    fn linearise(&mut self, index: usize) {
        self.place_nodes(index);
        let row = self.lanes[index].row;
        self.conductance
            .evaluate_refined(&self.model, row, &self.displacements_mm);
        self.write_misfits(index);
        let lane = &mut self.lanes[index];
        let (readings, per_ohm) = (lane.readings_ohm.len(), 1.0 / self.model.resistivity_ohm_per_mm);
        let jacobian = &mut lane.system[..lane.unknowns_mm.len() * padded(readings)];
        for ((unknown, slopes), range) in jacobian
            .chunks_exact_mut(padded(readings))
            .enumerate()
            .zip(&self.ranges)
        {
            let factor = per_ohm * range.width();
            let derivatives = self.conductance.derivatives(unknown).iter().zip(&lane.readings_ohm);
            for (slope, (derivative, ohm)) in slopes.iter_mut().zip(derivatives) {
                *slope = factor * ohm * derivative;
            }
        }
        if lane.length.is_infinite() {
            lane.first_residual = lane.residual;
        }
        write_normal_equations(&lane.system, padded(readings), &mut self.entries);
        self.equations.set(index, &self.entries);
    }

    /// Evaluates the misfits of Eq. (2) for the row in `lane`, without updating its normal equations.
    fn evaluate_misfits(&mut self, index: usize) {
        self.place_nodes(index);
        let row = self.lanes[index].row;
        self.conductance
            .evaluate_sums_refined(&self.model, row, &self.displacements_mm);
        self.write_misfits(index);
    }

    fn place_nodes(&mut self, index: usize) {
        let axes = self.axes.indices();
        let nodes = self.lanes[index].unknowns_mm.chunks_exact(axes.len());
        for (displacement, values) in self.displacements_mm.iter_mut().zip(nodes) {
            for (&axis, &value) in axes.iter().zip(values) {
                displacement[axis] = value;
            }
        }
    }

    fn write_misfits(&mut self, index: usize) {
        let lane = &mut self.lanes[index];
        let (readings, per_ohm) = (lane.readings_ohm.len(), 1.0 / self.model.resistivity_ohm_per_mm);
        let misfits = &mut lane.system[lane.unknowns_mm.len() * padded(readings)..];
        let mut squares = 0.0;
        let pairs = lane.readings_ohm.iter().zip(self.conductance.sums());
        for (misfit, (ohm, sum)) in misfits.iter_mut().zip(pairs) {
            *misfit = 1.0 - ohm * per_ohm * sum;
            squares += *misfit * *misfit;
        }
        lane.residual = rms(squares, readings);
    }

    /// Takes one step of the row in `lane`.
    fn move_on(&mut self, index: usize, step: usize, tolerance: f64) -> State {
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
            if beyond.abs() > tolerance {
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

    /// Judges the answer in `lane` by its residuals: to first order, errors of the readings with the norm e cause
    /// errors of the unknowns up to e times the largest norm of a row of J⁺.
    fn judge(&self, index: usize, inverse_row: f64, (stop, steps): (NewtonStop, usize)) -> NewtonReport {
        let lane = &self.lanes[index];
        let readings = lane.readings_ohm.len();
        let (jacobian, misfits) = lane.system.split_at(lane.unknowns_mm.len() * padded(readings));
        let mut is_explained = true;
        let (mut squares, mut excess) = (0.0, 0.0);
        for (k, misfit) in misfits[..readings].iter().enumerate() {
            let slopes = jacobian.iter().skip(k).step_by(padded(readings));
            // Unknowns are rounded too, which matters where a node nearly touches an electrode.
            let rounding = ROUNDING + f64::EPSILON * slopes.map(|slope| slope.abs()).sum::<f64>();
            squares += rounding * rounding;
            excess += misfit * misfit;
            is_explained &= misfit.abs() <= rounding;
        }
        let largest_error = f64::max(squares, excess).sqrt() * inverse_row;
        let has_twin = || self.twins.has(lane.row, &lane.unknowns_mm);
        NewtonReport {
            stop,
            steps,
            residual: rms(excess, readings),
            solution: Solution::of(largest_error, is_explained, || !has_twin()),
            largest_error,
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

    fn clamp(&mut self, ranges: &[Range]) {
        for (unknown, range) in self.unknowns_mm.iter_mut().zip(ranges) {
            *unknown = range.clamp(*unknown);
        }
    }
}

fn rms(squares: f64, count: usize) -> f64 {
    (squares / count as f64).sqrt()
}

/// Number of readings rounded up to whole vector registers.
fn padded(readings: usize) -> usize {
    readings.next_multiple_of(LANES)
}
