use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::frame::RowMap;
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, Quantity, ScalingError},
};

/// The affine map from scaled inputs to coordinates with a ridge penalty, whose size is chosen by generalised
/// cross-validation (Golub, Heath and Wahba 1979).
#[derive(Clone, Debug)]
pub struct RidgeMap {
    quantity: Quantity,
    /// What each channel is taken relative to.
    centre: Vec<f64>,
    /// Coordinates in millimetres from centred channels, the scalings folded in: M4 × varying coordinates.
    matrix: Array2<f64>,
    /// Every coordinate where all channels are at their centre.
    base_mm: Vec<f64>,
    /// Which coordinates vary.
    varying: Vec<usize>,
    ridge: f64,
    changes_mm: Vec<f64>,
}

impl RidgeMap {
    /// Fits to a training set; `noise` as in [`Inputs::fit`].
    ///
    /// # Errors
    /// Values that cannot be scaled.
    pub fn fit(training: &Dataset, choice: InputChoice, noise: f64) -> Result<Self, ScalingError> {
        let inputs = Inputs::fit(choice, training.resistances_ohm.view(), noise)?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let x = inputs.of(training.resistances_ohm.view());
        let y = outputs.scale(training.coordinates_mm.view());
        let (coefficients, ridge) = fit_ridge(x.view(), y.view())?;
        let (centre, to_inputs) = inputs.affine();
        let ranges = outputs.middles_and_half_widths();
        let varying = outputs.varying();
        let mut base_mm: Vec<f64> = ranges.iter().map(|range| range.0).collect();
        let n = inputs.count();
        let mut matrix = to_inputs.t().dot(&coefficients.slice_axis(Axis(0), Slice::from(..n)));
        for (output, &coordinate) in varying.iter().enumerate() {
            let half_width = ranges[coordinate].1;
            matrix.column_mut(output).mapv_inplace(|value| value * half_width);
            base_mm[coordinate] += coefficients[[n, output]] * half_width;
        }
        Ok(Self {
            quantity: inputs.quantity(),
            centre,
            matrix: matrix.as_standard_layout().into_owned(),
            base_mm,
            changes_mm: vec![0.0; varying.len()],
            varying,
            ridge,
        })
    }

    /// The penalty chosen, in units of squared singular values of the centred inputs.
    pub fn ridge(&self) -> f64 {
        self.ridge
    }
}

impl RowMap for RidgeMap {
    fn map(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) {
        self.changes_mm.fill(0.0);
        let width = self.changes_mm.len();
        let matrix = self.matrix.as_slice().expect("made in standard layout");
        for (channel, (&ohm, centre)) in readings_ohm.iter().zip(&self.centre).enumerate() {
            let value = self.quantity.of(ohm) - centre;
            let row = &matrix[channel * width..(channel + 1) * width];
            for (change, weight) in self.changes_mm.iter_mut().zip(row) {
                *change += value * weight;
            }
        }
        coordinates_mm.copy_from_slice(&self.base_mm);
        for (&coordinate, change) in self.varying.iter().zip(&self.changes_mm) {
            coordinates_mm[coordinate] += change;
        }
    }
}

/// Coefficients (inputs + 1 × outputs, the constant last) of the ridge regression of `y` on `x`, and the penalty with
/// the least generalised cross-validation error `‖residual‖² / (S − effective parameters)²` of a grid of powers of ten.
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
        // Rounding may leave a residual below 0 where the fit is exact.
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

    use crate::{
        dataset::{Seed, Stream},
        network::ScalingChoice,
        scene::{Scene, normal::standard_normal},
        sensor::SensorModel,
    };

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

    #[test]
    fn coordinates_that_are_affine_in_the_quantity_come_back() {
        let model = SensorModel::new("1x4_2x12".parse().unwrap());
        let mut rng = Seed(0).rng(Stream::Training);
        let mut set = Dataset::simulate(&model, &Scene::default(), 60, &mut rng).unwrap();
        for (mut coordinates, readings) in set
            .coordinates_mm
            .rows_mut()
            .into_iter()
            .zip(set.resistances_ohm.rows())
        {
            coordinates[2] = 4.0 + 20.0 / readings[3] - 7.0 / readings[8];
        }
        for choice in [
            InputChoice::BEST,
            InputChoice {
                scaling: ScalingChoice::MinMax,
                ..InputChoice::BEST
            },
        ] {
            let mut map = RidgeMap::fit(&set, choice, 0.0).unwrap();
            let mut answer = [0.0; 12];
            for (readings, truth) in set.resistances_ohm.rows().into_iter().zip(set.coordinates_mm.rows()) {
                map.map(&readings.to_vec(), &mut answer);
                assert_eq!(answer[0], truth[0], "what does not vary stays");
                assert!((answer[2] - truth[2]).abs() < 1e-6, "{} {}", answer[2], truth[2]);
            }
        }
    }
}
