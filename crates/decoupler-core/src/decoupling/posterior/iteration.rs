use std::cmp::Reverse;

use faer::Mat;

use super::{
    Posterior, PosteriorReport,
    expectation_propagation::{Marginals, TOLERANCE},
    gaussian::{LinearModel, LinearisedPosterior, Point, RoundedReading},
    pack::LANES,
};
use crate::{decoupling::LARGEST_ERROR, numerics::normal_cdf};

/// Iteration of a row towards its answer: the equations are relinearised at each mean.
///
/// If the linearisation error is large compared with the noise, as happens far from the answer with little noise, the
/// noise is inflated to about that error, so that the posterior can contain the answer.
struct Approach {
    /// Index among the rows to be solved.
    index: usize,
    /// Row-wire.
    row: usize,
    at: Point,
    max_steps: usize,
    steps: usize,
    rounds: usize,
    /// Factor by which the noise is inflated in the linearisation at `at`.
    blur: f64,
    /// Misfits at `at`, and those predicted by the previous linearisation.
    misfits: Vec<f64>,
    expected: Option<Vec<f64>>,
    last: Option<LinearisedPosterior>,
    variance: f64,
    determined: bool,
    converged: bool,
}

/// Change of a mean, relative to the range, below which the linearisation has converged.
const LINEARISED_TOLERANCE: f64 = 1e-5;
/// Tolerance of the first linearisation, which is far from the answer.
const FIRST_TOLERANCE: f64 = 1e-3;
/// Linearisation error, in standard deviations of the readings, up to which the noise is not inflated.
const TOLERATED_MISFIT: f64 = 1e4;
/// Assumed linearisation error, relative to the change of the readings, before it is known.
const CURVATURE: f64 = 0.1;

impl Approach {
    /// Starts from `first`, with at most this many steps.
    fn new((index, row): (usize, usize), first: Vec<f64>, max_steps: usize) -> Self {
        Self {
            index,
            row,
            at: Point {
                drift: 0.0,
                displacements_mm: first,
            },
            max_steps,
            steps: 0,
            rounds: 0,
            blur: 1.0,
            misfits: Vec::new(),
            expected: None,
            last: None,
            variance: f64::NAN,
            determined: false,
            converged: false,
        }
    }

    /// True if the linearisation is far from the answer.
    fn is_rough(&self) -> bool {
        self.steps == 0 && self.max_steps > 1
    }

    /// Sets `model` to the linearisation at the point where the equations of the row were evaluated.
    fn linearise(&mut self, posterior: &Posterior, model: &mut LinearModel) {
        let Posterior {
            likelihood, problem, ..
        } = posterior;
        if self.steps == 0 && likelihood.has_drift() {
            self.at.drift = likelihood.likeliest_drift(problem);
        }
        self.misfits.clear();
        self.misfits.extend(likelihood.misfits(problem, self.at.drift));
        let error = match &self.expected {
            None => CURVATURE * rms(self.misfits.iter().copied()),
            Some(expected) => rms(self
                .misfits
                .iter()
                .zip(expected)
                .map(|(found, expected)| found - expected)),
        };
        self.blur = libm::hypot(1.0, (error - TOLERATED_MISFIT).max(0.0));
        posterior.linearise(model, self.row, (&self.at, self.blur), self.last.as_ref());
        model.tolerance = if self.is_rough() { FIRST_TOLERANCE } else { TOLERANCE };
    }

    /// Moves to the mean of the linearised `model`. Returns `true` if the row has converged or cannot improve
    /// further.
    fn follow(&mut self, posterior: &Posterior, model: &LinearModel, marginals: Option<Marginals>) -> bool {
        let is_rough = self.is_rough();
        self.steps += 1;
        let Some(marginals) = marginals else {
            self.converged = false;
            return true;
        };
        let widths = &posterior.widths;
        let found = posterior.linearised(model, &self.at, self.blur, marginals);
        let moved = self
            .at
            .displacements_mm
            .iter()
            .zip(&found.means.displacements_mm)
            .zip(widths);
        let largest = moved
            .map(|((at, mean), width)| (mean - at).abs() / width)
            .fold(0.0, f64::max);
        self.rounds += found.marginals.rounds;
        let marginals = &found.marginals.of_unknowns;
        let squares = marginals
            .iter()
            .zip(widths)
            .map(|(marginal, width)| marginal.variance * width * width);
        self.variance = squares.sum::<f64>() / widths.len() as f64;
        self.determined = marginals
            .iter()
            .all(|marginal| marginal.variance.sqrt() <= LARGEST_ERROR);
        self.converged = found.marginals.converged && self.blur == 1.0;
        let is_last = largest < LINEARISED_TOLERANCE && self.blur == 1.0 && !is_rough;
        let found = self.last.insert(found);
        if is_last {
            return true;
        }
        let share = share_of_step(self.steps);
        let between = |from: f64, to: f64| if share == 1.0 { to } else { from + share * (to - from) };
        for (at, mean) in self.at.displacements_mm.iter_mut().zip(&found.means.displacements_mm) {
            *at = between(*at, *mean);
        }
        self.at.drift = between(self.at.drift, found.means.drift);
        let misfits = self.misfits.iter().zip(&found.misfits);
        self.expected = Some(misfits.map(|(&from, &to)| between(from, to)).collect());
        self.steps == self.max_steps
    }
}

