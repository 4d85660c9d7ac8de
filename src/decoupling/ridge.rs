use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis, Slice};

use crate::network::ScalingError;

/// Fits the ridge regression of `y` on `x` and returns its coefficients (inputs + 1 × outputs, the constant last) and
/// penalty.
///
/// The penalty is chosen from a grid of powers of ten by the least generalised cross-validation error
/// `‖residual‖² / (S − effective parameters)²` (Golub, Heath and Wahba 1979).
pub(super) fn fit_ridge(x: ArrayView2<'_, f64>, y: ArrayView2<'_, f64>) -> Result<(Array2<f64>, f64), ScalingError> {
    let (samples, n) = x.dim();
    let outputs = y.ncols();
    let mean = |values: &ArrayView2<'_, f64>| values.mean_axis(Axis(0)).ok_or(ScalingError::Empty);
    let (x_mean, y_mean) = (mean(&x)?, mean(&y)?);
    let mut coefficients = Array2::zeros((n + 1, outputs));
    coefficients.row_mut(n).assign(&y_mean);
    if n == 0 || outputs == 0 {
        return Ok((coefficients, 0.0));
    }
    let a = Mat::from_fn(samples, n, |s, i| x[[s, i]] - x_mean[i]);
    let b = Mat::from_fn(samples, outputs, |s, t| y[[s, t]] - y_mean[t]);
    let svd = a.thin_svd().map_err(|_| ScalingError::NotConverged)?;
    let singular: Vec<f64> = svd.S().column_vector().iter().copied().collect();
    let projected = svd.U().transpose() * &b;
    let total = b.squared_norm_l2();
    let largest = singular.first().copied().unwrap_or(0.0);
    let shrink = |value: f64, ridge: f64| {
        if value > 0.0 {
            value * value / (value * value + ridge)
        } else {
            0.0
        }
    };
    let score = |ridge: f64| {
        let mut effective = 1.0;
        let mut residual = total;
        for (k, &value) in singular.iter().enumerate() {
            let kept = shrink(value, ridge);
            effective += kept;
            let power: f64 = (0..outputs).map(|t| projected[(k, t)].powi(2)).sum();
            residual -= power * (1.0 - (1.0 - kept).powi(2));
        }
        let free = samples as f64 - effective;
        // Rounding may make the residual negative where the fit is exact.
        if free > 0.5 {
            residual.max(f64::EPSILON * f64::EPSILON * total) / (free * free)
        } else {
            f64::INFINITY
        }
    };
    let grid = (-26..=2).map(|power| largest * largest * 10.0_f64.powi(power));
    let ridge = grid
        .min_by(|a, b| score(*a).total_cmp(&score(*b)))
        .unwrap_or(largest * largest);
    for i in 0..n {
        for t in 0..outputs {
            let parts = singular.iter().enumerate().filter(|(_, value)| **value > 0.0);
            coefficients[[i, t]] = parts
                .map(|(k, &value)| svd.V()[(i, k)] * shrink(value, ridge) / value * projected[(k, t)])
                .sum();
        }
    }
    let shift = x_mean.dot(&coefficients.slice_axis(Axis(0), Slice::from(..n)));
    let constant = &y_mean - &shift;
    coefficients.row_mut(n).assign(&constant);
    Ok((coefficients, ridge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use crate::scene::normal::standard_normal;

    #[test]
    fn an_affine_relation_is_found_and_noise_is_not_fitted() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let x = Array2::from_shape_simple_fn((60, 20), || standard_normal(&mut rng));
        let clean = Array2::from_shape_fn((60, 1), |(s, _)| 3.0 * x[[s, 0]] - x[[s, 5]] + 0.5);
        let (exact, _) = fit_ridge(x.view(), clean.view()).unwrap();
        assert!((exact[[0, 0]] - 3.0).abs() < 1e-8 && (exact[[5, 0]] + 1.0).abs() < 1e-8);
        assert!((exact[[20, 0]] - 0.5).abs() < 1e-8);
        // Pure noise: nearly everything is left out.
        let noise = Array2::from_shape_simple_fn((60, 1), || standard_normal(&mut rng));
        let (fitted, ridge) = fit_ridge(x.view(), noise.view()).unwrap();
        assert!(ridge > 1.0);
        assert!(fitted.iter().take(20).map(|c| c * c).sum::<f64>() < 0.2);
    }
}
