use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::{NetworkError, Quantity};

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

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

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
}
