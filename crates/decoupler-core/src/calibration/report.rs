use std::{collections::BTreeMap, fmt};

use super::{
    CalibrationError, PressLimits, PressedRow,
    equations::{COUNT, Slopes},
    fit::{CalibratedFit, Decomposition, LinearisedFit, fit, fit_with_prior, residuals, variances},
};
use crate::{
    numerics::two_sided_normal_quantile,
    sensor::{SensorModel, short},
};

/// A sensor model fitted to readings of known deformations.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The fitted model; parameters that the readings do not determine have their nominal values.
    pub model: SensorModel,
    /// All parameters, with the status of each.
    pub parameters: Vec<CalibratedParameter>,
    /// Number of readings fitted.
    pub readings: usize,
    /// Number of iterations of the last fit.
    pub iterations: usize,
    /// Root mean square of the relative errors of the nominal model's resistances.
    pub nominal_residual: f64,
    /// Root mean square of the relative errors of the fitted model's resistances.
    pub residual: f64,
    /// Singular values of the Jacobian of ln R with respect to relative changes of the parameters, largest first,
    /// divided by the residual: a pattern with value s is known to one part in s. 0 for a pattern that the readings
    /// do not determine.
    pub patterns: Vec<f64>,
    /// Warnings that the readings do not fit the sensor model, with likely causes and remedies.
    pub warnings: Vec<CalibrationWarning>,
}

/// A parameter of a calibrated sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedParameter {
    /// The parameter.
    pub parameter: SensorParameter,
    /// Value before calibration, in the parameter's unit.
    pub nominal: f64,
    /// Value of the fitted model.
    pub value: f64,
    /// Status of the value.
    pub standing: ParameterStatus,
}

/// Status of a calibrated value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterStatus {
    /// The readings determine it: the true value is within ± this, in the parameter's unit. The intervals of all parameters
    /// together hold with 95 % confidence (Bonferroni), given readings that follow Eq. (2).
    Determined(f64),
    /// The readings do not determine it to ±10 %: it keeps its nominal value.
    Nominal,
}

impl Calibration {
    /// Tolerance of nominal values, relative to [`SensorParameter::reference`]: a parameter is changed only if the
    /// readings determine it better than this.
    pub(super) const NOMINAL_TOLERANCE: f64 = 0.1;

