use faer::Mat;

use super::{
    Posterior, PosteriorReport,
    linear_model::{LinearModel, RoundedReading},
    linearised::Point,
};
use crate::scene::normal::normal_cdf;

/// Precision of a uniform distribution over a range, in widths of the range.
const UNIFORM_PRECISION: f64 = 12.0;

impl Posterior {
    /// Returns −2 ln p(m | row) of the readings m (rows × M4) for each of `rows`, up to a constant that all row-wires share,
    /// by Laplace's approximation at the answers of [`Self::solve_rows`] (rows × 3·M2) and at their gains.
    ///
    /// The evidence integrates over the deformation and the gain of the snapshot, so a row-wire is neither preferred for
    /// a gain that is unlikely, nor for deformations that few of its own would resemble (MacKay 2003, section 28.1).
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
        // Rows of a Gaussian prior come last, and have the root of its precision on their diagonal.
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

/// ln det of a symmetric positive definite matrix, whose eigenvalues are no smaller than their rounding; NaN if they are not
/// found.
fn log_determinant(matrix: Mat<f64>) -> f64 {
    let Ok(values) = matrix.self_adjoint_eigenvalues(faer::Side::Lower) else {
        return f64::NAN;
    };
    let largest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    values.iter().map(|value| value.max(f64::EPSILON * largest).ln()).sum()
}

impl RoundedReading {
    /// ln of the probability that a standard normal value, added to what is expected at x = 0, is within the interval.
    fn log_probability(&self) -> f64 {
        let (low, high) = (self.range.lowest, self.range.highest);
        log_probability(low, high)
    }

    /// Reciprocal of the variance of the reading: of ε and of its place within the interval, which counts as uniform.
    fn weight(&self) -> f64 {
        let half_width = 0.5 * (self.range.highest - self.range.lowest);
        1.0 / (1.0 + half_width * half_width / 3.0)
    }
}

/// ln P(low < ε < high) of a standard normal ε.
pub(super) fn log_probability(low: f64, high: f64) -> f64 {
    /// Beyond this the tail is known by its asymptote, to a part in 1000.
    const FAR: f64 = 30.0;
    let log_density = |x: f64| -0.5 * x * x - 0.5 * std::f64::consts::TAU.ln();
    // The mirror image of an interval most of which is below 0: its tail does not cancel.
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

    /// Values of scipy.stats.norm.logcdf and logsf.
    #[test]
    fn probabilities_of_intervals_are_those_of_the_normal_distribution() {
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
