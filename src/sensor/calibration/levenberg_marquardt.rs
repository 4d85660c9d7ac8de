use super::{
    super::SensorModel,
    CalibrationError, PressedRow, SensorParameter,
    covariance::Decomposition,
    equations::{COUNT, Slopes, log_resistances},
};

/// Sums of the linearised equations at one sensor model, with every parameter in proportion to its reference.
pub(super) struct Linearised {
    /// JᵀJ.
    pub(super) gram: [[f64; COUNT]; COUNT],
    /// Jᵀr, with r = ln of the readings − ln R.
    gradient: [f64; COUNT],
    /// Σ r².
    pub(super) squares: f64,
}

impl Linearised {
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

/// Fits the parameters `free` (indices in [`SensorParameter::ALL`]) from `nominal`, by the Levenberg-Marquardt method
/// (Marquardt 1963) on the logarithms of the resistances, so that relative errors count alike. Returns the model and the
/// number of iterations.
pub(super) fn fit(
    nominal: &SensorModel,
    free: &[usize],
    references: &Slopes,
    samples: &[PressedRow],
) -> Result<(SensorModel, usize), CalibrationError> {
    /// Iterations after which a fit that has not ended will not.
    const MOST: usize = 200;
    /// Relative change of every parameter below which the fit has ended.
    const SMALLEST_STEP: f64 = 1e-11;
    /// Damping, in proportion to the largest eigenvalue of JᵀJ, beyond which no step is left.
    const LARGEST_DAMPING: f64 = 1e6;
    let (mut model, mut damping) = (*nominal, 1e-6);
    let mut here = Linearised::at(&model, references, samples);
    for iteration in 1..=MOST {
        let decomposition = Decomposition::of(&here.gram, free)?;
        let gradient: Vec<f64> = free.iter().map(|&index| here.gradient[index]).collect();
        loop {
            let step = decomposition.solve(&gradient, damping * decomposition.largest());
            let mut candidate = model;
            for (&index, change) in free.iter().zip(&step) {
                *SensorParameter::ALL[index].field(&mut candidate) += change * references[index];
            }
            let is_small = step.iter().all(|change| change.abs() < SMALLEST_STEP);
            let is_possible = candidate.check().is_ok() && is_above_columns(&candidate, samples);
            let next = is_possible.then(|| Linearised::at(&candidate, references, samples));
            // False for NaN.
            if let Some(next) = next.filter(|next| next.squares <= here.squares) {
                (model, here, damping) = (candidate, next, (damping * 0.1).max(1e-15));
                if is_small {
                    return Ok((model, iteration));
                }
                break;
            }
            // At the minimum, rounding decides which of two models is better.
            if is_small {
                return Ok((model, iteration));
            }
            damping *= 10.0;
            if damping > LARGEST_DAMPING {
                return Err(CalibrationError::NotConverged);
            }
        }
    }
    Err(CalibrationError::NotConverged)
}

/// Tells whether every node stays above the column-wires.
fn is_above_columns(model: &SensorModel, samples: &[PressedRow]) -> bool {
    let mut nodes = samples.iter().flat_map(|sample| &sample.displacements_mm);
    nodes.all(|displacement| displacement.z < model.geometry.height_mm)
}