impl Posterior {
    /// Solves `rows` side by side, each from its start, which `begin` computes from its coordinates in
    /// `coordinates_mm` (rows × 3·M2), in at most this many steps; when one has finished, the next starts. Replaces
    /// the coordinates by the medians and returns the report on each row.
    pub(super) fn iterate(
        &mut self,
        (rows, max_steps): (&[usize], usize),
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        begin: impl Fn(&mut Self, usize, &[f64]) -> Vec<f64>,
    ) -> Vec<PosteriorReport> {
        let (channels, outputs) = (self.problem.equations(), self.problem.coordinates());
        let mut reports = vec![None; rows.len()];
        let mut order: Vec<usize> = (0..rows.len()).collect();
        order.sort_by_key(|&index| Reverse(self.rounds[self.place(rows[index])]));
        let mut waiting = order.into_iter().map(|index| (index, rows[index]));
        let mut lanes: [Option<Approach>; LANES] = [const { None }; LANES];
        let mut models: [Option<LinearModel>; LANES] = [const { None }; LANES];
        loop {
            for lane in lanes.iter_mut().filter(|lane| lane.is_none()) {
                *lane = waiting.next().map(|(index, row)| {
                    let first = begin(self, row, &coordinates_mm[index * outputs..][..outputs]);
                    Approach::new((index, row), first, max_steps)
                });
            }
            if lanes.iter().all(Option::is_none) {
                return reports.into_iter().flatten().collect();
            }
            for (lane, model) in lanes.iter_mut().zip(&mut models) {
                if let Some(approach) = lane.as_mut().filter(|approach| approach.steps < approach.max_steps) {
                    self.problem
                        .read(approach.row, &readings_ohm[approach.index * channels..][..channels]);
                    self.problem.evaluate(&approach.at.displacements_mm);
                    approach.linearise(self, model.get_or_insert_default());
                } else {
                    *model = None;
                }
            }
            let found = self.propagation.marginals(&models);
            for ((lane, model), marginals) in lanes.iter_mut().zip(&models).zip(found) {
                let follow = |approach: &mut Approach| {
                    let model = model.as_ref();
                    model.is_none_or(|model| approach.follow(self, model, marginals))
                };
                if let Some(approach) = lane.take_if(follow) {
                    let index = approach.index;
                    reports[index] = Some(self.answer(approach, readings_ohm, coordinates_mm));
                }
            }
        }
    }

    /// Writes the medians of a finished row and returns its report.
    fn answer(&mut self, approach: Approach, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> PosteriorReport {
        let answer = match &approach.last {
            Some(last) => self.medians_mm(last),
            None => approach.at.displacements_mm,
        };
        let (channels, outputs) = (self.problem.equations(), self.problem.coordinates());
        let place = self.place(approach.row);
        self.rounds[place] = approach.rounds;
        let readings_ohm = &readings_ohm[approach.index * channels..][..channels];
        self.problem.read(approach.row, readings_ohm);
        let drift = approach.last.map_or(0.0, |last| last.means.drift);
        self.problem.evaluate_residuals(&answer);
        let residual = rms(self.likelihood.relative_misfits(&self.problem, drift));
        let coordinates_mm = &mut coordinates_mm[approach.index * outputs..][..outputs];
        self.problem.coordinates_of(&answer, coordinates_mm);
        PosteriorReport {
            steps: approach.steps,
            rounds: approach.rounds,
            residual,
            drift,
            spread_mm: approach.variance.sqrt(),
            determined: approach.determined,
            converged: approach.converged,
        }
    }
}

/// Fraction of step number `steps` that is taken: full first steps, which nearly always converge, then shorter ones
/// to prevent cycles.
fn share_of_step(steps: usize) -> f64 {
    match steps {
        ..=5 => 1.0,
        6..=15 => 0.5,
        _ => 0.25,
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut count, mut squares) = (0, 0.0);
    for value in values {
        count += 1;
        squares += value * value;
    }
    (squares / f64::from(count)).sqrt()
}

/// Precision of the uniform distribution over a range, in units of the range's width.
const UNIFORM_PRECISION: f64 = 12.0;

impl Posterior {
    /// Returns −2 ln p(m | row) of the readings m (rows × M4) for each of `rows`, up to a constant common to all
    /// row-wires, by Laplace's approximation at the answers of [`Self::solve_rows`] (rows × 3·M2) and at their gains.
    ///
    /// The evidence integrates over the deformation and the gain of the snapshot, so a row-wire is preferred neither
    /// for an unlikely gain nor for deformations that are atypical of it (MacKay 2003, section 28.1).
    pub(in crate::decoupling) fn surprises(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &[f64],
        reports: &[PosteriorReport],
    ) -> Vec<f64> {
        let (channels, outputs) = (self.problem.equations(), self.problem.coordinates());
        let readings = readings_ohm.chunks_exact(channels);
        let answers = coordinates_mm.chunks_exact(outputs);
        let rows = rows.iter().zip(readings).zip(answers).zip(reports);
        rows.map(|(((&row, readings_ohm), coordinates_mm), report)| {
            let at = Point {
                displacements_mm: self.unknowns_of(row, coordinates_mm),
                drift: report.drift,
            };
            self.problem.read(row, readings_ohm);
            self.problem.evaluate(&at.displacements_mm);
            self.surprise(row, &at)
        })
        .collect()
    }