    /// Fits geometry and resistivity of Eq. (2) to `samples`, starting from `nominal`.
    ///
    /// A fit with the prior that nominal values are correct to ±10 % (two standard deviations), which exists for any
    /// number of readings, decides which parameters the readings determine; these are then fitted without a prior.
    ///
    /// Parameters that the readings do not determine to ±10 % are held at their nominal values, one after another,
    /// the least certain first. The intervals of the others allow for errors of ±10 % in the nominal values, for a
    /// misfit of single crossings and for a drift from frame to frame.
    ///
    /// # Errors
    /// If the nominal sensor is impossible, a sample does not belong to the array or has a reading that is not a
    /// resistance, or the fit does not converge.
    pub fn fit(nominal: &SensorModel, samples: &[PressedRow]) -> Result<Self, CalibrationError> {
        PressLimits::of_sensor(nominal).check(nominal, samples)?;
        // The position of the first row-wire is not fitted, so it alone leaves no ambiguity.
        if let Some(row) = samples.first().map(|sample| sample.row).filter(|&row| row > 0)
            && samples.iter().all(|sample| sample.row == row)
        {
            return Err(CalibrationError::OneRow { row });
        }
        let readings = samples.len() * nominal.scale.columns();
        if readings <= COUNT {
            return Err(CalibrationError::TooFew {
                readings,
                parameters: COUNT,
            });
        }
        let references: Slopes = SensorParameter::ALL.map(|parameter| parameter.reference(nominal));
        let start = LinearisedFit::at(nominal, &references, samples);
        // A parameter that moves no reading, such as the row pitch where only the first row is read.
        let mut free: Vec<usize> = (0..COUNT).filter(|&index| start.gram[index][index] > 0.0).collect();
        let mut with_prior = true;
        let mut from = *nominal;
        loop {
            let CalibratedFit {
                model,
                here,
                iterations,
            } = if with_prior {
                let tolerance = 0.5 * Self::NOMINAL_TOLERANCE;
                fit_with_prior(nominal, &free, &references, samples, tolerance)?
            } else {
                fit((nominal, &from), &free, &references, samples, 0.0)?
            };
            let decomposition = Decomposition::of(&here.gram, &free)?;
            let noise_variance = here.squares / (readings - free.len()) as f64;
            let fit_variances = variances(&model, &free, &references, samples, (&decomposition, noise_variance));
            let factor = two_sided_normal_quantile(0.05 / free.len().max(1) as f64);
            let least_certain = fit_variances
                .iter()
                .enumerate()
                .max_by(|(_, one), (_, other)| one.total_cmp(other));
            // False for NaN.
            let is_determined = |variance: f64| factor * variance.sqrt() <= Self::NOMINAL_TOLERANCE;
            if let Some((index, &variance)) = least_certain
                && !is_determined(variance)
            {
                free.remove(index);
                with_prior = true;
                continue;
            }
            if std::mem::replace(&mut with_prior, false) {
                from = model;
                continue;
            }
            let of_held = held_variances(&here, &free, &decomposition);
            let half_width = |place: usize| factor * (fit_variances[place] + of_held[place]).sqrt();
            let parameters = SensorParameter::ALL.into_iter().enumerate();
            let parameters = parameters.map(|(index, parameter)| {
                let place = free.iter().position(|&free| free == index);
                CalibratedParameter {
                    parameter,
                    nominal: parameter.of(nominal),
                    value: parameter.of(&model),
                    standing: place.map_or(ParameterStatus::Nominal, |place| {
                        ParameterStatus::Determined(half_width(place) * references[index])
                    }),
                }
            });
            let parameters: Vec<CalibratedParameter> = parameters.collect();
            let whole = Decomposition::of(&here.gram, &Vec::from_iter(0..COUNT))?;
            let rms = |squares: f64| (squares / readings as f64).sqrt();
            let noise = noise_variance.sqrt().max(f64::EPSILON);
            return Ok(Self {
                warnings: CalibrationWarning::of(&model, &references, samples, &parameters, free.len()),
                model,
                parameters,
                readings,
                iterations,
                nominal_residual: rms(start.squares),
                residual: rms(here.squares),
                patterns: whole.values.iter().map(|value| value.max(0.0).sqrt() / noise).collect(),
            });
        }
    }

    /// Returns the fitted parameter of this kind.
    pub fn parameter(&self, parameter: SensorParameter) -> CalibratedParameter {
        let found = self.parameters.iter().find(|fitted| fitted.parameter == parameter);
        *found.expect("every parameter is listed")
    }
}

/// Variances of the fitted parameters due to errors of the held ones, whose tolerance is two standard deviations:
/// those of −(J_fᵀJ_f)⁻¹ J_fᵀJ_h.
fn held_variances(here: &LinearisedFit, free: &[usize], decomposition: &Decomposition) -> Vec<f64> {
    let mut sums = vec![0.0; free.len()];
    for held in (0..COUNT).filter(|index| !free.contains(index)) {
        let right: Vec<f64> = free.iter().map(|&index| here.gram[index][held]).collect();
        for (sum, part) in sums.iter_mut().zip(decomposition.solve(&right, 0.0)) {
            *sum += (part * Calibration::NOMINAL_TOLERANCE / 2.0).powi(2);
        }
    }
    sums
}

impl fmt::Display for CalibratedParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            parameter,
            nominal,
            value,
            standing,
        } = self;
        let unit = parameter.unit();
        match standing {
            ParameterStatus::Determined(half_width) => {
                // Two digits of the interval, and the value to the same decimal place.
                let digits = (1.0 - half_width.log10().floor()).clamp(0.0, 12.0) as usize;
                write!(
                    f,
                    "{parameter}: {value:.digits$} ± {half_width:.digits$} {unit} (nominal {})",
                    short(*nominal)
                )
            }
            ParameterStatus::Nominal => write!(
                f,
                "{parameter}: {} {unit}, its nominal value: these readings do not determine it",
                short(*nominal)
            ),
        }
    }
}

