use ndarray::{Array1, Array2, ArrayView2};

use super::{ridge::Ridge, units::Units};
use crate::network::{Inputs, ScalingError};

/// The ridge regression on scaled inputs with the penalty of the least leave-one-out error for each output.
///
/// The penalty is on inputs in proportion to their deviations, whether they are whitened or not: it leaves out weak
/// components first, in which noise is largest.
pub(super) struct LinearFit {
    ridge: Ridge,
    /// Deviation of each input before whitening, relative to the largest.
    sizes: Array1<f64>,
    /// Number of samples.
    samples: f64,
}

impl LinearFit {
    /// Fits to `units` of the scaled inputs and outputs. `unseen` (sources × inputs) are the changes of the inputs by one
    /// standard deviation of each source of noise that they lack.
    pub fn new(inputs: &Inputs, units: &Units, unseen: ArrayView2<'_, f64>) -> Result<Self, ScalingError> {
        let sizes = Array1::from(inputs.deviations());
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let sizes = sizes / largest;
        let x = &units.x * &sizes;
        let ridge = Ridge::new(x.view(), units.y.view(), &units.weights, (&unseen * &sizes).view())?;
        Ok(Self {
            ridge,
            sizes,
            samples: units.weights.iter().sum(),
        })
    }

    /// Coefficients of the scaled inputs: inputs + 1 × outputs, the constant last.
    pub fn coefficients(&self) -> Array2<f64> {
        let mut coefficients = self.ridge.coefficients(&self.ridge.best_penalties());
        for (mut gains, &size) in coefficients.rows_mut().into_iter().zip(&self.sizes) {
            gains *= size;
        }
        coefficients
    }

    /// Variances of the noise of the scaled inputs that has the same effect as the best penalty for all outputs together.
    pub fn variances(&self) -> Vec<f64> {
        /// Next to this noise nothing is left of the inputs.
        const LARGEST: f64 = 1e12;
        let penalty = self.ridge.common_penalty();
        let variance = |size: &f64| (penalty / self.samples / (size * size)).min(LARGEST);
        self.sizes.iter().map(variance).collect()
    }
}
