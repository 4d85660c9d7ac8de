use std::collections::HashMap;

use faer::Mat;

use super::{
    CalibrationError, PressedRow, SensorParameter,
    equations::{COUNT, Slopes, log_resistances},
};
use crate::sensor::SensorModel;

/// Sums of the linearised equations at one sensor model, with every parameter relative to its reference.
pub(super) struct LinearisedFit {
    /// JᵀJ.
    pub(super) gram: [[f64; COUNT]; COUNT],
    /// Jᵀr, with r = ln of the readings − ln R.
    gradient: [f64; COUNT],
    /// Σ r².
    pub(super) squares: f64,
}

impl LinearisedFit {
    pub(super) fn at(model: &SensorModel, references: &Slopes, samples: &[PressedRow]) -> Self {
        let mut sums = Self {
            gram: [[0.0; COUNT]; COUNT],
            gradient: [0.0; COUNT],
            squares: 0.0,
        };
        residuals(model, references, samples, |_, _, residual, slopes| {
            sums.squares += residual * residual;
            for (one, slope) in slopes.iter().enumerate() {
                sums.gradient[one] += slope * residual;
                for (other, value) in slopes.iter().enumerate().take(one + 1) {
                    sums.gram[one][other] += slope * value;
                }
            }
        });
        for one in 0..COUNT {
            for other in 0..one {
                sums.gram[other][one] = sums.gram[one][other];
            }
        }
        sums
    }
}

/// Calls `take` for every reading with its sample, its column-wire, its residual and its derivatives.
pub(super) fn residuals(
    model: &SensorModel,
    references: &Slopes,
    samples: &[PressedRow],
    mut take: impl FnMut(&PressedRow, usize, f64, &Slopes),
) {
    for sample in samples {
        log_resistances(model, sample, |column, ln_ohm, slopes| {
            let scaled: Slopes = std::array::from_fn(|index| slopes[index] * references[index]);
            take(sample, column, sample.resistances_ohm[column].ln() - ln_ohm, &scaled);
        });
    }
}

/// Outcome of a fit.
pub(super) struct CalibratedFit {
    pub(super) model: SensorModel,
    /// The equations linearised there, without the prior.
    pub(super) here: LinearisedFit,
    pub(super) iterations: usize,
}

