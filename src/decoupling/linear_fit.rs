use ndarray::{Array1, Array2, ArrayView2};

use super::ridge::Ridge;
use crate::network::{Inputs, ScalingError};

/// The ridge regression on scaled inputs with the penalty of the least leave-one-out error.
///
/// The penalty is on inputs in proportion to their deviations, whether they are whitened or not: it leaves out weak
/// components first, in which noise is largest.
pub(super) struct LinearFit {
    ridge: Ridge,
    penalty: f64,
    /// Deviation of each input before whitening, relative to the largest.
    sizes: Array1<f64>,
}

impl LinearFit {
    /// Fits to distinct samples of the scaled inputs `x` (samples × inputs) and outputs `y` (samples × outputs). `unseen`
    /// (sources × inputs) are the changes of the inputs by one standard deviation of each source of noise that `x` lacks.
    pub fn new(
        inputs: &Inputs,
        x: ArrayView2<'_, f64>,
        y: ArrayView2<'_, f64>,
        unseen: ArrayView2<'_, f64>,
    ) -> Result<Self, ScalingError> {
        let sizes = Array1::from(inputs.deviations());
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let sizes = sizes / largest;
        let ridge = Ridge::new((&x * &sizes).view(), y, (&unseen * &sizes).view())?;
        Ok(Self {
            penalty: ridge.best_penalty(),
            ridge,
            sizes,
        })
    }

    /// Ridge penalty, in units of squared singular values of the inputs in proportion to their deviations; infinite where
    /// the mean is better than any map.
    pub fn penalty(&self) -> f64 {
        self.penalty
    }

    /// Coefficients of the scaled inputs: inputs + 1 × outputs, the constant last.
    pub fn coefficients(&self) -> Array2<f64> {
        let mut coefficients = self.ridge.coefficients(self.penalty);
        for (mut gains, &size) in coefficients.rows_mut().into_iter().zip(&self.sizes) {
            gains *= size;
        }
        coefficients
    }

    /// Variances of the noise of the scaled inputs of `samples` samples that has the same effect as the penalty.
    pub fn variances(&self, samples: usize) -> Vec<f64> {
        /// Next to this noise nothing is left of the inputs.
        const LARGEST: f64 = 1e12;
        let variance = |size: &f64| (self.penalty / samples as f64 / (size * size)).min(LARGEST);
        self.sizes.iter().map(variance).collect()
    }
}
