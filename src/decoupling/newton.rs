use std::fmt;

use faer::{Mat, linalg::solvers::SolveLstsq};
use thiserror::Error;

use super::row_problem::{Range, RowProblem, ranges, wide_ranges};
use crate::{
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// When to end Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonRules {
    /// Most steps. A step that was rejected and shortened counts as one.
    pub steps: usize,
    /// Length of a step, in millimetres, below which the deformation is known.
    pub tolerance_mm: f64,
}

impl Default for NewtonRules {
    /// A tenth of a picometre: where rounding of the readings begins to show in the worst-seen pattern of the paper's
    /// largest array (singular value 1e-5 per mm).
    fn default() -> Self {
        Self {
            steps: 50,
            tolerance_mm: 1e-10,
        }
    }
}

/// Why Newton's method ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewtonStop {
    /// The last step was shorter than the tolerance.
    Converged,
    /// All steps were taken.
    StepsTaken,
    /// No damping gives a step that lowers the misfit.
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

/// How a row was solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Why it ended.
    pub stop: NewtonStop,
    /// Steps taken.
    pub steps: usize,
    /// rms over readings of the relative misfit m/R − 1.
    pub residual: f64,
}

/// Readings or sizes that cannot be solved.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NewtonError {
    /// A reading is not a resistance.
    #[error("reading {column} is {value} ohm: give finite numbers above 0")]
    Reading {
        /// Column-wire, from 0.
        column: usize,
        /// The reading.
        value: f64,
    },
}

impl NewtonError {
    /// Refuses readings that are not above 0 and finite.
    pub(super) fn check(readings_ohm: &[f64]) -> Result<(), Self> {
        let bad = |&(_, value): &(usize, &f64)| !(*value > 0.0 && value.is_finite());
        match readings_ohm.iter().enumerate().find(bad) {
            Some((column, &value)) => Err(Self::Reading { column, value }),
            None => Ok(()),
        }
    }
}

/// Gauss-Newton with Levenberg's damping and bounds on Eq. (2) for one known row-wire. Unknown is only what the scene
/// moves.
///
/// Plain steps first; where they fail, each step solves `min ‖J δ + ρ‖² + μ ‖δ‖²` by QR over the unknowns that are not held at a bound, and is cut off at
/// the bounds. μ is 0 until a step fails to lower the misfit; then it grows tenfold, and shrinks again after steps that do.
#[derive(Clone, Debug)]
pub struct Newton {
    problem: RowProblem,
    ranges: Vec<Range>,
    /// Where iterates may wander.
    wide: Vec<Range>,
    rules: NewtonRules,
}

/// Damping relative to the largest diagonal entry of JᵀJ at which a failed step begins again.
const FIRST_DAMPING: f64 = 1e-12;
/// Plain steps tried before damped ones.
const MOST_PLAIN_STEPS: usize = 25;
/// A plain step that would have to be shortened further leads out of the sensor.
const SHORTEST_SHARE: f64 = 1e-3;
/// Damping beyond which steps only get shorter.
const LARGEST_DAMPING: f64 = 1e6;

impl Newton {
    /// Solves rows of `model` in `scene`.
    pub fn new(model: &SensorModel, scene: &Scene, rules: NewtonRules) -> Self {
        Self {
            problem: RowProblem::new(model, scene.movement.axes()),
            wide: wide_ranges(model, scene),
            ranges: ranges(model, scene),
            rules,
        }
    }

    /// Changes when to end.
    pub(super) fn set_rules(&mut self, rules: NewtonRules) {
        self.rules = rules;
    }

    /// Unknowns of a row.
    pub fn unknowns(&self) -> usize {
        self.problem.unknowns()
    }