/// Fits the parameters `free` (indices in [`SensorParameter::ALL`]) from `start`, by the Levenberg-Marquardt method
/// (Marquardt 1963) on the logarithms of the resistances, so that relative errors count alike:
/// minimises `Σ r² + prior_weight · Σ θ²`, with θ the change of a parameter from `nominal` in proportion to its reference.
///
/// The fit has converged when the Gauss-Newton step would lower this objective by an amount that is negligible
/// compared with the uncertainty of the parameters (the relative offset of Bates and Watts 1981), whatever the length
/// of the step: poorly determined patterns do not delay convergence. Exact readings converge when rounding is
/// reached.
pub(super) fn fit(
    (nominal, start): (&SensorModel, &SensorModel),
    free: &[usize],
    references: &Slopes,
    samples: &[PressedRow],
    prior_weight: f64,
) -> Result<CalibratedFit, CalibrationError> {
    /// Iteration limit.
    const MAX: usize = 200;
    /// Convergence tolerance: length of the remaining step, in standard deviations of the parameters.
    const OFFSET: f64 = 1e-4;
    /// Relative change of Σ r² that is attributed to rounding.
    const ROUNDING_OF_SUM: f64 = 1e-14;
    /// Rounding error of a residual: that of a reading, a resistance and their logarithms.
    const ROUNDING: f64 = 16.0 * f64::EPSILON;
    /// Damping, relative to the largest eigenvalue of JᵀJ, beyond which the fit stops.
    const LARGEST_DAMPING: f64 = 1e6;
    let readings: usize = samples.iter().map(|sample| sample.resistances_ohm.len()).sum();
    let redundancy = readings.saturating_sub(free.len()).max(1) as f64;
    let share = (OFFSET * OFFSET / redundancy).max(ROUNDING_OF_SUM);
    let changes = |model: &SensorModel| -> Vec<f64> {
        let change = |&index: &usize| {
            let parameter = SensorParameter::ALL[index];
            (parameter.of(model) - parameter.of(nominal)) / references[index]
        };
        free.iter().map(change).collect()
    };
    let penalty = |changes: &[f64]| prior_weight * changes.iter().map(|change| change * change).sum::<f64>();
    let (mut model, mut damping) = (*start, 1e-6);
    let mut here = LinearisedFit::at(&model, references, samples);
    let mut moved = changes(&model);
    for iteration in 1..=MAX {
        let mut gram = here.gram;
        free.iter().for_each(|&index| gram[index][index] += prior_weight);
        let decomposition = Decomposition::of(&gram, free)?;
        let gradient = free.iter().zip(&moved);
        let gradient: Vec<f64> = gradient
            .map(|(&index, moved)| here.gradient[index] - prior_weight * moved)
            .collect();
        let squares = here.squares + penalty(&moved);
        let newton = decomposition.solve(&gradient, 0.0);
        let gain: f64 = newton.iter().zip(&gradient).map(|(step, slope)| step * slope).sum();
        if gain <= share * squares + readings as f64 * ROUNDING * ROUNDING {
            return Ok(CalibratedFit {
                model,
                here,
                iterations: iteration,
            });
        }
        loop {
            let step = decomposition.solve(&gradient, damping * decomposition.largest());
            let mut candidate = model;
            for (&index, change) in free.iter().zip(&step) {
                *SensorParameter::ALL[index].field(&mut candidate) += change * references[index];
            }
            let is_possible = candidate.check().is_ok() && is_above_columns(&candidate, samples);
            let next = is_possible.then(|| (LinearisedFit::at(&candidate, references, samples), changes(&candidate)));
            // False for NaN.
            if let Some(next) = next.filter(|(next, moved)| next.squares + penalty(moved) < squares) {
                model = candidate;
                (here, moved) = next;
                damping = (damping * 0.1).max(1e-15);
                break;
            }
            damping *= 10.0;
            if damping > LARGEST_DAMPING {
                return Err(CalibrationError::NotConverged);
            }
        }
    }
    Err(CalibrationError::NotConverged)
}

/// Fits the parameters `free` with a normal prior around their nominal values, whose standard deviation is
/// `tolerance` relative to their references, and with the noise estimated from the residuals. This fit exists for any
/// number of readings.
pub(super) fn fit_with_prior(
    nominal: &SensorModel,
    free: &[usize],
    references: &Slopes,
    samples: &[PressedRow],
    tolerance: f64,
) -> Result<CalibratedFit, CalibrationError> {
    /// Maximum iterations of the noise estimate, and the relative change at which it has converged.
    const ROUNDS: usize = 20;
    const SETTLED: f64 = 1e-2;
    let readings: usize = samples.iter().map(|sample| sample.resistances_ohm.len()).sum();
    let redundancy = readings.saturating_sub(free.len()).max(1) as f64;
    let variance_of = |here: &LinearisedFit| (here.squares / redundancy).max(f64::EPSILON * f64::EPSILON);
    let mut variance = variance_of(&LinearisedFit::at(nominal, references, samples));
    let mut start = *nominal;
    for round in 1.. {
        let weight = variance / (tolerance * tolerance);
        let fitted = fit((nominal, &start), free, references, samples, weight)?;
        let last = std::mem::replace(&mut variance, variance_of(&fitted.here));
        if round == ROUNDS || (variance / last - 1.0).abs() <= SETTLED {
            return Ok(fitted);
        }
        start = fitted.model;
    }
    Err(CalibrationError::NotConverged)
}

/// Returns `true` if every node stays above the column-wires.
fn is_above_columns(model: &SensorModel, samples: &[PressedRow]) -> bool {
    let mut nodes = samples.iter().flat_map(|sample| &sample.displacements_mm);
    nodes.all(|displacement| displacement.z < model.geometry.height_mm)
}

/// Eigenvalues and eigenvectors of JᵀJ for some of the parameters.
pub(super) struct Decomposition {
    /// Squares of the singular values of J, largest first.
    pub(super) values: Vec<f64>,
    /// Parameter × pattern.
    vectors: Mat<f64>,
}

