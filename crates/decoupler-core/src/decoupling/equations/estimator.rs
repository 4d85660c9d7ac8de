use std::ops::Range as Columns;

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::{
    Estimate, LARGEST_ERROR, Misfits, ROUNDING, Solution,
    bounded::BoundedLeastSquares,
    lanes::Lanes,
    priors::Priors,
    reading_noise::ReadingNoise,
    row_problem::{Range, RowProblem, ranges, wide_ranges},
    side_by_side::LANES,
    symmetry::Symmetry,
};
use crate::{
    decoupling::DecodeError,
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Estimates the deformation of a row-wire from its readings, by Eq. (2), the noise of the readings, and the mean and
/// covariance of the scene's deformations.
///
/// With noise, the estimate is the most probable deformation within the ranges of the unknowns (maximum a posteriori)
/// under a Gaussian prior with that mean and covariance; the gain of the snapshot is one more unknown if the readings
/// drift. The equations are linearised repeatedly, and each linearised problem is solved with its bounds (Gauss-Newton
/// method). If that does not converge, damped steps follow, each of which raises the probability. If the answer does not
/// explain the readings, the method restarts elsewhere.
///
/// Without noise the same steps need no prior, and several rows are solved side by side. Only if exact readings do not
/// determine the deformation to within [`LARGEST_ERROR`], the prior decides among the deformations that explain them to
/// their rounding.
#[derive(Clone, Debug)]
pub struct Estimator {
    /// Plain steps for exact readings.
    lanes: Option<Lanes>,
    problem: RowProblem,
    /// Column-wires whose readings do not count.
    left_out: Columns<usize>,
    ranges: Vec<Range>,
    /// Ranges that steps without damping and prior may not leave.
    wide: Vec<Range>,
    noise: ReadingNoise,
    priors: Priors,
    symmetry: Symmetry,
    /// True if the prior is among the equations.
    has_prior: bool,
    /// Current point: displacements in millimetres, then the drift in standard deviations, if there is any.
    at: Vec<f64>,
    best: Vec<f64>,
    /// Equations linearised at the current point, in units of the ranges: [A, b], row by row.
    system: Vec<f64>,
    /// Twice the negative logarithm of the probability where the equations were linearised, up to a constant.
    objective: f64,
    bounds: Vec<(f64, f64)>,
    bounded: BoundedLeastSquares,
}

/// Maximum number of steps from one start.
const STEPS: usize = 60;
/// Maximum number of starts: the method restarts if one leads to no answer that explains the readings.
const STARTS: usize = 6;
/// Number of steps without damping.
const UNDAMPED_STEPS: usize = 12;
/// Number of full steps; later ones without damping are halved, unless steps contract, to prevent cycles.
const FULL_STEPS: usize = 5;
/// Step, relative to the range of the unknown, below which the method has converged for exact readings: a tenth of a
/// picometre for a stroke of a millimetre, where rounding of the readings begins to show in the worst-determined pattern
/// of the paper's largest array (singular value 1e-5 per mm).
pub(super) const TOLERANCE: f64 = 1e-10;
/// As [`TOLERANCE`], for readings with noise.
const NOISY_TOLERANCE: f64 = 1e-5;
/// Step, relative to the range of the unknown, after which the misfit of exact readings is rounding at a solution.
const SHORT_STEP: f64 = 1e-6;
/// Damping of the first retry, relative to the largest diagonal entry of AᵀA, and the largest.
const DAMPINGS: [f64; 2] = [1e-12, 1e6];
/// Root mean square of the misfits, in standard deviations, that noise explains.
const MAX_NOISE_RATIO: f64 = 6.0;
/// Relative misfit (root mean square) of exact readings that is rounding, for an answer to which the prior contributes.
const EXPLAINED: f64 = 1e-10;
/// Smallest gain considered.
const SMALLEST_GAIN: f64 = 1e-6;

impl Estimator {
    /// Creates an estimator for `rows` of `model`, with the noise and the deformations of `scene`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let ranges = ranges(model, scene);
        let noise = ReadingNoise::new(scene.noise.in_test().source(model)?);
        let unknowns = ranges.len() + usize::from(noise.drift() > 0.0);
        let lanes = noise.is_none().then(|| Lanes::new(model, scene, rows)).flatten();
        let refined = RowProblem::refined(model, scene).filter(|_| !noise.is_none());
        Ok(Self {
            lanes,
            problem: refined.unwrap_or_else(|| RowProblem::new(model, scene.movement.axes())),
            left_out: 0..0,
            ranges,
            wide: wide_ranges(model, scene),
            noise,
            priors: Priors::new(model, scene, rows),
            symmetry: Symmetry::new(model, scene, rows),
            has_prior: true,
            at: vec![0.0; unknowns],
            best: vec![0.0; unknowns],
            system: Vec::new(),
            objective: 0.0,
            bounds: Vec::with_capacity(unknowns),
            bounded: BoundedLeastSquares::default(),
        })
    }

    /// True if readings are exact apart from their rounding.
    pub(in crate::decoupling) fn is_exact(&self) -> bool {
        self.noise.is_none()
    }

    /// Estimates the deformation of row-wire `row` from its readings in ohm (M4); writes absolute coordinates (3·M2).
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
    ) -> Result<Estimate, DecodeError> {
        DecodeError::check(readings_ohm, readings_ohm.len())?;
        let mut estimate = None;
        self.solve_rows(&[row], readings_ohm, coordinates_mm, None, |found| {
            estimate = Some(found);
        });
        Ok(estimate.expect("one estimate for each row"))
    }

    /// As [`Self::solve`], without the readings of these column-wires, which must be resistances but have no influence. If
    /// no others remain, the estimate is the mean of the scene's deformations.
    ///
    /// # Errors
    /// If a reading is not a resistance.
    ///
    /// # Panics
    /// If `row` is not one of the given rows.
    pub fn solve_without(
        &mut self,
        left_out: Columns<usize>,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<Estimate, DecodeError> {
        self.left_out = left_out;
        let estimate = self.solve(row, readings_ohm, coordinates_mm);
        self.left_out = 0..0;
        estimate
    }

    /// Estimates rows from their valid readings (rows × M4), as [`Self::solve`] or, with `steps`, in at most that many from
    /// the answers of another decoder in `coordinates_mm` (rows × 3·M2), which are replaced; calls `take` with the estimate of
    /// each. Exact readings are polished without the prior.
    pub(in crate::decoupling) fn solve_rows(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: Option<usize>,
        mut take: impl FnMut(Estimate),
    ) {
        let (readings, coordinates) = (self.problem.equations(), self.problem.coordinates());
        let blocks = rows
            .chunks(LANES)
            .zip(readings_ohm.chunks(LANES * readings))
            .zip(coordinates_mm.chunks_mut(LANES * coordinates));
        for ((rows, readings_ohm), coordinates_mm) in blocks {
            let quick = self.in_lanes(rows, readings_ohm, coordinates_mm, steps);
            let rows = rows.iter().zip(readings_ohm.chunks_exact(readings));
            let rows = rows.zip(coordinates_mm.chunks_exact_mut(coordinates)).zip(quick);
            for (((&row, readings_ohm), coordinates_mm), quick) in rows {
                take(quick.unwrap_or_else(|| match steps {
                    None => self.search(row, readings_ohm, coordinates_mm),
                    Some(steps) => self.refine(row, readings_ohm, coordinates_mm, steps),
                }));
            }
        }
    }

    /// Number of readings that count.
    fn readings(&self) -> usize {
        self.problem.equations() - self.left_out.len()
    }

    fn is_redundant(&self) -> bool {
        self.problem.is_redundant(self.readings())
    }

    /// Estimates a row from its valid readings as if they were those of row-wire `row`, from one start.
    pub(in crate::decoupling) fn try_row(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Estimate {
        self.problem.read(row, readings_ohm);
        self.has_prior = !(self.is_exact() && self.is_redundant());
        self.start_from(coordinates_mm, 1)
    }

    /// Estimates rows from their valid readings (rows × M4) as if they were those of row-wires `rows`, where plain steps solve
    /// them; `steps` is as for [`Self::solve_rows`].
    pub(in crate::decoupling) fn in_lanes(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: Option<usize>,
    ) -> [Option<Estimate>; LANES] {
        match &mut self.lanes {
            Some(lanes) if self.left_out.is_empty() => lanes.solve(rows, readings_ohm, coordinates_mm, steps),
            _ => [None; LANES],
        }
    }

    /// Estimates a row from its valid readings with bounds, damping and restarts.
    pub(in crate::decoupling) fn search(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Estimate {
        self.problem.read(row, readings_ohm);
        if self.is_exact() && self.is_redundant() {
            self.has_prior = false;
            let found = self.start_from(coordinates_mm, STARTS);
            if !found.is_open() {
                return found;
            }
        }
        self.has_prior = true;
        self.start_from(coordinates_mm, STARTS)
    }

    /// Improves an answer, with the prior if there is noise.
    fn refine(&mut self, row: usize, readings_ohm: &[f64], coordinates_mm: &mut [f64], steps: usize) -> Estimate {
        self.problem.read(row, readings_ohm);
        self.has_prior = !self.is_exact();
        let n = self.ranges.len();
        self.problem.unknowns_of(coordinates_mm, &mut self.at[..n]);
        let (estimate, _) = self.estimate(steps);
        self.problem.coordinates_of(&self.at[..n], coordinates_mm);
        estimate
    }

    /// Estimates the row that was read from at most `starts` starts: the mean of the prior or the middle of the ranges, the
    /// undeformed state, the full stroke, then random ones, the same for every row.
    fn start_from(&mut self, coordinates_mm: &mut [f64], starts: usize) -> Estimate {
        let n = self.ranges.len();
        let mut best: Option<(Estimate, f64)> = None;
        let mut steps = 0;
        // Seeded only when needed, which is rare.
        let mut rng = None;
        for start in 0..starts {
            for (unknown, (at, range)) in self.at.iter_mut().zip(&self.ranges).enumerate() {
                *at = match start {
                    0 if self.has_prior => self.priors.of(self.problem.row()).mean[unknown] * range.width(),
                    0 => range.middle(),
                    1 => 0.0,
                    2 => range.highest,
                    _ => {
                        let rng = rng.get_or_insert_with(|| ChaCha8Rng::seed_from_u64(0));
                        range.lowest + range.width() * rng.random_range(0.0..=1.0)
                    }
                };
            }
            let (found, objective) = self.estimate(STEPS);
            steps += found.steps;
            let is_explained = found.solution != Solution::None;
            // Written so that NaN is replaced.
            if is_explained || !best.is_some_and(|(_, lowest)| lowest <= objective) {
                best = Some((found, objective));
                self.problem.coordinates_of(&self.at[..n], coordinates_mm);
            }
            if is_explained {
                break;
            }
        }
        let (best, _) = best.expect("there is at least one start");
        Estimate { steps, ..best }
    }

    /// Maximises the probability of the row that was read from the displacements in [`Self::at`]; also returns twice its
    /// negative logarithm.
    fn estimate(&mut self, max_steps: usize) -> (Estimate, f64) {
        let n = self.ranges.len();
        self.at[n..].fill(0.0);
        self.clamp();
        let (has_converged, steps) = self.climb(max_steps);
        self.problem.evaluate_residuals(&self.at[..n]);
        let objective = self.objective;
        let (deviation, log_determinant) = self.bounded.spread(n);
        let mut misfits = Misfits::default();
        let mut standardised = 0.0;
        for (reading, &misfit) in self.problem.residuals().iter().enumerate() {
            if self.left_out.contains(&reading) {
                continue;
            }
            let misfit = self.without_gain(misfit);
            // Only exact readings are compared with their rounding.
            let slopes = self.ranges.iter().enumerate().filter(|_| self.is_exact());
            let slopes = slopes.map(|(unknown, range)| self.problem.derivative(reading, unknown) * range.width());
            misfits.add(misfit, slopes);
            let expansion = self.noise.expand(self.problem.reading_ohm(reading), misfit);
            standardised += expansion.standardised * expansion.standardised;
        }
        let readings = self.readings().max(1);
        let residual = misfits.residual(readings);
        let spread = if self.has_prior {
            deviation
        } else {
            deviation * misfits.norm() / ROUNDING
        };
        let is_explained = match (self.is_exact(), self.has_prior) {
            (false, _) => (standardised / readings as f64).sqrt() <= MAX_NOISE_RATIO,
            (true, true) => residual < EXPLAINED,
            (true, false) => misfits.are_explained(spread),
        };
        let is_only = || {
            let row = self.problem.row();
            !self.is_exact()
                || spread <= LARGEST_ERROR && self.is_redundant() && !self.symmetry.has_twin(row, &self.at[..n])
        };
        let surprise = if self.has_prior {
            objective + log_determinant - self.priors.of(self.problem.row()).log_precision()
        } else {
            f64::NAN
        };
        let estimate = Estimate {
            has_converged,
            steps,
            residual,
            drift: self.at.get(n).copied().unwrap_or(0.0),
            spread,
            solution: Solution::of(is_explained, is_only),
            surprise,
        };
        (estimate, objective)
    }

    /// Moves [`Self::at`] to the maximum of the probability; the last equations factored are those there, or before a last
    /// step within the tolerance. Steps without damping converge from anywhere nearby, though the misfit may rise on the
    /// way. Without prior they may also leave the ranges: damped steps alone would solve only half as many rows whose nodes
    /// move sideways.
    fn climb(&mut self, max_steps: usize) -> (bool, usize) {
        let tolerance = if self.is_exact() { TOLERANCE } else { NOISY_TOLERANCE };
        let mut lowest = self.linearise();
        self.best.copy_from_slice(&self.at);
        let mut taken = 0;
        let mut lengths = [f64::INFINITY; 2];
        while taken < max_steps.min(UNDAMPED_STEPS) {
            let contracts = lengths[1] <= 0.5 * lengths[0];
            let is_full = taken < FULL_STEPS || contracts || !self.has_prior;
            let length = self.step(0.0, if is_full { 1.0 } else { 0.5 }, !self.has_prior);
            lengths = [lengths[1], length];
            taken += 1;
            let is_last = length <= tolerance;
            if is_last && self.is_within(tolerance) {
                self.clamp();
                return (true, taken);
            }
            if is_last || length.is_infinite() {
                break;
            }
            let objective = self.linearise();
            if self.is_local_minimum(length, lowest) && self.is_within(0.0) {
                self.factor();
                return (true, taken);
            }
            if objective < lowest && self.is_within(0.0) {
                lowest = objective;
                self.best.copy_from_slice(&self.at);
            }
        }
        self.clamp();
        let mut objective = self.linearise();
        if objective < lowest {
            lowest = objective;
            self.best.copy_from_slice(&self.at);
        }
        let mut damping = 0.0;
        for step in taken + 1..=max_steps {
            if objective != lowest {
                self.at.copy_from_slice(&self.best);
                self.linearise();
            }
            let length = self.step(damping, 1.0, false);
            if length > tolerance {
                objective = self.linearise();
            }
            if length <= tolerance || self.is_local_minimum(length, lowest) {
                self.factor();
                return (true, step);
            }
            if objective < lowest {
                lowest = objective;
                self.best.copy_from_slice(&self.at);
                damping *= 0.1;
            } else if damping > DAMPINGS[1] {
                self.return_to_best();
                return (false, step);
            } else {
                damping = (10.0 * damping).max(DAMPINGS[0]);
            }
        }
        self.return_to_best();
        (false, max_steps)
    }

    /// True after a short step to the `lowest` misfit, if exact readings have no such misfit at a solution: the next steps
    /// get shorter slowly.
    fn is_local_minimum(&self, length: f64, lowest: f64) -> bool {
        let explained = (EXPLAINED / ROUNDING).powi(2) * self.problem.equations() as f64;
        let is_lowest = self.objective <= lowest * (1.0 + 1e-9);
        self.is_exact() && length <= SHORT_STEP && is_lowest && self.objective > explained
    }

    fn return_to_best(&mut self) {
        self.at.copy_from_slice(&self.best);
        self.linearise();
        self.factor();
    }

    fn factor(&mut self) {
        self.bounded.factor(&self.system, self.at.len() + 1, 0.0);
    }

    /// Returns `true` if all displacements are at most `tolerance` times their ranges outside of these.
    fn is_within(&self, tolerance: f64) -> bool {
        let mut values = self.at.iter().zip(&self.ranges);
        values.all(|(at, range)| (at - range.clamp(*at)).abs() <= tolerance * range.width())
    }

    fn clamp(&mut self) {
        let values = self.at.iter_mut().zip(&self.ranges);
        values.for_each(|(at, range)| *at = range.clamp(*at));
    }

    /// Goes a `share` of the way to the solution of the linearised equations within the ranges, or the wide ones; returns
    /// the largest step of an unknown for the whole way, relative to its range (to the drift's standard deviation for a
    /// gain), which is infinite if they have no finite solution.
    fn step(&mut self, damping: f64, share: f64, is_wide: bool) -> f64 {
        let (n, width) = (self.ranges.len(), self.at.len() + 1);
        let limits = if is_wide { &self.wide } else { &self.ranges };
        self.bounds.clear();
        for ((at, limits), range) in self.at.iter().zip(limits).zip(&self.ranges) {
            let bound = |limit: f64| (limit - at) / range.width();
            self.bounds.push((bound(limits.lowest), bound(limits.highest)));
        }
        let smallest_drift = (SMALLEST_GAIN - 1.0) / self.noise.drift();
        let of_drift = self.at[n..].iter().map(|eta| (smallest_drift - eta, f64::INFINITY));
        self.bounds.extend(of_drift);
        let root = if damping > 0.0 {
            let column = |column: usize| self.system[column..].iter().step_by(width);
            let squares = (0..width - 1).map(|place| column(place).map(|entry| entry * entry).sum());
            (damping * squares.fold(0.0, f64::max)).sqrt()
        } else {
            0.0
        };
        let solution = self.bounded.solve(&self.system, width, root, &self.bounds);
        if !solution.iter().all(|step| step.is_finite()) {
            return f64::INFINITY;
        }
        for (((at, step), limits), range) in self.at.iter_mut().zip(solution).zip(limits).zip(&self.ranges) {
            *at = limits.clamp(*at + share * step * range.width());
        }
        for (drift, step) in self.at[n..].iter_mut().zip(&solution[n..]) {
            *drift += share * step;
        }
        solution.iter().fold(0.0, |length: f64, step| length.max(step.abs()))
    }

    /// m/(γR) − 1 from the misfit m/R − 1.
    fn without_gain(&self, misfit: f64) -> f64 {
        match self.at.get(self.ranges.len()) {
            Some(eta) => {
                let drift = self.noise.drift() * eta;
                (misfit - drift) / (1.0 + drift)
            }
            None => misfit,
        }
    }

    /// Linearises the equations of noise and prior at [`Self::at`], for steps relative to the ranges. Returns twice the
    /// negative logarithm of the probability, up to a constant.
    fn linearise(&mut self) -> f64 {
        let n = self.ranges.len();
        let unknowns = self.at.len();
        self.problem.evaluate(&self.at[..n]);
        self.system.clear();
        let mut objective = 0.0;
        let gain = 1.0 + self.noise.drift() * self.at.get(n).copied().unwrap_or(0.0);
        for (reading, &misfit) in self.problem.residuals().iter().enumerate() {
            if self.left_out.contains(&reading) {
                continue;
            }
            let misfit = self.without_gain(misfit);
            let expansion = self.noise.expand(self.problem.reading_ohm(reading), misfit);
            objective += expansion.deviance;
            let root = expansion.curvature.sqrt();
            let scale = root / gain;
            let slopes = self.ranges.iter().enumerate();
            let slopes = slopes.map(|(unknown, range)| self.problem.derivative(reading, unknown) * range.width());
            self.system.extend(slopes.map(|slope| scale * slope));
            if unknowns > n {
                self.system.push(-scale * self.noise.drift() * (1.0 + misfit));
            }
            self.system.push(if root > 0.0 { -expansion.slope / root } else { 0.0 });
        }
        if let Some(eta) = self.at.get(n) {
            self.system.extend((0..n).map(|_| 0.0));
            self.system.extend([1.0, -eta]);
            objective += eta * eta;
        }
        if self.has_prior {
            let own = self.system.len();
            let prior = self.priors.of(self.problem.row());
            prior.append_to(&mut self.system, unknowns, &self.at[..n], &self.ranges);
            let apart = self.system[own..].chunks_exact(unknowns + 1);
            objective += apart.map(|row| row[unknowns] * row[unknowns]).sum::<f64>();
        }
        self.objective = objective;
        objective
    }
}
