use faer::Mat;
use ndarray::{Array1, Array2, ArrayView2, Axis};

use crate::network::{MinMax, ScalingError};

/// Lower bound on the error of a network with h hidden nodes, for any inputs, weights and training.
///
/// The output is an affine function of h hidden values, so its deviations from their mean span at most h directions.
/// Among all such answers, the projection of the true targets on their first h principal components has the least mean
/// squared error (Eckart and Young, 1936). The bound holds for the scaled targets of the training set to which it was
/// fitted; other sets are projected on the same components.
#[derive(Clone, Debug)]
pub struct Bottleneck {
    outputs: MinMax,
    mean: Array1<f64>,
    /// Varying outputs × components kept, orthonormal.
    components: Array2<f64>,
    min_mse: f64,
}

impl Bottleneck {
    /// Fits the principal components of `coordinates_mm` (samples × 3·M2) for `hidden` nodes.
    ///
    /// # Errors
    /// If the coordinates cannot be scaled.
    pub fn fit(coordinates_mm: ArrayView2<'_, f64>, hidden: usize) -> Result<Self, ScalingError> {
        let outputs = MinMax::fit(coordinates_mm)?;
        let targets = outputs.scale(coordinates_mm);
        let (samples, channels) = targets.dim();
        let mean = targets.mean_axis(Axis(0)).ok_or(ScalingError::Empty)?;
        let deviations = Mat::from_fn(samples, channels, |s, t| targets[[s, t]] - mean[t]);
        let kept = hidden.min(samples).min(channels);
        let (components, left_out) = principal_components(&deviations, kept)?;
        Ok(Self {
            outputs,
            mean,
            components,
            min_mse: left_out / (samples * channels).max(1) as f64,
        })
    }

    /// Least mean squared error (scaled) of any network with so few hidden nodes, on the set to which this was fitted.
    pub fn min_mse(&self) -> f64 {
        self.min_mse
    }

    /// Returns the best possible answers, in millimetres, for the true `coordinates_mm` (samples × 3·M2).
    pub(super) fn reconstruct(&self, coordinates_mm: ArrayView2<'_, f64>) -> Array2<f64> {
        let deviations = self.outputs.scale(coordinates_mm) - &self.mean;
        let projected = deviations.dot(&self.components).dot(&self.components.t()) + &self.mean;
        self.outputs.restore(projected.view())
    }
}

/// Returns the first `kept` principal components of `deviations` (samples × channels) as channels × kept, and the sum of
/// squares that they leave out.
fn principal_components(deviations: &Mat<f64>, kept: usize) -> Result<(Array2<f64>, f64), ScalingError> {
    let svd = deviations.thin_svd().map_err(|_| ScalingError::NotConverged)?;
    let components = Array2::from_shape_fn((deviations.ncols(), kept), |(t, k)| svd.V()[(t, k)]);
    let left_out = svd.S().column_vector().iter().skip(kept).map(|value| value * value);
    Ok((components, left_out.sum()))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    /// Corners of a cube: every direction varies equally, and min-max scaling leaves them as they are.
    fn cube() -> Array2<f64> {
        Array2::from_shape_fn(
            (8, 3),
            |(corner, axis)| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 },
        )
    }

    #[test]
    fn where_all_directions_vary_alike_each_hidden_node_carries_its_share() {
        for hidden in 0..=4 {
            let bottleneck = Bottleneck::fit(cube().view(), hidden).unwrap();
            let expected = 1.0 - hidden.min(3) as f64 / 3.0;
            assert!((bottleneck.min_mse() - expected).abs() < 1e-12, "{hidden} hidden");
            let reconstructed = bottleneck.reconstruct(cube().view());
            let mse = (reconstructed - cube()).mapv(|error| error * error).mean().unwrap();
            assert!((mse - expected).abs() < 1e-12, "{hidden} hidden");
        }
    }

    #[test]
    fn channels_that_vary_together_need_one_node() {
        let line = array![[0.0, 5.0, 2.0], [1.0, 5.0, 4.0], [3.0, 5.0, 8.0]];
        let bottleneck = Bottleneck::fit(line.view(), 1).unwrap();
        assert!(bottleneck.min_mse() < 1e-30);
        let difference = bottleneck.reconstruct(line.view()) - line;
        assert!(difference.iter().all(|error| error.abs() < 1e-14));
    }

    #[test]
    fn nothing_that_varies_needs_nothing() {
        let bottleneck = Bottleneck::fit(array![[1.0, 2.0], [1.0, 2.0]].view(), 3).unwrap();
        assert_eq!(bottleneck.min_mse(), 0.0);
        assert_eq!(bottleneck.reconstruct(array![[1.0, 2.0]].view()), array![[1.0, 2.0]]);
    }

    #[test]
    fn what_does_not_converge_is_an_error_and_no_bound_of_zero() {
        let deviations = Mat::from_fn(5, 3, |s, t| if (s, t) == (2, 1) { f64::NAN } else { 1.0 });
        assert_eq!(principal_components(&deviations, 2), Err(ScalingError::NotConverged));
    }
}
