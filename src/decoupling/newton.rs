use super::{
    DecodeError,
    gauss_newton::{Linearised, damped_step},
    newton_report::{NewtonReport, NewtonRules, NewtonStop},
    row_problem::{Range, RowProblem, ranges, wide_ranges},
};
use crate::{scene::Scene, sensor::SensorModel};

/// Gauss-Newton method with Levenberg's damping and bounds for Eq. (2) of one known row-wire. The unknowns are only
/// what the scene moves.
///
/// Plain steps are tried first. If they fail, each step solves `min ‖J δ + ρ‖² + μ ‖δ‖²` by QR over the unknowns that
/// are not held at a bound, and is cut off at the bounds. μ is 0 until a step fails to lower the misfit; then it grows
/// tenfold, and shrinks again after steps that succeed.
#[derive(Clone, Debug)]
pub struct Newton {
    problem: RowProblem,
    ranges: Vec<Range>,
    /// Ranges that plain steps may not leave.
    wide: Vec<Range>,
    rules: NewtonRules,
}

/// Damping of the first retry after a failed step, relative to the largest diagonal entry of JᵀJ.
const FIRST_DAMPING: f64 = 1e-12;
/// Largest number of plain steps before damped ones.
const MOST_PLAIN_STEPS: usize = 25;
/// Smallest fraction of a plain step; one that must be shortened further leads out of the sensor.
const SHORTEST_SHARE: f64 = 1e-3;
/// Relative damping beyond which steps only get shorter.
const LARGEST_DAMPING: f64 = 1e6;

impl Newton {
    /// Creates a solver for rows of `model` in `scene`.
    pub fn new(model: &SensorModel, scene: &Scene, rules: NewtonRules) -> Self {
        Self {
            problem: RowProblem::new(model, scene.movement.axes()),
            wide: wide_ranges(model, scene),
            ranges: ranges(model, scene),
            rules,
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

    /// Solves row-wire `row` for its readings in ohm (M4), starting from the undeformed row, and writes absolute
    /// coordinates (3·M2).
    ///
    /// # Errors
    /// If readings are not resistances.
    pub fn solve(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<NewtonReport, DecodeError> {
        self.read(row, readings_ohm)?;
        let start = vec![0.0; self.problem.unknowns()];
        Ok(self.run(&start, coordinates_mm))
    }

    /// Solves as [`Self::solve`], starting from the answer of another decoder in `coordinates_mm`, which is
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
        self.read(row, readings_ohm)?;
        let mut start = vec![0.0; self.problem.unknowns()];
        self.problem.unknowns_of(coordinates_mm, &mut start);
        Ok(self.run(&start, coordinates_mm))
    }

    fn read(&mut self, row: usize, readings_ohm: &[f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        self.problem.read(row, readings_ohm);
        Ok(())
    }

    /// Runs plain Gauss-Newton steps first, which converge from anywhere nearby, though the misfit may rise on the way.
    /// If they end out of bounds or do not converge, as with noise, damped steps within the bounds follow.
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

    /// Takes plain steps, each shortened to stay where the model is valid.
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
            // Written so that NaN also ends the iteration.
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

    /// Takes damped steps within the bounds, each of which lowers the misfit.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        decoupling::resistance_residual,
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
            let readings = set.sample_readings(sample);
            let report = newton
                .solve(set.row_wire(sample).unwrap(), readings, &mut coordinates)
                .unwrap();
            assert_eq!(report.stop, NewtonStop::Converged, "{report:?}");
            assert!(report.residual < 1e-13);
            most_steps = most_steps.max(report.steps);
            for (ours, truth) in coordinates.iter().zip(set.sample_targets(sample)) {
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
        assert!(error.to_string().contains("reading 4"), "{error}");
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
        let coordinates = set.sample_targets(7).to_vec();
        let readings: Vec<f64> = set.sample_readings(7).iter().map(|ohm| ohm * 1.03).collect();
        assert!((resistance_residual(&model, &readings, &coordinates) - 0.03).abs() < 1e-12);
        assert_eq!(resistance_residual(&model, &readings, &[f64::NAN; 18]), f64::INFINITY);
    }
}
