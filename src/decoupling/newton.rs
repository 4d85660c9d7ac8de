use super::{
    DecodeError,
    gauss_newton::Linearised,
    newton_report::{LARGEST_ERROR, NewtonReport, NewtonRules, NewtonStop, Solution},
    newton_starts::Starts,
    row_problem::{Range, RowProblem, ranges, wide_ranges},
    twins::Twins,
};
use crate::{scene::Scene, sensor::SensorModel};

/// Gauss-Newton method with Levenberg's damping and bounds for Eq. (2) of one known row-wire. The unknowns are only
/// what the scene moves.
///
/// Plain steps are tried first. If they fail, each step solves `min ‖J δ + ρ‖² + μ ‖δ‖²` by QR over the unknowns that
/// are not held at a bound, and is cut off at the bounds. μ is 0 until a step fails to lower the misfit; then it grows
/// tenfold, and shrinks again after steps that succeed.
///
/// The misfit has minima that are no solutions. An answer counts as the [solution](Solution) only if what is left of
/// the misfit, or the rounding of readings and model where that is more, cannot hide a distance of [`LARGEST_ERROR`];
/// else other starts are tried.
#[derive(Clone, Debug)]
pub struct Newton {
    problem: RowProblem,
    ranges: Vec<Range>,
    /// Ranges that plain steps may not leave.
    wide: Vec<Range>,
    rules: NewtonRules,
    linearised: Linearised,
    twins: Twins,
}

/// Damping of the first retry after a failed step, relative to the largest diagonal entry of JᵀJ.
const FIRST_DAMPING: f64 = 1e-12;
/// Largest number of plain steps before damped ones.
const MOST_PLAIN_STEPS: usize = 25;
/// Smallest fraction of a plain step; one that must be shortened further leads out of the sensor.
const SHORTEST_SHARE: f64 = 1e-3;
/// Relative damping beyond which steps only get shorter.
const LARGEST_DAMPING: f64 = 1e6;
/// Largest rounding of a residual: of the resistance that was read and of the one that the model computes (4 units in the
/// last place each), of the reading and of the residual itself.
const ROUNDING: f64 = 10.0 * f64::EPSILON;
/// Distance, in proportion to the range, within which minima found from different starts count as the same.
const SAME: f64 = 1e-3;
/// Number of starts that must lead to the same minimum for the readings to be given up.
const AGREEING_STARTS: usize = 6;

