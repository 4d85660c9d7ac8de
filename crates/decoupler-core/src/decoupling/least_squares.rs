use faer::Mat;
use ndarray::{Array2, Axis, Slice};

use crate::{
    dataset::Dataset,
    network::{Inputs, MinMax, ScalingError},
};

/// Fits the affine map from scaled inputs to scaled outputs to `training` by least squares, and returns its
/// coefficients (inputs + 1 × varying outputs, the constant last).
///
/// Uses the singular value decomposition. Directions that the training set does not resolve (singular values below
/// rounding) are left out, which gives the least-squares solution of minimum norm.
///
/// # Errors
/// If scaled values overflow, so that the decomposition does not converge.
pub(super) fn fit_least_squares(
    training: &Dataset,
    inputs: &Inputs,
    outputs: &MinMax,
) -> Result<Array2<f64>, ScalingError> {
    let (n1, m) = (inputs.count() + 1, outputs.varying().len());
    let triangle = triangle(training, inputs, outputs);
    let rows = n1.min(triangle.nrows());
    let (a, y) = triangle.as_ref().subrows(0, rows).split_at_col(n1);
    let svd = a.thin_svd().map_err(|_| ScalingError::NotConverged)?;
    let singular = svd.S().column_vector();
    let smallest = f64::EPSILON * training.samples().max(n1) as f64 * singular[0];
    let mut projected = svd.U().transpose() * y;
    for (k, &value) in singular.iter().enumerate() {
        let inverse = if value > smallest { 1.0 / value } else { 0.0 };
        projected.row_mut(k).iter_mut().for_each(|entry| *entry *= inverse);
    }
    let fitted = svd.V() * projected;
    if !fitted.is_all_finite() {
        return Err(ScalingError::NotConverged);
    }
    Ok(Array2::from_shape_fn((n1, m), |(i, t)| fitted[(i, t)]))
}

/// Returns the triangular factor of [inputs, 1, outputs], all scaled, which has the same least-squares solutions as
/// the whole set. Chunks of samples are added to the factor one by one, so memory does not grow with their number
/// (Golub and Van Loan, Matrix Computations, section 6.5.2).
fn triangle(training: &Dataset, inputs: &Inputs, outputs: &MinMax) -> Mat<f64> {
    /// Number of samples per chunk.
    const CHUNK: usize = 512;
    let columns = inputs.count() + 1 + outputs.varying().len();
    let mut factor = Mat::<f64>::zeros(0, columns);
    for first in (0..training.samples()).step_by(CHUNK) {
        let chunk = Slice::from(first..training.samples().min(first + CHUNK));
        let x = inputs.of(training.readings().slice_axis(Axis(0), chunk));
        let y = outputs.scale(training.targets().slice_axis(Axis(0), chunk));
        let (before, n) = (factor.nrows(), x.ncols());
        let joined = Mat::from_fn(before + x.nrows(), columns, |row, column| {
            if row < before {
                factor[(row, column)]
            } else if column < n {
                x[[row - before, column]]
            } else if column == n {
                1.0
            } else {
                y[[row - before, column - n - 1]]
            }
        });
        factor = joined.qr().thin_R().to_owned();
    }
    factor
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;
    use crate::network::{InputScaling, Quantity};

    #[test]
    fn overflow_when_scaled_is_an_error() {
        let tiny = MinMax::fit(array![[0.0], [1e-200]].view()).unwrap();
        let readings = array![[1e200], [-1e200], [3.0]];
        let set = Dataset::new(readings, array![[1.0], [2.0], [3.0]], None, vec![0, 1, 2]).unwrap();
        let inputs = Inputs::new(Quantity::Raw, InputScaling::MinMax(tiny));
        let outputs = MinMax::fit(set.targets()).unwrap();
        assert_eq!(
            fit_least_squares(&set, &inputs, &outputs),
            Err(ScalingError::NotConverged)
        );
    }
}
