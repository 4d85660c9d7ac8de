use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::{ChannelNoise, NetworkError};

/// Noise-aware whitening: principal components of the training values, each divided by √(σ² + noise²), where σ² is the
/// component's variance and noise² the variance that noise adds to it.
///
/// A weak component above the noise counts as much as the strongest. A component whose variance is no larger than that
/// of the noise, or of the rounding of the values, is left out: a fit to noise-free values would use it, and would then
/// amplify noise to the size of the signal, or by many more orders of magnitude where the component is only rounding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Whitening {
    /// Mean of each channel.
    mean: Vec<f64>,
    /// √(σ² + noise²) of each component.
    deviations: Vec<f64>,
    /// Orthonormal directions of the components: components × channels, row by row.
    directions: Vec<f64>,
}

impl Whitening {
    /// Fits the components of `values` (samples × channels).
    ///
    /// `rounding` is the standard deviation of the rounding error in each channel of `values`, and `unseen` the noise
    /// of later values that `values` lack. At most `max_components` components are kept, the strongest.
    ///
    /// # Errors
    /// If there are no samples, or a value is not finite.
    ///
    /// # Panics
    /// If `rounding` or `unseen` do not have one entry per channel.
    pub fn fit(
        values: ArrayView2<'_, f64>,
        rounding: &[f64],
        unseen: &ChannelNoise,
        max_components: usize,
    ) -> Result<Self, NetworkError> {
        let (samples, channels) = values.dim();
        assert_eq!([rounding.len(), unseen.own.len(), unseen.common.len()], [channels; 3]);
        let Some(mean) = values.mean_axis(Axis(0)) else {
            return Err(NetworkError::Empty);
        };
        NetworkError::check_finite(values)?;
        // The mean of many samples has a rounding error; adding the mean of the small residuals removes most of it.
        let rest = (&values - &mean).mean_axis(Axis(0)).expect("there are samples");
        let mean = mean + rest;
        // Uses the singular values of the centred samples instead of the eigenvalues of their covariance, because
        // squaring would lose components 1e-8 times weaker than the first. R of a QR decomposition has the same
        // singular values and is small.
        let centred = Mat::from_fn(samples, channels, |s, c| values[[s, c]] - mean[c]);
        let triangle = if samples > channels {
            centred.qr().thin_R().to_owned()
        } else {
            centred
        };
        let svd = triangle.thin_svd().map_err(|_| NetworkError::NotConverged)?;
        let singular = svd.S().column_vector();
        let root = (samples as f64).sqrt();
        // Rounding errors of the decomposition (Golub and Van Loan, Matrix Computations, section 5.5.8).
        let decomposition = f64::EPSILON * samples.min(channels) as f64 * singular.iter().copied().fold(0.0, f64::max);
        let (mut directions, mut deviations) = (Vec::new(), Vec::new());
        for (k, &value) in singular.iter().enumerate().take(max_components) {
            let direction = || (0..channels).map(|c| svd.V()[(c, k)]);
            let of_rounding: f64 = direction().zip(rounding).map(|(v, error)| (v * error).powi(2)).sum();
            let (variance, of_noise) = ((value / root).powi(2), unseen.variance(direction()));
            let deviation = (variance + of_noise).sqrt();
            if value > decomposition && variance > of_rounding + of_noise && deviation.is_finite() {
                directions.extend(direction());
                deviations.push(deviation);
            }
        }
        Ok(Self {
            mean: mean.to_vec(),
            deviations,
            directions,
        })
    }

    /// Number of channels of the values.
    pub fn channels(&self) -> usize {
        self.mean.len()
    }

    /// Number of components, which are the inputs of a network.
    pub fn components(&self) -> usize {
        self.deviations.len()
    }

    /// Returns the mean of the channels and the matrix (components × channels) that whitens centred values.
    pub(super) fn affine(&self) -> (Vec<f64>, Array2<f64>) {
        let (components, channels) = (self.components(), self.channels());
        let matrix = Array2::from_shape_fn((components, channels), |(k, c)| {
            self.directions[k * channels + c] / self.deviations[k]
        });
        (self.mean.clone(), matrix)
    }

    /// Whitens values: samples × channels to samples × components.
    pub fn scale(&self, values: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut centred = values.to_owned();
        for (mut column, mean) in centred.columns_mut().into_iter().zip(&self.mean) {
            column.mapv_inplace(|value| value - mean);
        }
        centred.dot(&self.affine().1.t())
    }

