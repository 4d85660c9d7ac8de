use super::{bounded::BoundedLeastSquares, priors::Priors, reading_noise::ReadingNoise};
use crate::{
    decoupling::{
        DecodeError, LARGEST_ERROR, Newton, NewtonReport, NewtonRules, NewtonStop, Range, Solution, newton::Starts,
        ranges, row_problem::RowProblem,
    },
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Estimates the deformation of a row-wire from its readings, by Eq. (2), the noise of the readings, and the mean and
/// covariance of the scene's deformations.
///
/// With noise, the estimate is the most probable deformation within the ranges of the unknowns (maximum a posteriori)
/// under a Gaussian prior with that mean and covariance; the gain of the snapshot is one more unknown if the readings
/// drift. The equations are linearised repeatedly, and each linearised problem is solved with its bounds. If that does
/// not converge, damped steps follow, each of which raises the probability. If the answer does not explain the readings,
/// the method restarts elsewhere.
///
/// Exact readings are solved by [`Newton`]. Only if they do not determine the deformation to within [`LARGEST_ERROR`],
/// the prior decides among the deformations that explain them to their rounding.
#[derive(Clone, Debug)]
pub struct Estimator {
    newton: Newton,
    problem: RowProblem,
    ranges: Vec<Range>,
    noise: ReadingNoise,
    priors: Priors,
    /// Current point: displacements in millimetres, then the drift in standard deviations, if there is any.
    at: Vec<f64>,
    best: Vec<f64>,
    /// Equations linearised at the current point, in units of the ranges: [A, b], row by row.
    system: Vec<f64>,
    bounds: Vec<(f64, f64)>,
    bounded: BoundedLeastSquares,
}

/// Result of estimating the deformation of a row-wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Reason for stopping.
    pub stop: NewtonStop,
    /// Number of steps.
    pub steps: usize,
    /// Root mean square over readings of the relative misfit m/(γR) − 1, with the gain γ of [`Self::drift`].
    pub residual: f64,
    /// Gain error of the snapshot, in standard deviations of the scene's drift; 0 without drift.
    pub drift: f64,
    /// Largest standard deviation of an unknown in the linearised posterior, relative to its range. For exact readings
    /// that determine the answer, the largest error caused by misfit and rounding.
    pub spread: f64,
    /// Status of the answer.
    pub solution: Solution,
    /// −2 ln p(readings | row), up to a constant that all row-wires share, by Laplace's approximation (MacKay 2003,
    /// section 28.1); NaN if the prior was not needed.
    pub surprise: f64,
}

/// Maximum number of steps.
const STEPS: usize = 60;
/// Number of starts: the method restarts if it leads to no answer that explains the readings.
const STARTS: usize = 6;
/// Number of steps without damping.
const UNDAMPED_STEPS: usize = 12;
/// Number of full steps; later ones without damping are halved to prevent cycles.
const FULL_STEPS: usize = 5;
/// Step, relative to the range of the unknown, below which the method has converged, with noise and without.
const TOLERANCES: [f64; 2] = [1e-6, 1e-10];
/// Damping of the first retry, relative to the largest diagonal entry of AᵀA, and the largest.
const DAMPINGS: [f64; 2] = [1e-12, 1e6];
/// Root mean square of the misfits, in standard deviations, that noise explains.
const MAX_NOISE_RATIO: f64 = 6.0;
/// Relative misfit (root mean square) of exact readings that is rounding.
pub(in crate::decoupling) const EXPLAINED: f64 = 1e-10;
/// Smallest gain considered.
const SMALLEST_GAIN: f64 = 1e-6;

impl From<NewtonReport> for Estimate {
    fn from(report: NewtonReport) -> Self {
        Self {
            stop: report.stop,
            steps: report.steps,
            residual: report.residual,
            drift: 0.0,
            spread: report.largest_error,
            solution: report.solution,
            surprise: f64::NAN,
        }
    }
}

