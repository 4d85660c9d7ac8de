use std::collections::BTreeMap;

use super::{
    CalibratedParameter, CalibrationError, PressedRow, SensorParameter,
    equations::{COUNT, Problem, Slopes, restricted},
    limits::check,
};
use crate::{
    dataset::Dataset,
    numerics::{Linearised, Spectrum, two_sided_normal_quantile},
    sensor::SensorModel,
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
    /// Root mean square of the relative errors of the nominal model's resistances.
    pub nominal_residual: f64,
    /// Root mean square of the relative errors of the fitted model's resistances.
    pub residual: f64,
    /// Warnings that the readings do not fit the sensor model, with likely causes and remedies.
    pub warnings: Vec<String>,
}

impl Calibration {
    /// Tolerance of nominal values, relative to [`SensorParameter::reference`]: a parameter is changed only if the
    /// readings determine it better than this.
    pub(super) const NOMINAL_TOLERANCE: f64 = 0.1;

    /// Fits geometry and resistivity of Eq. (2) to the samples of `set`, starting from `nominal`. The targets must be the
    /// absolute coordinates of the row's nodes in millimetres, with the rest positions of `nominal`.
    ///
    /// A fit with the prior that nominal values are correct to ±10 % (two standard deviations), which exists for any
    /// number of readings, decides which parameters the readings determine; these are then fitted without a prior.
    ///
    /// Parameters that the readings do not determine to ±10 % are held at their nominal values, one after another,
    /// the least certain first. The intervals of the others allow for errors of ±10 % in the nominal values, for a
    /// misfit of single crossings and for a drift from frame to frame.
    ///
    /// # Errors
    /// If the nominal sensor is impossible, the samples have no row-wires, a sample does not belong to the array or has a
    /// reading that is not a resistance, or the fit does not converge.
    ///
    /// # Panics
    /// If there are not 3·M2 targets.
    pub fn fit(nominal: &SensorModel, set: &Dataset) -> Result<Self, CalibrationError> {
        Self::of_presses(nominal, &PressedRow::of(set, nominal)?)
    }

    pub(super) fn of_presses(nominal: &SensorModel, samples: &[PressedRow]) -> Result<Self, CalibrationError> {
        check(nominal, None, samples)?;
        // The position of the first row-wire is not fitted, so it alone leaves no ambiguity.
        if let Some(row) = samples.first().map(|sample| sample.row).filter(|&row| row > 0)
            && samples.iter().all(|sample| sample.row == row)
        {
            return Err(CalibrationError::OneRow { row });
        }
        let problem = Problem::new(nominal, samples);
        let readings = problem.readings();
        if readings <= COUNT {
            return Err(CalibrationError::TooFew {
                readings,
                parameters: COUNT,
            });
        }
        let at_nominal = problem.linearise(nominal);
        // Others move no reading, such as the row pitch where only the first row is read.
        let mut free = Vec::from(SensorParameter::ALL);
        free.retain(|parameter| at_nominal.gram[(parameter.index(), parameter.index())] > 0.0);
        let mut start: Option<Vec<f64>> = None;
        loop {
            let changes = match &start {
                None => problem.fit_with_prior(&free, 0.5 * Self::NOMINAL_TOLERANCE)?,
                Some(start) => problem.fit(&free, start, 0.0)?,
            };
            let model = problem.changed(&free, &changes);
            let here = problem.linearise(&model);
            let spectrum = Spectrum::of(&restricted(&here, &free).gram).ok_or(CalibrationError::NotConverged)?;
            let noise_variance = here.squares / (readings - free.len()) as f64;
            let variances = variances(&problem, &model, &free, &spectrum, noise_variance);
            let factor = two_sided_normal_quantile(0.05 / free.len().max(1) as f64);
            // False for NaN.
            let is_determined = |variance: f64| factor * variance.sqrt() <= Self::NOMINAL_TOLERANCE;
            let of_free = variances.iter().enumerate();
            if let Some((least_certain, &variance)) = of_free.max_by(|(_, one), (_, other)| one.total_cmp(other))
                && !is_determined(variance)
            {
                free.remove(least_certain);
                start = None;
                continue;
            }
            if start.is_none() {
                start = Some(changes);
                continue;
            }
            let of_held = held_variances(&here, &free, &spectrum);
            let half_width = |parameter: SensorParameter| {
                let place = free.iter().position(|&free| free == parameter)?;
                let half_width = factor * (variances[place] + of_held[place]).sqrt();
                Some(half_width * problem.references[parameter.index()])
            };
            let parameters = Vec::from(SensorParameter::ALL.map(|parameter| CalibratedParameter {
                parameter,
                nominal: parameter.of(nominal),
                value: parameter.of(&model),
                half_width: half_width(parameter),
            }));
            let rms = |squares: f64| (squares / readings as f64).sqrt();
            return Ok(Self {
                warnings: warnings(&problem, &model, &parameters),
                model,
                parameters,
                readings,
                nominal_residual: rms(at_nominal.squares),
                residual: rms(here.squares),
            });
        }
    }
}

