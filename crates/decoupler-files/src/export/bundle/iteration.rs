//! The iteration on the equations of the sensor as bundles compute it.

use faer::{Mat, linalg::solvers::SolveLstsq};
use glam::DVec3;

use decoupler_core::{
    decoupling::{RowChoice, RowProblemDescription},
    sensor::RowConductance,
};

/// Relative misfit (root mean square) below which an answer explains its readings.
pub(super) const EXPLAINED: f64 = 1e-10;
/// Smallest fraction of a step; a step that must be shortened further leads out of the sensor.
pub(super) const SHORTEST_SHARE: f64 = 1e-3;
/// Starts of a row whose readings must be explained: the first answer, mid-range, at rest and fully pressed.
pub(super) const STARTS: usize = 4;

/// Solves rows with the same steps as the sources of a bundle.
pub(super) struct Iteration<'a> {
    equations: &'a RowProblemDescription,
    conductance: RowConductance,
}

/// Answer to a row for one row-wire.
struct Attempt {
    row: usize,
    unknowns_mm: Vec<f64>,
    misfit: f64,
}

impl Attempt {
    fn is_explained(&self) -> bool {
        self.misfit <= EXPLAINED
    }

    /// Returns the attempt with the smaller misfit, the earlier one if both are equal.
    fn better(best: Option<Self>, other: Self) -> Self {
        let is_best = best.as_ref().is_none_or(|best| other.misfit < best.misfit);
        if is_best { other } else { best.unwrap_or(other) }
    }
}

impl<'a> Iteration<'a> {
    pub(super) fn new(equations: &'a RowProblemDescription) -> Self {
        Self {
            conductance: RowConductance::new(&equations.model, equations.axes),
            equations,
        }
    }

    /// Returns coordinates in mm for the readings in ohm of a row-wire, given by its index among those read; `first`
    /// returns the answers of the map with an index.
    pub(super) fn decode(&mut self, row: usize, readings_ohm: &[f64], first: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
        let equations = self.equations;
        let starts = if equations.seeks_solution { STARTS } else { 1 };
        let attempt = match &equations.row_choice {
            RowChoice::Given => self.attempt(row, readings_ohm, &first(row), starts),
            RowChoice::Nearest => {
                let coordinates_mm = first(0);
                let row = self.nearest_row(&coordinates_mm);
                self.attempt(row, readings_ohm, &coordinates_mm, starts)
            }
            RowChoice::Tried { rest } => {
                let order = order_of_rows(rest, readings_ohm);
                let mut best: Option<Attempt> = None;
                // Most row-wires tried are wrong, and further starts would not help.
                for (starts, &row) in [1, starts]
                    .iter()
                    .flat_map(|&starts| order.iter().map(move |row| (starts, row)))
                {
                    if best.as_ref().is_some_and(Attempt::is_explained) {
                        break;
                    }
                    let attempt = self.attempt(row, readings_ohm, &first(row), starts);
                    best = Some(Attempt::better(best, attempt));
                }
                best.expect("at least one row-wire is read")
            }
        };
        self.coordinates_mm(&attempt)
    }

    fn nearest_row(&self, coordinates_mm: &[f64]) -> usize {
        let x_mm = coordinates_mm.iter().step_by(3).sum::<f64>() / (coordinates_mm.len() / 3) as f64;
        let rows = self.equations.rows.iter().enumerate();
        let apart = |&(_, &row): &(usize, &usize)| (self.equations.model.geometry.row_x_mm(row) - x_mm).abs();
        rows.min_by(|a, b| apart(a).total_cmp(&apart(b)))
            .map_or(0, |(index, _)| index)
    }

    fn attempt(&mut self, row: usize, readings_ohm: &[f64], first_mm: &[f64], starts: usize) -> Attempt {
        let mut best: Option<Attempt> = None;
        for start in 0..starts {
            if best.as_ref().is_some_and(Attempt::is_explained) {
                break;
            }
            let ranges = self.equations.ranges.iter();
            let start_mm = match start {
                0 => self.unknowns_of(row, first_mm),
                1 => ranges.map(|(low, high)| 0.5 * (low + high)).collect(),
                2 => ranges.map(|(low, high)| 0.0_f64.clamp(*low, *high)).collect(),
                _ => ranges.map(|(_, high)| *high).collect(),
            };
            best = Some(Attempt::better(best, self.iterate(row, readings_ohm, start_mm)));
        }
        best.expect("at least one start")
    }

    fn unknowns_of(&self, row: usize, coordinates_mm: &[f64]) -> Vec<f64> {
        let equations = self.equations;
        let nodes = coordinates_mm.chunks_exact(3).enumerate();
        nodes
            .flat_map(|(node, at_mm)| {
                let at_mm = DVec3::from_slice(at_mm);
                let displacement = equations.model.displacement_mm(equations.rows[row], node, at_mm);
                equations.axes.indices().iter().map(move |&axis| displacement[axis])
            })
            .collect()
    }

