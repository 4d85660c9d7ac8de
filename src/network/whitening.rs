use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::ScalingError;

/// Noise-aware whitening: principal components of the training values, each divided by √(σ² + noise²), where σ² is the
/// component's variance and noise² the variance that noise adds to it.
///
/// A weak component that is still above the noise counts as much as the strongest; components hidden by noise stay
/// small.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Record", into = "Record")]
pub struct Whitening {
    /// Mean of each channel.
    mean: Vec<f64>,
    /// Components × channels, orthonormal rows.
    directions: Array2<f64>,
    /// √(σ² + noise²) of each component.
    deviations: Vec<f64>,
}

/// Components weaker than this relative to the first are rounding errors of the readings, not signals.
const ROUNDING: f64 = 1e-13;

impl Whitening {
    /// Fits the components of `values` (samples × channels).
    ///
    /// `noise` is the standard deviation of independent noise added to later values, one per channel; zero where
    /// `values` already contain their noise.
    ///
    /// # Errors
    /// If there are no samples, or a value is not finite.
    ///
    /// # Panics
    /// If `noise` does not have one entry per channel.
    pub fn fit(values: ArrayView2<'_, f64>, noise: &[f64]) -> Result<Self, ScalingError> {
        let (samples, channels) = values.dim();
        assert_eq!(noise.len(), channels);
        let Some(mean) = values.mean_axis(Axis(0)) else {
            return Err(ScalingError::Empty);
        };
        if let Some(((sample, channel), &value)) = values.indexed_iter().find(|(_, value)| !value.is_finite()) {
            return Err(ScalingError::NotFinite { sample, channel, value });
        }
        // Uses the singular values of the centred samples instead of the eigenvalues of their covariance, because
        // squaring would lose components 1e-8 times weaker than the first. R of a QR decomposition has the same
        // singular values and is small.
        let centred = Mat::from_fn(samples, channels, |s, c| values[[s, c]] - mean[c]);
        let triangle = if samples > channels {
            centred.qr().thin_R().to_owned()
        } else {
            centred
        };
        let svd = triangle.thin_svd().map_err(|_| ScalingError::NotConverged)?;
        let singular: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let root = (samples as f64).sqrt();
        let largest = singular.first().copied().unwrap_or(0.0);
        let kept = singular.iter().take_while(|&&value| value > ROUNDING * largest).count();
        let directions = Array2::from_shape_fn((kept, channels), |(k, c)| svd.V()[(c, k)]);
        let deviation = |k: usize| {
            let added: f64 = (0..channels).map(|c| (directions[[k, c]] * noise[c]).powi(2)).sum();
            ((singular[k] / root).powi(2) + added).sqrt()
        };
        Ok(Self {
            mean: mean.to_vec(),
            deviations: (0..kept).map(deviation).collect(),
            directions,
        })
    }

    /// Number of channels of the values.
    pub fn channels(&self) -> usize {
        self.mean.len()
    }

    /// Number of components, the inputs of a network.
    pub fn components(&self) -> usize {
        self.deviations.len()
    }

    /// Mean of each channel.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Returns the matrix (components × channels) that whitens centred values.
    pub fn matrix(&self) -> Array2<f64> {
        Array2::from_shape_fn(self.directions.dim(), |(k, c)| {
            self.directions[[k, c]] / self.deviations[k]
        })
    }

    /// Whitens values: samples × channels to samples × components.
    pub fn scale(&self, values: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut centred = values.to_owned();
        for (mut column, mean) in centred.columns_mut().into_iter().zip(&self.mean) {
            column.mapv_inplace(|value| value - mean);
        }
        centred.dot(&self.matrix().t())
    }

    /// Converts whitened values (samples × components) back to values (samples × channels).
    pub fn restore(&self, whitened: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut values = Array2::zeros((whitened.nrows(), self.channels()));
        for (mut row, whitened) in values.rows_mut().into_iter().zip(whitened.rows()) {
            for (channel, value) in row.iter_mut().enumerate() {
                let parts =
                    (0..self.components()).map(|k| whitened[k] * self.deviations[k] * self.directions[[k, channel]]);
                *value = self.mean[channel] + parts.sum::<f64>();
            }
        }
        values
    }
}