impl Newton {
    /// Creates a solver for rows of `model` in `scene`.
    pub fn new(model: &SensorModel, scene: &Scene, rules: NewtonRules) -> Self {
        let problem = RowProblem::new(model, scene.movement.axes());
        Self {
            linearised: Linearised::new(problem.unknowns()),
            problem,
            wide: wide_ranges(model, scene),
            ranges: ranges(model, scene),
            rules,
            twins: Twins::new(model, scene),
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

    /// Solves row-wire `row` for its readings in ohm (M4), and writes absolute coordinates (3·M2). Starts in the middle
    /// of the ranges, and elsewhere if that leads to no solution.
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
        let mut starts = Starts::default();
        let (mut best, mut answer) = self.run(row, starts.next_mm(&self.ranges));
        let mut agreeing = 1;
        let most_starts = if self.is_redundant() { self.rules.starts } else { 1 };
        for _ in 1..most_starts {
            // Readings that leave several answers do so from any start.
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
        Ok(best)
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
        self.read(row, readings_ohm)?;
        let mut start = vec![0.0; self.problem.unknowns()];
        self.problem.unknowns_of(coordinates_mm, &mut start);
        let (report, answer) = self.run(row, start);
        self.problem.coordinates_of(&answer, coordinates_mm);
        Ok(report)
    }

    fn read(&mut self, row: usize, readings_ohm: &[f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        self.problem.read(row, readings_ohm);
        Ok(())
    }

    /// Runs plain Gauss-Newton steps first, which converge from anywhere nearby, though the misfit may rise on the way.
    /// If they end out of bounds or do not converge, as with noise, damped steps within the bounds follow.
    fn run(&mut self, row: usize, start: Vec<f64>) -> (NewtonReport, Vec<f64>) {
        let mut unknowns = start;
        self.clamp(&mut unknowns);
        let first = unknowns.clone();
        let before = self.problem.evaluate(&first);
        let (mut stop, mut steps) = self.wander(&mut unknowns);
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

    /// Judges an answer: to first order, errors of the readings with the norm e hide a distance of e times the largest
    /// norm of a row of J⁺.
    fn judge(&mut self, row: usize, unknowns: &[f64]) -> (Solution, f64) {
        self.linearised
            .linearise(&mut self.problem, &self.ranges, unknowns, false);
        let mut is_explained = true;
        let (mut squares, mut excess) = (0.0, 0.0);
        for (k, residual) in self.problem.residuals().iter().enumerate() {
            // Unknowns are rounded too, which weighs where a node nearly touches.
            let rounding = ROUNDING + f64::EPSILON * self.linearised.reach(k);
            squares += rounding * rounding;
            excess += residual * residual;
            is_explained &= residual.abs() <= rounding;
        }
        let largest_error = self.linearised.largest_error(f64::max(squares, excess).sqrt());
        let solution = if largest_error <= LARGEST_ERROR {
            if self.is_redundant() && !self.twins.has(row, unknowns) {
                Solution::Unique
            } else {
                Solution::Undetermined
            }
        } else if is_explained {
            Solution::Undetermined
        } else {
            Solution::None
        };
        (solution, largest_error)
    }

    /// Returns `true` if there are more readings than unknowns. As many equations as unknowns often have several
    /// solutions, and nothing is left by which to tell them apart; one alone is monotonic in the compression.
    fn is_redundant(&self) -> bool {
        let (equations, unknowns) = (self.problem.equations(), self.problem.unknowns());
        equations > unknowns || unknowns == 1
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
    fn descend(&mut self, unknowns: &mut Vec<f64>, most_steps: usize) -> (NewtonStop, usize) {
        let mut residual = self.problem.evaluate(unknowns);
        let mut damping = 0.0;
        for steps in 1..=most_steps {
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
                let sound = linearised.step_mm.iter().all(|step| step.is_finite());
                let next_residual = if sound { problem.evaluate(&next) } else { f64::INFINITY };
                // A step this short is within rounding, where the misfit falls no further.
                let short = sound && length <= self.rules.tolerance;
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
        (NewtonStop::StepsTaken, most_steps)
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
            assert_eq!(report.solution, Solution::Unique, "{report:?}");
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
            assert_eq!(report.solution, Solution::None);
            for z in coordinates.iter().skip(2).step_by(3) {
                assert!((4.0..=5.0).contains(z), "{ohm}: {z}");
            }
        }
    }

    /// Numbers of rows that are right, wrong and flagged, and wrong without a flag; wrong is an unknown that is off by
    /// more than [`LARGEST_ERROR`] of its range.
    fn standings(scene: &Scene, model: &SensorModel, rows: usize) -> [usize; 3] {
        let set = Dataset::simulate(model, scene, rows, &mut Seed(7).rng(Stream::Test)).unwrap();
        let mut newton = Newton::new(model, scene, NewtonRules::default());
        let mut counts = [0; 3];
        for sample in 0..set.samples() {
            let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
            let row = set.row_wire(sample).unwrap();
            let report = newton
                .solve(row, set.sample_readings(sample), &mut coordinates)
                .unwrap();
            let pairs = coordinates.iter().zip(set.sample_targets(sample)).enumerate();
            let error = |(place, (ours, truth)): (usize, (&f64, &f64))| {
                let range_mm = match place % 3 {
                    2 => scene.stroke_mm(&model.geometry),
                    _ => 2.0 * scene.movement.largest_shift_mm(),
                };
                let error = (ours - truth).abs();
                if error == 0.0 { 0.0 } else { error / range_mm }
            };
            let is_right = pairs.map(error).fold(0.0, f64::max) <= LARGEST_ERROR;
            let is_unique = report.solution == Solution::Unique;
            counts[if is_right { 0 } else { 1 + usize::from(is_unique) }] += 1;
        }
        counts
    }

    #[test]
    fn hard_pressed_rows_are_solved_or_flagged() {
        let model = SensorModel::new("10x8_4x24".parse().unwrap());
        for largest_compression in [0.2, 0.5, 0.9] {
            let scene = Scene {
                largest_compression,
                ..Scene::default()
            };
            let [right, flagged, wrong] = standings(&scene, &model, 600);
            assert_eq!(wrong, 0, "{largest_compression}");
            assert!(flagged <= 6, "{largest_compression}: {flagged} flagged, {right} right");
        }
    }

    #[test]
    fn sensors_of_any_size_are_solved_alike() {
        for factor in [1e-6, 1e6] {
            let mut model = SensorModel::new("2x4_3x12".parse().unwrap());
            let lengths = &mut model.geometry;
            lengths.height_mm *= factor;
            lengths.row_x0_mm *= factor;
            lengths.row_pitch_mm *= factor;
            lengths.node_pitch_mm *= factor;
            lengths.column_pitch_mm *= factor;
            lengths.column_node_x0_mm *= factor;
            lengths.column_node_pitch_mm *= factor;
            assert_eq!(standings(&Scene::default(), &model, 100), [100, 0, 0], "{factor}");
        }
    }

    #[test]
    fn rows_that_readings_do_not_determine_are_flagged() {
        // Fewer readings than nodes.
        let few = SensorModel::new("10x6_3x4".parse().unwrap());
        assert_eq!(standings(&Scene::default(), &few, 50), [0, 50, 0]);
        // So flat that no reading sees the height; so high that all nodes look alike.
        for height_mm in [1e-6, 1e6] {
            let mut model = SensorModel::new("2x4_3x12".parse().unwrap());
            model.geometry.height_mm = height_mm;
            assert_eq!(standings(&Scene::default(), &model, 20)[2], 0, "{height_mm}");
        }
    }

    #[test]
    fn a_row_over_the_middle_of_the_electrodes_does_not_tell_left_from_right() {
        let scene = Scene {
            movement: Movement::SIDEWAYS,
            rows: crate::scene::Rows::One(6),
            ..Scene::default()
        };
        // Electrodes at x = 11.5 and 16.5, the row at x = 14.
        let mut model = SensorModel::new("10x1_2x9".parse().unwrap());
        model.geometry.column_node_x0_mm = 11.5;
        let [_, flagged, wrong] = standings(&scene, &model, 40);
        assert_eq!(wrong, 0);
        assert!(flagged > 0);
        let beside = Scene {
            rows: crate::scene::Rows::One(5),
            ..scene
        };
        assert_eq!(standings(&beside, &model, 40), [40, 0, 0]);
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