    fn displacements_mm(&self, unknowns_mm: &[f64]) -> Vec<DVec3> {
        let axes = self.equations.axes.indices();
        let of_node = |values: &[f64]| {
            let mut displacement = DVec3::ZERO;
            axes.iter()
                .zip(values)
                .for_each(|(&axis, &value)| displacement[axis] = value);
            displacement
        };
        unknowns_mm.chunks_exact(axes.len()).map(of_node).collect()
    }

    fn coordinates_mm(&self, attempt: &Attempt) -> Vec<f64> {
        let (model, row) = (&self.equations.model, self.equations.rows[attempt.row]);
        let displaced = self.displacements_mm(&attempt.unknowns_mm).into_iter().enumerate();
        displaced
            .flat_map(|(node, displacement)| model.displaced_mm(row, node, displacement).to_array())
            .collect()
    }

    fn iterate(&mut self, row: usize, readings_ohm: &[f64], start_mm: Vec<f64>) -> Attempt {
        let equations = self.equations;
        let within = |unknowns: &mut Vec<f64>| {
            for (unknown, &(low, high)) in unknowns.iter_mut().zip(&equations.ranges) {
                *unknown = unknown.max(low).min(high);
            }
        };
        let mut unknowns_mm = start_mm;
        within(&mut unknowns_mm);
        let first_mm = unknowns_mm.clone();
        let before = self.evaluate(row, readings_ohm, &unknowns_mm).0;
        for _ in 0..equations.steps {
            let (_, residuals, jacobian) = self.evaluate(row, readings_ohm, &unknowns_mm);
            let solution = jacobian.qr().solve_lstsq(residuals);
            let (mut share, mut length) = (1.0_f64, 0.0_f64);
            let mut steps_mm = Vec::new();
            for (place, &unknown) in unknowns_mm.iter().enumerate() {
                let ((low, high), (lowest, highest)) = (equations.ranges[place], equations.wide_ranges[place]);
                let step = -solution[(place, 0)];
                let step_mm = step * (high - low);
                let room_mm = if step > 0.0 { highest } else { lowest } - unknown;
                if step_mm != 0.0 {
                    share = share.min(room_mm / step_mm);
                }
                length = if step.is_finite() {
                    length.max(step.abs())
                } else {
                    f64::INFINITY
                };
                steps_mm.push(step_mm);
            }
            if share < SHORTEST_SHARE || length.is_infinite() {
                break;
            }
            unknowns_mm
                .iter_mut()
                .zip(&steps_mm)
                .for_each(|(unknown, step)| *unknown += share * step);
            if length <= equations.tolerance {
                break;
            }
        }
        within(&mut unknowns_mm);
        let misfit = self.evaluate(row, readings_ohm, &unknowns_mm).0;
        let is_lower = misfit <= before;
        Attempt {
            row,
            unknowns_mm: if is_lower { unknowns_mm } else { first_mm },
            misfit: if is_lower { misfit } else { before },
        }
    }

    /// Root mean square of the residuals m·s/g − 1, the residuals, and their derivatives in proportion to the ranges.
    fn evaluate(&mut self, row: usize, readings_ohm: &[f64], unknowns_mm: &[f64]) -> (f64, Mat<f64>, Mat<f64>) {
        let equations = self.equations;
        let displacements = self.displacements_mm(unknowns_mm);
        self.conductance
            .evaluate(&equations.model, equations.rows[row], &displacements);
        let per_ohm = |reading: usize| readings_ohm[reading] / equations.model.resistivity_ohm_per_mm;
        let count = readings_ohm.len();
        let residuals = Mat::from_fn(count, 1, |k, _| per_ohm(k) * self.conductance.sums()[k] - 1.0);
        let jacobian = Mat::from_fn(count, unknowns_mm.len(), |k, unknown| {
            let (low, high) = equations.ranges[unknown];
            per_ohm(k) * self.conductance.derivatives(unknown)[k] * (high - low)
        });
        (residuals.norm_l2() / (count as f64).sqrt(), residuals, jacobian)
    }
}

/// Returns the indices of the row-wires, sorted by the similarity of the readings to theirs at rest.
fn order_of_rows(rest: &[Vec<f64>], readings_ohm: &[f64]) -> Vec<usize> {
    let unlike = |row: &usize| -> f64 {
        let differences = rest[*row].iter().zip(readings_ohm).map(|(rest, ohm)| ohm.ln() - rest);
        differences.map(|difference| difference * difference).sum()
    };
    let mut order: Vec<usize> = (0..rest.len()).collect();
    order.sort_by(|a, b| unlike(a).total_cmp(&unlike(b)));
    order
}