    /// Solves row-wire `row` from its readings in ohm (M4), starting from the undeformed row; writes absolute
    /// coordinates (3·M2).
    ///
    /// # Errors
    /// Readings that are no resistances.
    pub fn solve(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<NewtonReport, NewtonError> {
        self.read(row, readings_ohm)?;
        let start = vec![0.0; self.problem.unknowns()];
        Ok(self.run(&start, coordinates_mm))
    }

    /// As [`Self::solve`], starting from the answer of another decoder in `coordinates_mm`, which is replaced.
    ///
    /// # Errors
    /// Readings that are no resistances.
    pub fn polish(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<NewtonReport, NewtonError> {
        self.read(row, readings_ohm)?;
        let mut start = vec![0.0; self.problem.unknowns()];
        self.problem.unknowns_of(coordinates_mm, &mut start);
        Ok(self.run(&start, coordinates_mm))
    }

    fn read(&mut self, row: usize, readings_ohm: &[f64]) -> Result<(), NewtonError> {
        NewtonError::check(readings_ohm)?;
        self.problem.read(row, readings_ohm);
        Ok(())
    }

    /// Plain Gauss-Newton first: it converges from anywhere nearby, though its misfit may rise on the way. If it ends
    /// out of bounds or nowhere, as with noise, damped steps within the bounds follow.
    fn run(&mut self, start: &[f64], coordinates_mm: &mut [f64]) -> NewtonReport {
        let mut unknowns = start.to_vec();
        self.clamp(&mut unknowns);
        let first = unknowns.clone();
        let before = self.problem.evaluate(&first);
        let (stop, steps) = self.wander(&mut unknowns);
        let outside = |(value, range): (&f64, &Range)| (value - range.clamp(*value)).abs() > self.rules.tolerance_mm;
        let is_out = unknowns.iter().zip(&self.ranges).any(outside);
        self.clamp(&mut unknowns);
        let mut report = NewtonReport {
            stop,
            steps,
            residual: self.problem.evaluate(&unknowns),
        };
        if report.residual > before || report.residual.is_nan() {
            unknowns = first;
            report.residual = before;
            report.stop = NewtonStop::StepsTaken;
        }
        if steps < self.rules.steps && (is_out || report.stop != NewtonStop::Converged) {
            report = self.descend(&mut unknowns, self.rules.steps - steps);
            report.steps += steps;
        }
        self.problem.coordinates_of(&unknowns, coordinates_mm);
        report
    }

    fn clamp(&self, unknowns: &mut [f64]) {
        for (value, range) in unknowns.iter_mut().zip(&self.ranges) {
            *value = range.clamp(*value);
        }
    }

    /// Plain steps, each shortened to end where the model still means something.
    fn wander(&mut self, unknowns: &mut [f64]) -> (NewtonStop, usize) {
        let most = self.rules.steps.min(MOST_PLAIN_STEPS);
        for steps in 1..=most {
            let system = Linearised::new(&mut self.problem, &self.wide, unknowns, false);
            let step = damped_step(&system.jacobian, &system.right, 0.0);
            let mut share = 1.0_f64;
            let mut length = 0.0_f64;
            for ((&step, &value), range) in step.iter().zip(&*unknowns).zip(&self.wide) {
                let room = if step > 0.0 {
                    range.highest - value
                } else {
                    range.lowest - value
                };
                if step != 0.0 {
                    share = share.min(room / step);
                }
                length = length.max(step.abs());
            }
            // Written so that NaN ends it too.
            if !(share >= SHORTEST_SHARE && length.is_finite()) {
                return (NewtonStop::NoStepHelps, steps - 1);
            }
            unknowns
                .iter_mut()
                .zip(&step)
                .for_each(|(value, step)| *value += share * step);
            if length <= self.rules.tolerance_mm {
                return (NewtonStop::Converged, steps);
            }
        }
        (NewtonStop::StepsTaken, most)
    }

    /// Damped steps within the bounds, each of which lowers the misfit.
    fn descend(&mut self, unknowns: &mut Vec<f64>, most_steps: usize) -> NewtonReport {
        let mut residual = self.problem.evaluate(unknowns);
        let mut damping = 0.0;
        let mut steps = 0;
        let stop = loop {
            if steps == most_steps {
                break NewtonStop::StepsTaken;
            }
            steps += 1;
            let ranges = &self.ranges;
            let Linearised {
                free,
                jacobian,
                right,
                scale,
            } = Linearised::new(&mut self.problem, ranges, unknowns, true);
            if free.is_empty() {
                break NewtonStop::Converged;
            }
            let (next, length, next_residual) = loop {
                let step = damped_step(&jacobian, &right, damping * scale);
                let mut next = unknowns.clone();
                let mut length = 0.0_f64;
                for (&unknown, &step) in free.iter().zip(&step) {
                    next[unknown] = ranges[unknown].clamp(unknowns[unknown] + step);
                    length = length.max((next[unknown] - unknowns[unknown]).abs());
                }
                let sound = step.iter().all(|step| step.is_finite());
                let next_residual = if sound {
                    self.problem.evaluate(&next)
                } else {
                    f64::INFINITY
                };
                // A step this short is within rounding, where the misfit falls no further.
                let short = sound && length <= self.rules.tolerance_mm;
                if next_residual < residual || short || damping > LARGEST_DAMPING {
                    break (next, length, next_residual);
                }
                damping = (10.0 * damping).max(FIRST_DAMPING);
            };
            if damping > LARGEST_DAMPING {
                break NewtonStop::NoStepHelps;
            }
            *unknowns = next;
            residual = next_residual;
            damping = if damping > 10.0 * FIRST_DAMPING {
                0.1 * damping
            } else {
                0.0
            };
            if length <= self.rules.tolerance_mm {
                break NewtonStop::Converged;
            }
        };
        NewtonReport { stop, steps, residual }
    }
}

/// Equations for a step.
struct Linearised {
    /// Unknowns that may move: all, or those not held at a bound.
    free: Vec<usize>,
    /// Readings × free unknowns, 1/mm.
    jacobian: Mat<f64>,
    /// −ρ.
    right: Vec<f64>,
    /// Largest diagonal entry of JᵀJ.
    scale: f64,
}

impl Linearised {
    fn new(problem: &mut RowProblem, ranges: &[Range], unknowns: &[f64], hold: bool) -> Self {
        problem.evaluate(unknowns);
        let (problem, equations) = (&*problem, problem.equations());
        let residuals = problem.residuals();
        let is_free = |&unknown: &usize| {
            let Range { lowest, highest } = ranges[unknown];
            let slope: f64 = (0..equations)
                .map(|k| problem.derivative(k, unknown) * residuals[k])
                .sum();
            !(unknowns[unknown] <= lowest && slope >= 0.0 || unknowns[unknown] >= highest && slope <= 0.0)
        };
        let free: Vec<usize> = (0..unknowns.len())
            .filter(|unknown| !hold || is_free(unknown))
            .collect();
        let jacobian = Mat::from_fn(equations, free.len(), |k, column| problem.derivative(k, free[column]));
        let scale = jacobian
            .col_iter()
            .map(|column| column.squared_norm_l2())
            .fold(0.0, f64::max);
        Self {
            right: residuals.iter().map(|residual| -residual).collect(),
            free,
            jacobian,
            scale,
        }
    }
}

/// `min ‖J δ − right‖² + damping ‖δ‖²` by QR of J with √damping · I below it.
fn damped_step(jacobian: &Mat<f64>, right: &[f64], damping: f64) -> Vec<f64> {
    let (equations, unknowns) = (jacobian.nrows(), jacobian.ncols());
    let below = if damping > 0.0 || equations < unknowns {
        unknowns
    } else {
        0
    };
    let root = damping.sqrt();
    let stacked = Mat::from_fn(equations + below, unknowns, |k, u| {
        if k < equations {
            jacobian[(k, u)]
        } else if k - equations == u {
            root
        } else {
            0.0
        }
    });
    let right = Mat::from_fn(equations + below, 1, |k, _| if k < equations { right[k] } else { 0.0 });
    let solution = stacked.qr().solve_lstsq(&right);
    (0..unknowns).map(|u| solution[(u, 0)]).collect()
}

/// How well an answer explains the readings of a row: rms over readings of m/R − 1, with R the model's resistances at
/// the decoded coordinates. It needs no ground truth, so it tells how far to trust any decoder; 1 and above is no
/// explanation at all. Infinite if the model has no resistance there.
///
/// # Panics
/// If there are not M4 readings and 3·M2 coordinates.
pub fn resistance_residual(model: &SensorModel, readings_ohm: &[f64], coordinates_mm: &[f64]) -> f64 {
    assert_eq!(coordinates_mm.len(), model.scale.coordinates_per_row());
    let mut problem = RowProblem::new(model, Axes::Xyz);
    // Displacements are taken from the first row, wherever the nodes are.
    problem.read(0, readings_ohm);
    let mut unknowns = vec![0.0; problem.unknowns()];
    problem.unknowns_of(coordinates_mm, &mut unknowns);
    let residual = problem.evaluate(&unknowns);
    if residual.is_finite() { residual } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        scene::Movement,
        sensor::ArrayScale,
    };

    fn worst(scene: &Scene, model: &SensorModel, rules: NewtonRules, snapshots: usize) -> (f64, usize) {
        let rows = model.scale.rows();
        let set = Dataset::simulate(model, scene, snapshots * rows, &mut Seed(5).rng(Stream::Test)).unwrap();
        let mut newton = Newton::new(model, scene, rules);
        let mut worst_mm = 0.0_f64;
        let mut most_steps = 0;
        for sample in 0..set.samples() {
            let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
            let readings = set.resistances_ohm.row(sample).to_vec();
            let report = newton.solve(sample % rows, &readings, &mut coordinates).unwrap();
            assert_eq!(report.stop, NewtonStop::Converged, "{report:?}");
            assert!(report.residual < 1e-13);
            most_steps = most_steps.max(report.steps);
            for (ours, truth) in coordinates.iter().zip(set.coordinates_mm.row(sample)) {
                worst_mm = worst_mm.max((ours - truth).abs());
            }
        }
        (worst_mm, most_steps)
    }

    #[test]
    fn random_deformations_come_back_on_all_presets() {
        for scale in ArrayScale::PRESETS {
            let model = SensorModel::new(scale);
            let (worst_mm, steps) = worst(&Scene::default(), &model, NewtonRules::default(), 20);
            assert!(worst_mm < 1e-9, "{scale}: {worst_mm:e} mm");
            assert!(steps <= 12, "{scale}: {steps}");
        }
    }

    #[test]
    fn sideways_shifts_of_a_small_array_come_back() {
        let model = SensorModel::new("2x1_3x9".parse().unwrap());
        let scene = Scene {
            movement: Movement::SIDEWAYS,
            ..Scene::default()
        };
        let (worst_mm, _) = worst(&scene, &model, NewtonRules::default(), 10);
        assert!(worst_mm < 1e-6, "{worst_mm:e} mm");
    }

    #[test]
    fn impossible_readings_are_refused_and_foreign_ones_end_within_the_bounds() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let mut newton = Newton::new(&model, &Scene::default(), NewtonRules::default());
        let mut coordinates = vec![0.0; 18];
        let mut readings = vec![20.0; 18];
        readings[3] = f64::NAN;
        let error = newton.solve(0, &readings, &mut coordinates).unwrap_err();
        assert!(error.to_string().contains("reading 3"), "{error}");
        for ohm in [1e-300, 1e-3, 1e6, 1e300] {
            let report = newton.solve(0, &[ohm; 18], &mut coordinates).unwrap();
            assert!(!report.residual.is_nan());
            for z in coordinates.iter().skip(2).step_by(3) {
                assert!((4.0..=5.0).contains(z), "{ohm}: {z}");
            }
        }
    }

    #[test]
    fn the_residual_is_the_relative_error_of_the_readings() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 10, &mut Seed(0).rng(Stream::Test)).unwrap();
        let coordinates = set.coordinates_mm.row(7).to_vec();
        let readings: Vec<f64> = set.resistances_ohm.row(7).iter().map(|ohm| ohm * 1.03).collect();
        assert!((resistance_residual(&model, &readings, &coordinates) - 0.03).abs() < 1e-12);
        assert_eq!(resistance_residual(&model, &readings, &[f64::NAN; 18]), f64::INFINITY);
    }
}
