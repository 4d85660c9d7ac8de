use super::{
    Posterior, PosteriorReport, expectation_propagation,
    linearised::{Linearised, Point},
};
use crate::decoupling::LARGEST_ERROR;

/// Change of a mean, relative to the range, below which the linearisation has converged.
const TOLERANCE: f64 = 1e-5;
/// Change of a mean up to which the first linearisation is followed, which is far from the answer.
const FIRST_TOLERANCE: f64 = 1e-3;
/// Error of a linearisation, in standard deviations of the readings, up to which it needs no blur.
const TOLERATED_MISFIT: f64 = 1e4;
/// Error of a linearisation in proportion to the change of the readings, before it is known.
const CURVATURE: f64 = 0.1;

impl Posterior {
    /// Linearises anew at each mean, from `first` on; writes the medians.
    ///
    /// Where the error of a linearisation is large beside the noise, as far from the answer with little noise, the noise
    /// is blurred to about that error: the answer is approached from a posterior that can hold it.
    pub(super) fn iterate(
        &mut self,
        row: usize,
        readings_ohm: &[f64],
        first: Vec<f64>,
        most_steps: usize,
        coordinates_mm: &mut [f64],
    ) -> PosteriorReport {
        self.problem.read(row, readings_ohm);
        let (mut variance, mut determined) = (f64::NAN, false);
        let (mut converged, mut steps, mut rounds) = (false, 0, 0);
        let mut at = Point {
            drift: 0.0,
            displacements_mm: first,
        };
        let mut expected: Option<Vec<f64>> = None;
        let mut last: Option<Linearised> = None;
        while steps < most_steps {
            self.problem.evaluate(&at.displacements_mm);
            if steps == 0 && self.likelihood.has_drift() {
                at.drift = self.likelihood.likeliest_drift(&self.problem);
            }
            let misfits = self.likelihood.misfits(&self.problem, at.drift);
            let error = match &expected {
                None => CURVATURE * rms(misfits.iter().copied()),
                Some(expected) => rms(misfits.iter().zip(expected).map(|(found, expected)| found - expected)),
            };
            let blur = libm::hypot(1.0, (error - TOLERATED_MISFIT).max(0.0));
            let is_rough = steps == 0 && most_steps > 1;
            let tolerance = if is_rough {
                FIRST_TOLERANCE
            } else {
                expectation_propagation::TOLERANCE
            };
            steps += 1;
            let Some(found) = self.linearised(row, &at, blur, last.as_ref(), tolerance) else {
                converged = false;
                break;
            };
            let moved = at
                .displacements_mm
                .iter()
                .zip(&found.means.displacements_mm)
                .zip(&self.widths);
            let largest = moved
                .map(|((at, mean), width)| (mean - at).abs() / width)
                .fold(0.0, f64::max);
            rounds += found.marginals.rounds;
            let marginals = &found.marginals.of_unknowns;
            let squares = marginals
                .iter()
                .zip(&self.widths)
                .map(|(marginal, width)| marginal.variance * width * width);
            variance = squares.sum::<f64>() / self.widths.len() as f64;
            determined = marginals
                .iter()
                .all(|marginal| marginal.variance.sqrt() <= LARGEST_ERROR);
            converged = found.marginals.converged && blur == 1.0;
            let is_last = largest < TOLERANCE && blur == 1.0 && !is_rough;
            let found = last.insert(found);
            if is_last {
                break;
            }
            let share = share_of_step(steps);
            let between = |from: f64, to: f64| if share == 1.0 { to } else { from + share * (to - from) };
            for (at, mean) in at.displacements_mm.iter_mut().zip(&found.means.displacements_mm) {
                *at = between(*at, *mean);
            }
            at.drift = between(at.drift, found.means.drift);
            let misfits = misfits.iter().zip(&found.misfits);
            expected = Some(misfits.map(|(&from, &to)| between(from, to)).collect());
        }
        let answer = match &last {
            Some(last) => self.medians_mm(last),
            None => at.displacements_mm,
        };
        let residual = self.problem.evaluate(&answer);
        self.problem.coordinates_of(&answer, coordinates_mm);
        PosteriorReport {
            steps,
            rounds,
            residual,
            spread_mm: variance.sqrt(),
            determined,
            converged,
        }
    }
}

/// Share of step number `steps` that is taken: all of the first ones, which nearly always arrive, then less, lest means go
/// round in a circle.
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