impl Estimator {
    /// Creates an estimator for `rows` of `model`, with the noise and the deformations of `scene`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let ranges = ranges(model, scene);
        let noise = ReadingNoise::new(scene.noise.in_test().source(model)?);
        let unknowns = ranges.len() + usize::from(noise.drift() > 0.0);
        Ok(Self {
            newton: Newton::new(model, scene, NewtonRules::default()),
            problem: RowProblem::new(model, scene.movement.axes()),
            ranges,
            noise,
            priors: Priors::new(model, scene, rows),
            at: vec![0.0; unknowns],
            best: vec![0.0; unknowns],
            system: Vec::new(),
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
        DecodeError::check(readings_ohm)?;
        if self.is_exact() {
            let report = self.newton.solve(row, readings_ohm, coordinates_mm)?;
            if report.largest_error <= LARGEST_ERROR {
                return Ok(report.into());
            }
        }
        Ok(self.solve_with_prior(row, readings_ohm, coordinates_mm))
    }

    /// Estimates the deformation of row-wire `row` from its valid readings by the prior, also if they determine it.
    pub(in crate::decoupling) fn solve_with_prior(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Estimate {
        let prior = self.priors.of(row);
        let means = self.at.iter_mut().zip(&self.ranges).zip(&prior.mean);
        means.for_each(|((at, range), mean)| *at = range.clamp(mean * range.width()));
        let mut best = self.estimate(row, readings_ohm, coordinates_mm, STEPS);
        let mut starts = Starts::default();
        let mut others_mm = Vec::new();
        for _ in 1..STARTS {
            if best.solution != Solution::None {
                break;
            }
            let start = starts.next_mm(&self.ranges);
            self.at[..start.len()].copy_from_slice(&start);
            others_mm.resize(coordinates_mm.len(), 0.0);
            let other = self.estimate(row, readings_ohm, &mut others_mm, STEPS);
            if other.surprise < best.surprise || best.surprise.is_nan() {
                coordinates_mm.copy_from_slice(&others_mm);
                best = other;
            }
        }
        best
    }

    /// As [`Self::solve`], in at most `steps` steps from the answer of another decoder in `coordinates_mm`, which is
    /// replaced. Exact readings are polished without the prior.
    ///
    /// # Errors
    /// If a reading is not a resistance.
    ///
    /// # Panics
    /// If `row` is not one of the given rows.
    pub fn polish(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        steps: usize,
    ) -> Result<Estimate, DecodeError> {
        DecodeError::check(readings_ohm)?;
        if self.is_exact() {
            self.newton.set_rules(NewtonRules {
                steps,
                ..NewtonRules::default()
            });
            return Ok(self.newton.polish(row, readings_ohm, coordinates_mm)?.into());
        }
        self.problem.turn_to(row);
        let n = self.ranges.len();
        self.problem.unknowns_of(coordinates_mm, &mut self.at[..n]);
        let values = self.at.iter_mut().zip(&self.ranges);
        values.for_each(|(at, range)| *at = range.clamp(*at));
        Ok(self.estimate(row, readings_ohm, coordinates_mm, steps))
    }

    /// Maximises the posterior probability from the displacements in [`Self::at`].
    fn estimate(&mut self, row: usize, readings_ohm: &[f64], coordinates_mm: &mut [f64], max_steps: usize) -> Estimate {
        self.problem.read(row, readings_ohm);
        let n = self.ranges.len();
        self.at[n..].fill(0.0);
        let (stop, steps) = self.climb(row, max_steps);
        self.problem.coordinates_of(&self.at[..n], coordinates_mm);
        let objective = self.linearise(row);
        let width = self.at.len() + 1;
        self.bounded.factor(&self.system, width, 0.0);
        let (deviations, log_determinant) = self.bounded.spread();
        let spread = deviations[..n].iter().copied().fold(0.0, f64::max);
        let readings = readings_ohm.len() as f64;
        let (mut squares, mut standardised) = (0.0, 0.0);
        for (&reading_ohm, &misfit) in readings_ohm.iter().zip(self.problem.residuals()) {
            let misfit = self.without_gain(misfit);
            squares += misfit * misfit;
            standardised += self.noise.expand(reading_ohm, misfit).standardised.powi(2);
        }
        let residual = (squares / readings).sqrt();
        let is_explained = if self.noise.is_none() {
            residual < EXPLAINED
        } else {
            (standardised / readings).sqrt() <= MAX_NOISE_RATIO
        };
        let is_decided = !self.noise.is_none() || spread <= LARGEST_ERROR;
        Estimate {
            stop,
            steps,
            residual,
            drift: self.at.get(n).copied().unwrap_or(0.0),
            spread,
            solution: match (is_explained, is_decided) {
                (true, true) => Solution::Unique,
                (true, false) => Solution::Undetermined,
                (false, _) => Solution::None,
            },
            surprise: objective + log_determinant - self.priors.of(row).log_precision(),
        }
    }

    /// Moves [`Self::at`] to the maximum of the posterior.
    fn climb(&mut self, row: usize, max_steps: usize) -> (NewtonStop, usize) {
        let tolerance = TOLERANCES[usize::from(self.noise.is_none())];
        let mut objective = self.linearise(row);
        let mut lowest = objective;
        self.best.copy_from_slice(&self.at);
        for step in 1..=max_steps.min(UNDAMPED_STEPS) {
            let share = if step <= FULL_STEPS { 1.0 } else { 0.5 };
            let length = self.step(0.0, share);
            if length <= tolerance {
                return (NewtonStop::Converged, step);
            }
            objective = self.linearise(row);
            if objective < lowest {
                lowest = objective;
                self.best.copy_from_slice(&self.at);
            }
        }
        let mut damping = 0.0;
        for step in UNDAMPED_STEPS + 1..=max_steps {
            if objective != lowest {
                self.at.copy_from_slice(&self.best);
                self.linearise(row);
            }
            let length = self.step(damping, 1.0);
            if length <= tolerance {
                return (NewtonStop::Converged, step);
            }
            objective = self.linearise(row);
            if objective < lowest {
                lowest = objective;
                self.best.copy_from_slice(&self.at);
                damping *= 0.1;
            } else if damping > DAMPINGS[1] {
                self.at.copy_from_slice(&self.best);
                return (NewtonStop::NoStepHelps, step);
            } else {
                damping = (10.0 * damping).max(DAMPINGS[0]);
            }
        }
        self.at.copy_from_slice(&self.best);
        (NewtonStop::StepsTaken, max_steps)
    }

    /// Goes a `share` of the way to the solution of the linearised equations; returns the largest step of an unknown for
    /// the whole way, relative to its range (to the drift's standard deviation for a gain), which is infinite if they have no finite solution.
    fn step(&mut self, damping: f64, share: f64) -> f64 {
        let width = self.at.len() + 1;
        let root = if damping > 0.0 {
            let mut squares = vec![0.0; width];
            for row in self.system.chunks_exact(width) {
                squares
                    .iter_mut()
                    .zip(row)
                    .for_each(|(sum, entry)| *sum += entry * entry);
            }
            (damping * squares[..width - 1].iter().copied().fold(0.0, f64::max)).sqrt()
        } else {
            0.0
        };
        let solution = self.bounded.solve(&self.system, width, root, &self.bounds);
        if !solution.iter().all(|step| step.is_finite()) {
            return f64::INFINITY;
        }
        let n = self.ranges.len();
        for ((at, step), range) in self.at.iter_mut().zip(solution).zip(&self.ranges) {
            *at = range.clamp(*at + share * step * range.width());
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

    /// Linearises the equations of noise and prior at [`Self::at`], for steps relative to the ranges within
    /// [`Self::bounds`]. Returns twice the negative logarithm of the posterior, up to a constant.
    fn linearise(&mut self, row: usize) -> f64 {
        let n = self.ranges.len();
        let unknowns = self.at.len();
        self.problem.evaluate(&self.at[..n]);
        self.bounds.clear();
        self.system.clear();
        let mut objective = 0.0;
        for (at, range) in self.at.iter().zip(&self.ranges) {
            let width = range.width();
            self.bounds
                .push(((range.lowest - at) / width, (range.highest - at) / width));
        }
        let gain = 1.0 + self.noise.drift() * self.at.get(n).copied().unwrap_or(0.0);
        for (reading, &misfit) in self.problem.residuals().iter().enumerate() {
            let misfit = self.without_gain(misfit);
            let expansion = self.noise.expand(self.problem.reading_ohm(reading), misfit);
            objective += expansion.deviance;
            let root = expansion.curvature.sqrt();
            let scale = root / gain;
            self.system.extend(
                self.ranges
                    .iter()
                    .enumerate()
                    .map(|(unknown, range)| scale * self.problem.derivative(reading, unknown) * range.width()),
            );
            if unknowns > n {
                self.system.push(-scale * self.noise.drift() * (1.0 + misfit));
            }
            self.system.push(if root > 0.0 { -expansion.slope / root } else { 0.0 });
        }
        if let Some(eta) = self.at.get(n) {
            self.bounds
                .push(((SMALLEST_GAIN - 1.0) / self.noise.drift() - eta, f64::INFINITY));
            self.system.extend((0..n).map(|_| 0.0));
            self.system.extend([1.0, -eta]);
            objective += eta * eta;
        }
        let own = self.system.len();
        let prior = self.priors.of(row);
        prior.append_to(&mut self.system, unknowns, &self.at[..n], &self.ranges);
        let apart = self.system[own..].chunks_exact(unknowns + 1);
        objective + apart.map(|row| row[unknowns] * row[unknowns]).sum::<f64>()
    }
}
