use std::collections::BTreeMap;

use super::{CalibratedParameter, Calibration, equations::Problem};
use crate::sensor::SensorModel;

/// Warnings that the readings do not fit the sensor model, with what to check.
pub(super) fn warnings(problem: &Problem<'_>, model: &SensorModel, parameters: &[CalibratedParameter]) -> Vec<String> {
    let fitted = parameters.iter().filter(|fitted| fitted.half_width.is_some());
    let warnings = [
        far_from_nominal(problem, parameters),
        misfit(problem, model, fitted.count()),
    ];
    warnings.into_iter().flatten().collect()
}

/// Returns a warning if fitted values are far from their nominal values.
fn far_from_nominal(problem: &Problem<'_>, parameters: &[CalibratedParameter]) -> Option<String> {
    /// Standard deviations of the prior from which a value counts as far from its nominal value.
    const FAR: f64 = 3.0;
    let (mut far, mut largest) = (Vec::new(), 0.0_f64);
    for (fitted, reference) in parameters.iter().zip(&problem.references) {
        let deviation = 0.5 * Calibration::NOMINAL_TOLERANCE * reference;
        let apart = (fitted.value - fitted.nominal).abs();
        // The part of the difference beyond the interval.
        if let Some(half_width) = fitted.half_width
            && apart - half_width > FAR * deviation
        {
            largest = largest.max(apart / deviation);
            far.push(fitted.to_string());
        }
    }
    (!far.is_empty()).then(|| {
        format!(
            "{}: up to {largest:.0} standard deviations from nominal values that are assumed to be correct to ±10 % (two \
             standard deviations); check the array scale, the order of the wires and the unit of the displacements, or use \
             a nominal sensor that is closer",
            far.join("; ")
        )
    })
}

/// Returns a warning if the errors that all frames share are large compared with the noise, by an analysis of
/// variance of the residuals by crossing.
fn misfit(problem: &Problem<'_>, model: &SensorModel, fitted: usize) -> Option<String> {
    /// Ratio of systematic error to noise from which it is reported.
    const LARGE: f64 = 3.0;
    /// Minimum degrees of freedom of the noise estimate: readings minus crossings.
    const MIN_DEGREES: usize = 10;
    /// Relative errors explained by rounding.
    const SMALLEST: f64 = 1e-12;
    // Number, sum and sum of squares of the residuals of each crossing.
    let mut crossings: BTreeMap<(usize, usize), (f64, f64, f64)> = BTreeMap::new();
    problem.residuals(model, |sample, column, residual, _| {
        let (count, sum, squares) = crossings.entry((sample.row, column)).or_default();
        *count += 1.0;
        *sum += residual;
        *squares += residual * residual;
    });
    let readings: f64 = crossings.values().map(|(count, ..)| count).sum();
    let (groups, fitted) = (crossings.len() as f64, fitted as f64);
    if readings - groups < MIN_DEGREES as f64 || groups <= fitted {
        return None;
    }
    let shared: f64 = crossings.values().map(|(count, sum, _)| sum * sum / count).sum();
    let all: f64 = crossings.values().map(|(.., squares)| squares).sum();
    let noise_variance = (all - shared).max(0.0) / (readings - groups);
    let excess = (shared / (groups - fitted) - noise_variance) / (readings / groups);
    let (systematic, noise) = (excess.max(0.0).sqrt(), noise_variance.sqrt());
    (systematic > SMALLEST && systematic > LARGE * noise).then(|| {
            format!(
                "the readings of a crossing are off by {systematic:.1e} in every frame, and vary by only {noise:.1e}: Eq. (2) \
                 with these parameters does not describe the sensor; check the array scale, the order of the wires, and \
                 wires with a resistance of their own"
            )
        })
}
