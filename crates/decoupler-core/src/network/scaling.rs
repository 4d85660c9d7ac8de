use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::{ChannelNoise, NetworkError, Quantity};

/// Fraction of a channel's range by which a reading may be outside it: new samples of the same scene slightly exceed
/// the extremes of a few hundred samples, which does not deserve a warning.
pub(crate) const MARGIN: f64 = 0.1;
/// Relative rounding error allowed for a channel that is constant in the training set.
const ROUNDING: f64 = 1e-9;

/// Scaling of channels to [−1, 1] by their training minimum and maximum; constant channels are removed and restored.
///
/// Equivalent to `removeconstantrows` and `mapminmax` of the field's reference toolbox. The ranges of the readings also show
/// where a network extrapolates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MinMax {
    /// Smallest training value of each channel.
    minimum: Vec<f64>,
    /// Largest training value of each channel.
    maximum: Vec<f64>,
}

impl MinMax {
    /// Returns the ranges of `values` (samples × channels); `None` if there are no samples.
    pub fn of(values: ArrayView2<'_, f64>) -> Option<Self> {
        let extreme = |pick: fn(f64, f64) -> f64| -> Vec<f64> {
            let mut extreme = values.row(0).to_owned();
            for sample in values.rows() {
                extreme.zip_mut_with(&sample, |extreme, &value| *extreme = pick(*extreme, value));
            }
            extreme.to_vec()
        };
        (values.nrows() > 0).then(|| Self {
            minimum: extreme(f64::min),
            maximum: extreme(f64::max),
        })
    }

    /// Fits the ranges of `values` (samples × channels).
    ///
    /// # Errors
    /// If there are no samples, a value is not finite, or a range or its reciprocal overflows.
    pub fn fit(values: ArrayView2<'_, f64>) -> Result<Self, NetworkError> {
        NetworkError::check_finite(values)?;
        let fitted = Self::of(values).ok_or(NetworkError::Empty)?;
        for channel in 0..fitted.channels() {
            let (minimum, maximum) = fitted.extremes(channel);
            let half_width = 0.5 * (maximum - minimum);
            let is_wide = !(maximum - minimum).is_finite();
            if is_wide || minimum < maximum && !half_width.recip().is_finite() {
                return Err(NetworkError::Range {
                    channel,
                    minimum,
                    maximum,
                    is_wide,
                });
            }
        }
        Ok(fitted)
    }

    /// Number of channels, including constant ones.
    pub fn channels(&self) -> usize {
        self.minimum.len()
    }

    /// Returns `true` if there are as many minima as maxima, finite and in order, which a file does not guarantee.
    pub(super) fn is_valid(&self) -> bool {
        let mut pairs = self.minimum.iter().zip(&self.maximum);
        self.minimum.len() == self.maximum.len() && pairs.all(|(low, high)| low <= high && (high - low).is_finite())
    }

    /// Returns the indices of the channels that vary; a network sees only these.
    pub fn varying(&self) -> Vec<usize> {
        (0..self.channels())
            .filter(|&channel| self.minimum[channel] < self.maximum[channel])
            .collect()
    }

    /// Returns the smallest and largest training value of a channel.
    pub fn extremes(&self, channel: usize) -> (f64, f64) {
        (self.minimum[channel], self.maximum[channel])
    }