/// Variances of the fitted parameters `free`, allowing for correlated errors of readings: the largest of the variance
/// for independent errors and the cluster-robust variances with clusters by crossing (a misfit of one wire in every
/// frame) and by frame (a drift of all readings), from the sandwich formula `A⁻¹ (Σ_c g_c g_cᵀ) A⁻¹`, A = JᵀJ, g_c =
/// Σ_{i ∈ c} J_i r_i, times G/(G−1) for G clusters (Liang and Zeger 1986).
fn variances(
    problem: &Problem<'_>,
    model: &SensorModel,
    free: &[SensorParameter],
    spectrum: &Spectrum,
    noise_variance: f64,
) -> Vec<f64> {
    let mut clusterings: [BTreeMap<(usize, usize), Slopes>; 2] = Default::default();
    problem.residuals(model, |sample, column, residual, slopes| {
        let clusters = [(sample.row, column), (sample.frame, 0)];
        for (clustering, cluster) in clusterings.iter_mut().zip(clusters) {
            let score = clustering.entry(cluster).or_default();
            score
                .iter_mut()
                .zip(slopes)
                .for_each(|(sum, slope)| *sum += slope * residual);
        }
    });
    let independent = (0..free.len()).map(|place| noise_variance * spectrum.inverse_diagonal(place));
    let mut variances: Vec<f64> = independent.collect();
    for scores in clusterings.iter().filter(|scores| scores.len() >= 3 * free.len()) {
        let mut of_clusters = vec![0.0; free.len()];
        for score in scores.values() {
            let right: Vec<f64> = free.iter().map(|parameter| score[parameter.index()]).collect();
            add_squares(&mut of_clusters, &spectrum.solve(&right, 0.0), 1.0);
        }
        let clusters = scores.len() as f64;
        for (variance, sum) in variances.iter_mut().zip(of_clusters) {
            *variance = variance.max(sum * clusters / (clusters - 1.0));
        }
    }
    variances
}

/// Variances of the fitted parameters due to errors of the held ones, whose tolerance is two standard deviations:
/// those of −(J_fᵀJ_f)⁻¹ J_fᵀJ_h.
fn held_variances(here: &Linearised, free: &[SensorParameter], spectrum: &Spectrum) -> Vec<f64> {
    let mut sums = vec![0.0; free.len()];
    for held in SensorParameter::ALL
        .into_iter()
        .filter(|parameter| !free.contains(parameter))
    {
        let right = free
            .iter()
            .map(|parameter| here.gram[(parameter.index(), held.index())]);
        let parts = spectrum.solve(&Vec::from_iter(right), 0.0);
        add_squares(&mut sums, &parts, Calibration::NOMINAL_TOLERANCE / 2.0);
    }
    sums
}

fn add_squares(sums: &mut [f64], parts: &[f64], factor: f64) {
    sums.iter_mut()
        .zip(parts)
        .for_each(|(sum, part)| *sum += (factor * part).powi(2));
}

/// Warnings that the readings do not fit the sensor model, with what to check.
fn warnings(problem: &Problem<'_>, model: &SensorModel, parameters: &[CalibratedParameter]) -> Vec<String> {
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