/// File format of a whitening.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    mean: Vec<f64>,
    deviations: Vec<f64>,
    /// Components × channels, row by row.
    directions: Vec<f64>,
}

impl From<Whitening> for Record {
    fn from(whitening: Whitening) -> Self {
        Self {
            mean: whitening.mean,
            deviations: whitening.deviations,
            directions: whitening.directions.iter().copied().collect(),
        }
    }
}

impl TryFrom<Record> for Whitening {
    type Error = ScalingError;

    fn try_from(record: Record) -> Result<Self, ScalingError> {
        let Record {
            mean,
            deviations,
            directions,
        } = record;
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let sound = finite(&mean) && finite(&directions) && finite(&deviations) && deviations.iter().all(|&d| d > 0.0);
        let directions = Array2::from_shape_vec((deviations.len(), mean.len()), directions);
        match directions {
            Ok(directions) if sound => Ok(Self {
                mean,
                directions,
                deviations,
            }),
            _ => Err(ScalingError::Damaged),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    fn correlated(samples: usize) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut values = Array2::zeros((samples, 4));
        for mut row in values.rows_mut() {
            let [a, b, c]: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            row[0] = 100.0 + a;
            row[1] = 50.0 + 2.0 * a + 1e-3 * b;
            row[2] = -7.0 + a - 1e-3 * b + 1e-6 * c;
            row[3] = 3.0;
        }
        values
    }

    #[test]
    fn components_are_uncorrelated_with_unit_variance() {
        let values = correlated(500);
        let whitening = Whitening::fit(values.view(), &[0.0; 4]).unwrap();
        assert_eq!(whitening.components(), 3, "the constant channel adds none");
        let white = whitening.scale(values.view());
        for i in 0..3 {
            for j in 0..3 {
                let product = white.column(i).dot(&white.column(j)) / 500.0;
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-6, "{i} {j}: {product}");
            }
        }
    }

    #[test]
    fn whitening_can_be_undone() {
        let values = correlated(60);
        let whitening = Whitening::fit(values.view(), &[0.1; 4]).unwrap();
        let back = whitening.restore(whitening.scale(values.view()).view());
        for (ours, truth) in back.iter().zip(&values) {
            assert!((ours - truth).abs() < 1e-11, "{ours} {truth}");
        }
    }

    #[test]
    fn what_noise_hides_stays_small() {
        let values = correlated(500);
        let white = Whitening::fit(values.view(), &[1e-4; 4]).unwrap().scale(values.view());
        let deviation = |k: usize| (white.column(k).dot(&white.column(k)) / 500.0).sqrt();
        assert!(deviation(0) > 0.99);
        assert!(deviation(1) > 0.9);
        assert!(deviation(2) < 0.02);
    }

    #[test]
    fn files_come_back_and_damaged_ones_are_refused() {
        let whitening = Whitening::fit(correlated(20).view(), &[0.0; 4]).unwrap();
        let text = serde_json::to_string(&whitening).unwrap();
        assert_eq!(serde_json::from_str::<Whitening>(&text).unwrap(), whitening);
        for damaged in [
            r#"{"mean":[0.0,1.0],"deviations":[1.0],"directions":[1.0]}"#,
            r#"{"mean":[0.0],"deviations":[0.0],"directions":[1.0]}"#,
        ] {
            assert!(serde_json::from_str::<Whitening>(damaged).is_err(), "{damaged}");
        }
    }

    #[test]
    fn one_sample_or_none() {
        let one = Whitening::fit(correlated(1).view(), &[0.0; 4]).unwrap();
        assert_eq!(one.components(), 0);
        assert_eq!(
            Whitening::fit(Array2::zeros((0, 2)).view(), &[0.0; 2]),
            Err(ScalingError::Empty)
        );
    }
}