/// Parameter of the sensor model that readings depend on.
///
/// Only differences of coordinates matter, so the x of the first row-wire is the origin and stays, and the y of the first
/// column-wire cancels: rows are centred over the column-wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SensorParameter {
    /// Distance of the undeformed row-wires above the column-wires.
    Height,
    /// Distance between row-wires.
    RowPitch,
    /// Distance between the nodes on a row-wire.
    NodePitch,
    /// Distance between column-wires.
    ColumnPitch,
    /// x of the first node on each column-wire.
    ColumnNodeX,
    /// Distance between the nodes on a column-wire.
    ColumnNodePitch,
    /// Resistance per millimetre of rubber, g.
    Resistivity,
}

impl SensorParameter {
    /// Every parameter.
    pub const ALL: [Self; 7] = [
        Self::Height,
        Self::RowPitch,
        Self::NodePitch,
        Self::ColumnPitch,
        Self::ColumnNodeX,
        Self::ColumnNodePitch,
        Self::Resistivity,
    ];

    /// Number of parameters.
    pub(super) const COUNT: usize = Self::ALL.len();

    /// Unit of the value.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Resistivity => "ohm/mm",
            _ => "mm",
        }
    }

    /// Value in `model`, in [`Self::unit`].
    pub fn of(self, model: &SensorModel) -> f64 {
        *self.field(&mut model.clone())
    }

    /// Returns the reference for relative changes of the parameter: the nominal value, or, for the x of the column
    /// nodes, which may be 0 or far from any origin, the nominal distance between them.
    pub fn reference(self, nominal: &SensorModel) -> f64 {
        match self {
            Self::ColumnNodeX => nominal.geometry.column_node_pitch_mm,
            _ => self.of(nominal),
        }
    }

    pub(super) fn field(self, model: &mut SensorModel) -> &mut f64 {
        let geometry = &mut model.geometry;
        match self {
            Self::Height => &mut geometry.height_mm,
            Self::RowPitch => &mut geometry.row_pitch_mm,
            Self::NodePitch => &mut geometry.node_pitch_mm,
            Self::ColumnPitch => &mut geometry.column_pitch_mm,
            Self::ColumnNodeX => &mut geometry.column_node_x0_mm,
            Self::ColumnNodePitch => &mut geometry.column_node_pitch_mm,
            Self::Resistivity => &mut model.resistivity_ohm_per_mm,
        }
    }
}

impl fmt::Display for SensorParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Height => "height",
            Self::RowPitch => "row pitch",
            Self::NodePitch => "node pitch",
            Self::ColumnPitch => "column pitch",
            Self::ColumnNodeX => "x of the first column node",
            Self::ColumnNodePitch => "column node pitch",
            Self::Resistivity => "resistance per millimetre",
        })
    }
}

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
    /// Warnings about a fit of `fitted` parameters.
    pub(super) fn of(
        model: &SensorModel,
        references: &Slopes,
        samples: &[PressedRow],
        parameters: &[CalibratedParameter],
        fitted: usize,
    ) -> Vec<Self> {
        /// Standard deviations of the prior from which a value counts as far from its nominal value.
        const FAR: f64 = 3.0;
        let deviation = 0.5 * Calibration::NOMINAL_TOLERANCE;
        let mut largest = 0.0_f64;
        let mut far = Vec::new();
        for (fitted, reference) in parameters.iter().zip(references) {
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
        let far = (!far.is_empty()).then_some(Self::FarFromNominal {
            parameters: far,
            deviations: largest,
        });
        far.into_iter()
            .chain(Self::misfit(model, references, samples, fitted))
            .collect()
    }

    /// Returns a warning if the errors that all frames share are large compared with the noise, by an analysis of
    /// variance of the residuals by crossing.
    fn misfit(model: &SensorModel, references: &Slopes, samples: &[PressedRow], fitted: usize) -> Option<Self> {
        /// Ratio of systematic error to noise from which it is reported.
        const LARGE: f64 = 3.0;
        /// Minimum degrees of freedom of the noise estimate: readings minus crossings.
        const MIN_DEGREES: usize = 10;
        /// Relative errors explained by rounding.
        const SMALLEST: f64 = 1e-12;
        // Number, sum and sum of squares of the residuals of each crossing.
        let mut crossings: BTreeMap<(usize, usize), (f64, f64, f64)> = BTreeMap::new();
        residuals(model, references, samples, |sample, column, residual, _| {
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