    /// [`Self::surprises`] of one row at the point where its equations were evaluated.
    fn surprise(&self, row: usize, at: &Point) -> f64 {
        let mut model = LinearModel::default();
        self.linearise(&mut model, row, (at, 1.0), None);
        let unknowns = model.linear.len();
        let rounded = model.rounded.iter().map(|reading| -2.0 * reading.log_probability());
        let equations = model.equations.chunks_exact(unknowns + 1);
        let squares = equations.clone().map(|row| row[unknowns] * row[unknowns]);
        // Rows of a Gaussian prior are last, with the root of its precision on their diagonal.
        let own = self.problem.equations() - model.rounded.len() + usize::from(self.likelihood.has_drift());
        let of_prior = equations.clone().skip(own).enumerate();
        let log_prior_root: f64 = of_prior.map(|(place, row)| row[place].abs().ln()).sum();
        let has_prior = equations.len() > own;
        let mut precision: Mat<f64> = Mat::zeros(unknowns, unknowns);
        let mut add = |form: &[f64], weight: f64| {
            for i in 0..unknowns {
                for j in 0..unknowns {
                    precision[(i, j)] += weight * form[i] * form[j];
                }
            }
        };
        equations.for_each(|row| add(&row[..unknowns], 1.0));
        model
            .rounded
            .iter()
            .for_each(|reading| add(&reading.form, reading.weight()));
        for (unknown, _) in self.widths.iter().enumerate().filter(|_| !has_prior) {
            precision[(unknown, unknown)] += UNIFORM_PRECISION;
        }
        squares.chain(rounded).sum::<f64>() + self.likelihood.log_normalisers(&self.problem, at.drift)
            - 2.0 * log_prior_root
            + log_determinant(precision)
    }
}

/// ln det of a symmetric positive definite matrix, with eigenvalues bounded below by their rounding; NaN if they are
/// not found.
fn log_determinant(matrix: Mat<f64>) -> f64 {
    let Ok(values) = matrix.self_adjoint_eigenvalues(faer::Side::Lower) else {
        return f64::NAN;
    };
    let largest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    values.iter().map(|value| value.max(f64::EPSILON * largest).ln()).sum()
}

impl RoundedReading {
    /// ln of the probability that a standard normal value, added to the reading expected at x = 0, is within the
    /// interval.
    fn log_probability(&self) -> f64 {
        let (low, high) = (self.range.lowest, self.range.highest);
        log_probability(low, high)
    }

    /// Reciprocal of the variance of the reading: of ε and of its position within the interval, assumed uniform.
    fn weight(&self) -> f64 {
        let half_width = 0.5 * (self.range.highest - self.range.lowest);
        1.0 / (1.0 + half_width * half_width / 3.0)
    }
}

/// ln P(low < ε < high) of a standard normal ε.
pub(super) fn log_probability(low: f64, high: f64) -> f64 {
    /// Beyond this value the asymptote of the tail is accurate to 1 in 1000.
    const FAR: f64 = 30.0;
    let log_density = |x: f64| -0.5 * x * x - 0.5 * std::f64::consts::TAU.ln();
    // Mirrors an interval that is mostly below 0, to avoid cancellation in its tail.
    let (low, high) = (low.max(-high), high.max(-low));
    let width = high - low;
    if width * low.abs().max(1.0) < 1e-4 {
        log_density(0.5 * (low + high)) + width.ln()
    } else if low < FAR {
        (normal_cdf(-low) - normal_cdf(-high)).ln()
    } else {
        log_density(low) - low.ln() + (-(-0.5 * width * (low + high)).exp_m1()).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from scipy.stats.norm.logcdf and logsf.
    #[test]
    fn interval_probabilities_match_the_normal_distribution() {
        for (low, high, expected) in [
            (-1.0, 1.0, -0.381_715_146_3),
            (0.0, f64::INFINITY, -std::f64::consts::LN_2),
            (2.0, f64::INFINITY, -3.783_184_333_7),
            (35.0, f64::INFINITY, -616.975_101_3),
            (1.0, 1.000_01, -12.931_869_0),
            (f64::NEG_INFINITY, -35.0, -616.975_101_3),
            (-1.000_01, -1.0, -12.931_869_0),
        ] {
            let found = log_probability(low, high);
            assert!(
                (found - expected).abs() < 2e-3 * f64::abs(expected),
                "{low} {high}: {found}"
            );
        }
    }
}