    /// Returns `true` if the parts are finite and of sizes that fit, which a file does not guarantee.
    pub(super) fn is_valid(&self) -> bool {
        let mut numbers = self.mean.iter().chain(&self.deviations).chain(&self.directions);
        Some(self.directions.len()) == self.components().checked_mul(self.channels())
            && numbers.all(|number| number.is_finite())
            && self.deviations.iter().all(|deviation| *deviation > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::quantity::rounding;
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

    fn fit(values: &Array2<f64>, noise: f64) -> Result<Whitening, NetworkError> {
        let channels = values.ncols();
        let unseen = ChannelNoise {
            own: vec![noise; channels],
            ..ChannelNoise::none(channels)
        };
        Whitening::fit(values.view(), &rounding(values.view()), &unseen, usize::MAX)
    }

    #[test]
    fn components_are_uncorrelated_with_unit_variance() {
        let values = correlated(500);
        let whitening = fit(&values, 0.0).unwrap();
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
    fn components_below_the_noise_are_left_out_and_those_near_it_are_scaled_down() {
        let values = correlated(500);
        let spread = |noise: f64| -> Vec<f64> {
            let white = fit(&values, noise).unwrap().scale(values.view());
            let deviation = |column: ndarray::ArrayView1<'_, f64>| (column.dot(&column) / 500.0).sqrt();
            white.columns().into_iter().map(deviation).collect()
        };
        let third = fit(&values, 0.0).unwrap().deviations[2];
        let veiled = spread(0.75 * third);
        assert!(veiled[0] > 0.999 && veiled[1] > 0.999);
        // 1 / √(1 + 0.75²) = 0.8
        assert!((veiled[2] - 0.8).abs() < 1e-3, "{veiled:?}");
        assert_eq!(spread(1.5 * third).len(), 2);
        assert_eq!(spread(1e-4).len(), 2);
        assert_eq!(spread(1e-2).len(), 1);
        assert_eq!(spread(10.0).len(), 0);
    }

    #[test]
    fn a_drift_hides_only_the_direction_in_which_it_moves_the_readings() {
        let values = correlated(500);
        let unseen = ChannelNoise {
            common: vec![1.0, 2.0, 1.0, 0.0],
            ..ChannelNoise::none(4)
        };
        let whitening = Whitening::fit(values.view(), &rounding(values.view()), &unseen, usize::MAX).unwrap();
        let deviations = &whitening.deviations;
        assert_eq!(
            deviations.len(),
            2,
            "the first component is the direction of the drift: {deviations:?}"
        );
    }

    /// Channels quantised by a converter have exact linear dependencies in the training set that a new sample need not
    /// satisfy.
    #[test]
    fn new_quantised_readings_stay_as_large_as_the_training_set() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut draw = |samples: usize| {
            let mut values = Array2::zeros((samples, 12));
            for mut row in values.rows_mut() {
                let [a, b]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                for (channel, value) in row.iter_mut().enumerate() {
                    let place = channel as f64 / 12.0;
                    let exact: f64 = 30.0 + a * (1.0 - place) + b * (0.3 + place * place);
                    *value = (exact / 0.7).round() * 0.7;
                }
            }
            values
        };
        for samples in [10, 40, 200] {
            let whitening = fit(&draw(samples), 0.0).unwrap();
            let white = whitening.scale(draw(2000).view());
            let largest = white.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
            assert!(largest < 30.0, "{samples}: {largest}");
        }
    }

    #[test]
    fn whitenings_survive_a_file_and_damaged_ones_are_rejected() {
        let whitening = fit(&correlated(20), 0.0).unwrap();
        let text = serde_json::to_string(&whitening).unwrap();
        assert_eq!(serde_json::from_str::<Whitening>(&text).unwrap(), whitening);
        for damaged in [
            r#"{"mean":[0.0,1.0],"deviations":[1.0],"directions":[1.0]}"#,
            r#"{"mean":[0.0],"deviations":[0.0],"directions":[1.0]}"#,
        ] {
            assert!(
                !serde_json::from_str::<Whitening>(damaged).unwrap().is_valid(),
                "{damaged}"
            );
        }
    }

    #[test]
    fn one_sample_or_none() {
        let one = fit(&correlated(1), 0.0).unwrap();
        assert_eq!(one.components(), 0);
        assert_eq!(fit(&Array2::zeros((0, 2)), 0.0), Err(NetworkError::Empty));
    }
}
