use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::Quantity;

/// Smallest and largest reading of each channel in training, beyond which a network extrapolates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadingRange {
    minimum: Vec<f64>,
    maximum: Vec<f64>,
}

/// Part of a channel's range by which a reading may leave it: new samples of the same scene go beyond the extremes of
/// some hundred samples a little, which is no extrapolation worth a warning.
const MARGIN: f64 = 0.1;
/// Relative rounding error allowed to a reading that did not vary in training.
const ROUNDING: f64 = 1e-9;

impl ReadingRange {
    /// Takes the range of readings (samples × channels). `None` if there are no samples.
    pub fn of(readings: ArrayView2<'_, f64>) -> Option<Self> {
        let extreme = |pick: fn(f64, f64) -> f64| {
            let columns = readings.columns().into_iter();
            columns
                .map(|column| column.iter().copied().reduce(pick))
                .collect::<Option<Vec<f64>>>()
        };
        Some(Self {
            minimum: extreme(f64::min)?,
            maximum: extreme(f64::max)?,
        })
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.minimum.len()
    }

    /// Smallest and largest reading of a channel in training.
    pub fn extremes(&self, channel: usize) -> (f64, f64) {
        (self.minimum[channel], self.maximum[channel])
    }

    /// Returns the limits beyond which a reading of a channel counts as outside: the extremes and a tenth of their
    /// distance, which for resistances is that of their logarithms, so that 1/R has the same limits.
    pub fn limits(&self, quantity: Quantity, channel: usize) -> (f64, f64) {
        let (low, high) = self.extremes(channel);
        if quantity == Quantity::Raw {
            let margin = MARGIN * (high - low) + ROUNDING * low.abs().max(high.abs());
            (low - margin, high + margin)
        } else {
            let factor = (high / low).powf(MARGIN) * (1.0 + ROUNDING);
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

    /// Returns `true` if the extremes, which may come from a file, are in order and of readings that `quantity` accepts.
    pub(super) fn is_sound(&self, quantity: Quantity, channels: usize) -> bool {
        let mut pairs = self.minimum.iter().zip(&self.maximum);
        (self.minimum.len(), self.maximum.len()) == (channels, channels)
            && pairs.all(|(&low, &high)| low <= high && quantity.accepts(low) && quantity.accepts(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_reading_is_outside_beyond_a_tenth_of_the_range() {
        let range = ReadingRange::of(array![[10.0, -5.0], [40.0, 5.0], [20.0, 0.0]].view()).unwrap();
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
        let of_resistance = ReadingRange::of(array![[low], [high]].view()).unwrap();
        let of_inverse = ReadingRange::of(array![[1.0 / low], [1.0 / high]].view()).unwrap();
        let (below, above) = of_resistance.limits(Quantity::Conductance, 0);
        let inverse = of_inverse.limits(Quantity::Conductance, 0);
        assert!((below * inverse.1 - 1.0).abs() < 1e-12 && (above * inverse.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_did_not_vary_must_stay_but_for_rounding() {
        let range = ReadingRange::of(array![[7.0]].view()).unwrap();
        let outside = |reading| range.outside(Quantity::LogResistance, &[reading]).count();
        assert_eq!((outside(7.0), outside(7.000_000_001), outside(7.001)), (0, 0, 1));
        assert_eq!(ReadingRange::of(ndarray::Array2::zeros((0, 2)).view()), None);
    }
}
