use std::{collections::BTreeMap, fmt};

use super::{CalibratedParameter, Calibration, ParameterStatus, equations::Problem};
use crate::sensor::SensorModel;

/// Warning that the readings do not fit the sensor model, with what to check.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CalibrationWarning {
    /// Fitted values are far from their nominal values.
    FarFromNominal {
        /// The parameters.
        parameters: Vec<CalibratedParameter>,
        /// Largest distance, in standard deviations of the prior.
        deviations: f64,
    },
    /// The readings of a crossing are off by the same amount in every frame.
    Misfit {
        /// Root mean square over crossings of the relative error that all frames share.
        systematic: f64,
        /// Relative standard deviation of the readings of a crossing about their mean error.
        noise: f64,
    },
}

impl CalibrationWarning {
    /// Warnings about a fit.
    pub(super) fn of(problem: &Problem<'_>, model: &SensorModel, parameters: &[CalibratedParameter]) -> Vec<Self> {
        /// Standard deviations of the prior from which a value counts as far from its nominal value.
        const FAR: f64 = 3.0;
        let deviation = 0.5 * Calibration::NOMINAL_TOLERANCE;
        let mut largest = 0.0_f64;
        let mut far = Vec::new();
        for (fitted, reference) in parameters.iter().zip(&problem.references) {
            let ParameterStatus::Determined(half_width) = fitted.standing else {
                continue;
            };
            let apart = (fitted.value - fitted.nominal).abs();
            // The part of the difference beyond the interval.
            if apart - half_width > FAR * deviation * reference {
                largest = largest.max(apart / (deviation * reference));
                far.push(*fitted);
            }
        }
        let fitted = parameters
            .iter()
            .filter(|fitted| fitted.standing != ParameterStatus::Nominal);
        let far = (!far.is_empty()).then_some(Self::FarFromNominal {
            parameters: far,
            deviations: largest,
        });
        far.into_iter()
            .chain(Self::misfit(problem, model, fitted.count()))
            .collect()
    }

    /// Returns a warning if the errors that all frames share are large compared with the noise, by an analysis of
    /// variance of the residuals by crossing.
    fn misfit(problem: &Problem<'_>, model: &SensorModel, fitted: usize) -> Option<Self> {
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
        (systematic > SMALLEST && systematic > LARGE * noise).then_some(Self::Misfit { systematic, noise })
    }
}

impl fmt::Display for CalibrationWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FarFromNominal { parameters, deviations } => {
                for (place, fitted) in parameters.iter().enumerate() {
                    let separator = if place == 0 { "" } else { "; " };
                    write!(f, "{separator}{fitted}")?;
                }
                write!(
                    f,
                    ": up to {deviations:.0} standard deviations from nominal values that are assumed to be correct to ±10 % (two \
                     standard deviations); check the array scale, the order of the wires and the unit of the displacements, or \
                     use a nominal sensor that is closer"
                )
            }
            Self::Misfit { systematic, noise } => write!(
                f,
                "the readings of a crossing are off by {systematic:.1e} in every frame, and vary by only {noise:.1e}: Eq. (2) \
                 with these parameters does not describe the sensor; check the array scale, the order of the wires, and \
                 wires with a resistance of their own"
            ),
        }
    }
}