impl Decomposition {
    pub(super) fn of(gram: &[[f64; COUNT]; COUNT], free: &[usize]) -> Result<Self, CalibrationError> {
        let matrix = Mat::from_fn(free.len(), free.len(), |one, other| gram[free[one]][free[other]]);
        let svd = matrix.thin_svd().map_err(|_| CalibrationError::NotConverged)?;
        Ok(Self {
            values: svd.S().column_vector().iter().copied().collect(),
            vectors: svd.U().to_owned(),
        })
    }

    /// Largest eigenvalue; 0 without parameters.
    pub(super) fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// (JᵀJ + damping · I)⁻¹ `right`, leaving out patterns below rounding.
    pub(super) fn solve(&self, right: &[f64], damping: f64) -> Vec<f64> {
        let mut solution = vec![0.0; right.len()];
        for (pattern, &value) in self.values.iter().enumerate() {
            if value > self.rounding() {
                let along: f64 = (0..right.len()).map(|k| self.vectors[(k, pattern)] * right[k]).sum();
                for (k, part) in solution.iter_mut().enumerate() {
                    *part += self.vectors[(k, pattern)] * along / (value + damping);
                }
            }
        }
        solution
    }

    /// Diagonal entry of (JᵀJ)⁻¹; infinite if the parameter is part of a pattern below rounding.
    pub(super) fn inverse_diagonal(&self, parameter: usize) -> f64 {
        let part = |(pattern, &value): (usize, &f64)| {
            let share = self.vectors[(parameter, pattern)].powi(2);
            match value > self.rounding() {
                true => share / value,
                false if share > 1e-12 => f64::INFINITY,
                false => 0.0,
            }
        };
        self.values.iter().enumerate().map(part).sum()
    }

    fn rounding(&self) -> f64 {
        self.largest() * f64::EPSILON * 16.0
    }
}

/// Variances of the fitted parameters `free`, allowing for correlated errors of readings: the largest of the variance
/// for independent errors and the cluster-robust variances with clusters by crossing (a misfit of one wire in every
/// frame) and by frame (a drift of all readings), from the sandwich formula `A⁻¹ (Σ_c g_c g_cᵀ) A⁻¹`, A = JᵀJ, g_c =
/// Σ_{i ∈ c} J_i r_i, times G/(G−1) for G clusters (Liang and Zeger 1986).
pub(super) fn variances(
    model: &SensorModel,
    free: &[usize],
    references: &Slopes,
    samples: &[PressedRow],
    (decomposition, noise_variance): (&Decomposition, f64),
) -> Vec<f64> {
    let mut by_crossing: HashMap<(usize, usize), Slopes> = HashMap::new();
    let mut by_frame: HashMap<usize, Slopes> = HashMap::new();
    residuals(model, references, samples, |sample, column, residual, slopes| {
        let crossing = by_crossing.entry((sample.row, column)).or_insert([0.0; COUNT]);
        let frame = by_frame.entry(sample.frame).or_insert([0.0; COUNT]);
        for (index, slope) in slopes.iter().enumerate() {
            crossing[index] += slope * residual;
            frame[index] += slope * residual;
        }
    });
    let mut variances: Vec<f64> = (0..free.len())
        .map(|parameter| noise_variance * decomposition.inverse_diagonal(parameter))
        .collect();
    // In a fixed order, for bit-identical sums.
    let clusterings = [sorted(by_crossing), sorted(by_frame)];
    for scores in clusterings.iter().filter(|scores| scores.len() >= 3 * free.len()) {
        let mut of_clusters = vec![0.0; free.len()];
        for score in scores {
            let right: Vec<f64> = free.iter().map(|&index| score[index]).collect();
            for (sum, part) in of_clusters.iter_mut().zip(decomposition.solve(&right, 0.0)) {
                *sum += part * part;
            }
        }
        let clusters = scores.len() as f64;
        for (variance, sum) in variances.iter_mut().zip(of_clusters) {
            *variance = variance.max(sum * clusters / (clusters - 1.0));
        }
    }
    variances
}

fn sorted<K: Ord>(scores: HashMap<K, Slopes>) -> Vec<Slopes> {
    let mut scores: Vec<(K, Slopes)> = scores.into_iter().collect();
    scores.sort_by(|(one, _), (other, _)| one.cmp(other));
    scores.into_iter().map(|(_, score)| score).collect()
}