    /// Returns the channels whose value is outside the training range by more than the width of the range.
    pub fn far_outside<'a>(&'a self, values: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
        (0..self.channels()).filter(move |&channel| {
            let (low, high) = self.extremes(channel);
            let width = high - low;
            !(low - width..=high + width).contains(&values[channel])
        })
    }

    /// Returns the middle and half-width of a channel's range.
    fn range(&self, channel: usize) -> (f64, f64) {
        let half_width = 0.5 * (self.maximum[channel] - self.minimum[channel]);
        (self.minimum[channel] + half_width, half_width)
    }

    /// Scales physical values (samples × channels) to [−1, 1] (samples × varying channels).
    pub fn scale(&self, values: ArrayView2<'_, f64>) -> Array2<f64> {
        let varying = self.varying();
        let mut scaled = values.select(Axis(1), &varying);
        for (mut column, &channel) in scaled.columns_mut().into_iter().zip(&varying) {
            let (middle, half_width) = self.range(channel);
            column.mapv_inplace(|value| (value - middle) / half_width);
        }
        scaled
    }

    /// Returns the centre and matrix (varying channels × channels) of the scaling: scaled = matrix · (values − centre).
    pub(super) fn affine(&self) -> (Vec<f64>, Array2<f64>) {
        let varying = self.varying();
        let centre = (0..self.channels()).map(|channel| self.range(channel).0).collect();
        let mut matrix = Array2::zeros((varying.len(), self.channels()));
        for (k, &channel) in varying.iter().enumerate() {
            matrix[[k, channel]] = 1.0 / self.range(channel).1;
        }
        (centre, matrix)
    }

    /// Returns the middle and half-width of each channel's range; the middle of a constant channel is its exact value.
    pub(crate) fn middles_and_half_widths(&self) -> Vec<(f64, f64)> {
        (0..self.channels()).map(|channel| self.range(channel)).collect()
    }

    /// Converts scaled values (samples × varying channels) to physical ones (samples × channels), restoring constants.
    pub fn restore(&self, scaled: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut values = Array2::zeros((scaled.nrows(), self.channels()));
        for (mut column, &constant) in values.columns_mut().into_iter().zip(&self.minimum) {
            column.fill(constant);
        }
        for (column, &channel) in scaled.columns().into_iter().zip(&self.varying()) {
            let (middle, half_width) = self.range(channel);
            values
                .column_mut(channel)
                .assign(&column.mapv(|value| value * half_width + middle));
        }
        values
    }

    /// Returns the limits beyond which a reading of a channel counts as outside: the extremes, extended by a tenth of
    /// their distance. For resistances the distance is measured in logarithms, so that 1/R has the same limits.
    pub fn limits(&self, quantity: Quantity, channel: usize) -> (f64, f64) {
        self.limits_within(quantity, channel, MARGIN)
    }

    /// As [`Self::limits`], with the extremes extended by this share of their distance.
    pub(crate) fn limits_within(&self, quantity: Quantity, channel: usize, margin: f64) -> (f64, f64) {
        let (low, high) = self.extremes(channel);
        if quantity == Quantity::Raw {
            let margin = margin * (high - low) + ROUNDING * low.abs().max(high.abs());
            (low - margin, high + margin)
        } else {
            let factor = (high / low).powf(margin) * (1.0 + ROUNDING);
            (low / factor, high * factor)
        }
    }

    /// Returns the channels whose reading is outside, in order.
    pub fn outside<'a>(&'a self, quantity: Quantity, readings: &'a [f64]) -> impl Iterator<Item = usize> + 'a {
        (0..self.channels()).filter(move |&channel| {
            let (low, high) = self.limits(quantity, channel);
            !(low..=high).contains(&readings[channel])
        })
    }
}

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
    use ndarray::array;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::network::quantity::rounding;

    #[test]
    fn extremes_are_scaled_to_one_and_constants_are_restored() {
        let values = array![[1.0, 7.0, -3.0], [3.0, 7.0, 5.0], [2.0, 7.0, 1.0]];
        let scaling = MinMax::fit(values.view()).unwrap();
        assert_eq!(scaling.varying(), [0, 2]);
        let scaled = scaling.scale(values.view());
        assert_eq!(scaled, array![[-1.0, -1.0], [1.0, 1.0], [0.0, 0.0]]);
        assert_eq!(scaling.restore(scaled.view()), values);
    }

    #[test]
    fn far_outside_is_beyond_the_width_of_the_range() {
        let scaling = MinMax::fit(array![[4.0, 7.0], [5.0, 7.0]].view()).unwrap();
        let far = |first| scaling.far_outside(&[first, 7.0]).collect::<Vec<_>>();
        for near in [3.0, 4.5, 6.0] {
            assert!(far(near).is_empty(), "{near}");
        }
        for beyond in [2.9, 6.1, 1e308, f64::NAN] {
            assert_eq!(far(beyond), [0], "{beyond}");
        }
    }

    #[test]
    fn one_sample_has_only_constants() {
        let scaling = MinMax::fit(array![[1e-300, 1e300]].view()).unwrap();
        assert_eq!(scaling.scale(array![[1.0, 2.0]].view()).dim(), (1, 0));
        assert_eq!(scaling.restore(Array2::zeros((1, 0)).view()), array![[1e-300, 1e300]]);
    }

    #[test]
    fn values_that_cannot_be_scaled_are_named() {
        let nan = MinMax::fit(array![[1.0, 2.0], [1.0, f64::NAN]].view()).unwrap_err();
        assert!(matches!(
            nan,
            NetworkError::NotFinite {
                sample: 1,
                channel: 1,
                ..
            }
        ));
        let wide = MinMax::fit(array![[-1e308], [1e308]].view()).unwrap_err();
        assert!(matches!(
            wide,
            NetworkError::Range {
                channel: 0,
                is_wide: true,
                ..
            }
        ));
        let narrow = MinMax::fit(array![[1.0, 0.0], [2.0, 1e-309]].view()).unwrap_err();
        assert!(matches!(
            narrow,
            NetworkError::Range {
                channel: 1,
                is_wide: false,
                ..
            }
        ));
        assert!(MinMax::fit(array![[0.0], [1e-307]].view()).is_ok());
        assert_eq!(MinMax::fit(Array2::zeros((0, 3)).view()), Err(NetworkError::Empty));
    }

    #[test]
    fn a_reading_is_outside_beyond_a_tenth_of_the_range() {
        let range = MinMax::of(array![[10.0, -5.0], [40.0, 5.0], [20.0, 0.0]].view()).unwrap();
        assert_eq!((range.extremes(0), range.extremes(1)), ((10.0, 40.0), (-5.0, 5.0)));
        let outside = |quantity, first| range.outside(quantity, &[first, 0.0]).collect::<Vec<_>>();
        // 4^0.1 = 1.1487
        for inside in [10.0, 40.0, 8.8, 45.9] {
            assert!(
                range
                    .outside(Quantity::Resistance, &[inside, -5.0])
                    .all(|channel| channel == 1)
            );
        }
        for beyond in [8.6, 46.1, 1e300, 1e-300] {
            assert_eq!(outside(Quantity::Resistance, beyond)[0], 0, "{beyond}");
        }
        assert!(outside(Quantity::Raw, 42.9).is_empty());
        assert_eq!(outside(Quantity::Raw, 43.1), [0]);
        assert_eq!(range.outside(Quantity::Raw, &[20.0, -6.1]).collect::<Vec<_>>(), [1]);
    }

    #[test]
    fn resistances_and_their_conductances_have_the_same_limits() {
        let (low, high) = (3.0, 17.0);
        let of_resistance = MinMax::of(array![[low], [high]].view()).unwrap();
        let of_inverse = MinMax::of(array![[1.0 / low], [1.0 / high]].view()).unwrap();
        let (below, above) = of_resistance.limits(Quantity::Conductance, 0);
        let inverse = of_inverse.limits(Quantity::Conductance, 0);
        assert!((below * inverse.1 - 1.0).abs() < 1e-12 && (above * inverse.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_constant_channel_may_change_only_by_rounding() {
        let range = MinMax::of(array![[7.0]].view()).unwrap();
        let outside = |reading| range.outside(Quantity::LogResistance, &[reading]).count();
        assert_eq!((outside(7.0), outside(7.000_000_001), outside(7.001)), (0, 0, 1));
        assert_eq!(MinMax::of(ndarray::Array2::zeros((0, 2)).view()), None);
    }

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

    /// Compared with the mean in integers.
    #[test]
    fn the_mean_of_many_values_is_accurate_to_its_last_place() {
        const ONE: u64 = 1 << 52;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let units = Vec::from_iter((0..5001).map(|_| rng.random_range(ONE..2 * ONE)));
        let values = Array2::from_shape_fn((units.len(), 1), |(sample, _)| units[sample] as f64 / ONE as f64);
        let total: u128 = units.iter().map(|units| u128::from(*units)).sum();
        let mean = (total / units.len() as u128) as f64 / ONE as f64;
        let naive = values.column(0).iter().sum::<f64>() / units.len() as f64;
        let error = (fit(&values, 0.0).unwrap().mean[0] - mean).abs();
        assert!(
            error <= 2.0 * f64::EPSILON,
            "{error:e}, by a plain sum {:e}",
            naive - mean
        );
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
