use ndarray::{Array2, ArrayView1, ArrayView2, CowArray, Ix2};
use serde::{Deserialize, Serialize};

use crate::{numerics::root_mean_square, text::Named};

use super::NetworkError;

/// Quantity computed from a resistance R as the input of a decoder.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, strum::Display, strum::IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// R in ohm, as in the paper.
    #[default]
    Resistance,
    /// 1/R in siemens. By Eq. (2) it is a plain sum over nodes, and so the most nearly linear in the deformation.
    Conductance,
    /// ln R, in which relative errors are additive.
    #[strum(serialize = "log")]
    LogResistance,
    /// The reading itself, in any unit and with any sign, for measured data other than resistances.
    Raw,
}

/// Largest relative error of a resistance towards 0, so that it stays above 0.
const MAX_RELATIVE_ERROR: f64 = 1.0 - 1e-6;

impl Quantity {
    /// All quantities of a resistance, in the order offered to the user.
    pub const ALL: [Self; 3] = [Self::Resistance, Self::Conductance, Self::LogResistance];

    /// Returns the value for a resistance in ohm.
    pub fn of(self, resistance_ohm: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => resistance_ohm,
            Self::Conductance => 1.0 / resistance_ohm,
            Self::LogResistance => resistance_ohm.ln(),
        }
    }

    /// Returns the values for resistances in ohm, without a copy if they are the same.
    pub(crate) fn of_all(self, resistances_ohm: ArrayView2<'_, f64>) -> CowArray<'_, f64, Ix2> {
        match self {
            Self::Resistance | Self::Raw => resistances_ohm.into(),
            Self::Conductance | Self::LogResistance => resistances_ohm.mapv(|ohm| self.of(ohm)).into(),
        }
    }

    /// Returns the readings for which the quantity is defined: any finite number if raw, otherwise a finite number above 0.
    pub fn domain(self) -> Domain {
        match self {
            Self::Raw => Domain::Finite,
            Self::Resistance | Self::Conductance | Self::LogResistance => Domain::Positive,
        }
    }

    /// Returns `true` if the quantity is defined for a reading.
    #[inline(always)]
    pub fn accepts(self, reading: f64) -> bool {
        self.domain().contains(reading)
    }

    /// Checks that the quantity is defined for all readings (samples × channels).
    ///
    /// # Errors
    /// At the first reading for which it is not.
    pub(crate) fn check(self, readings: ArrayView2<'_, f64>) -> Result<(), NetworkError> {
        match readings.indexed_iter().find(|(_, value)| !self.accepts(**value)) {
            Some(((sample, channel), &value)) => Err(NetworkError::Reading { sample, channel, value }),
            None => Ok(()),
        }
    }

    /// Returns the resistance in ohm for a value, the inverse of [`Self::of`].
    pub fn resistance_ohm(self, value: f64) -> f64 {
        match self {
            Self::Resistance | Self::Raw => value,
            Self::Conductance => 1.0 / value,
            Self::LogResistance => value.exp(),
        }
    }

    /// Returns the standard deviation of the value for a reading with standard deviation `deviation_ohm`: a third of
    /// the change caused by three standard deviations towards 0. For small errors it is |d value / d R| · deviation. It
    /// is large for a conductance whose resistance may be read as almost 0.
    pub fn deviation(self, resistance_ohm: f64, deviation_ohm: f64) -> f64 {
        let three = (3.0 * deviation_ohm / resistance_ohm).min(MAX_RELATIVE_ERROR);
        match self {
            Self::Resistance | Self::Raw => deviation_ohm,
            Self::Conductance => three / (1.0 - three) / (3.0 * resistance_ohm),
            Self::LogResistance => -(-three).ln_1p() / 3.0,
        }
    }
}

/// Numbers that are accepted as readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Domain {
    /// Any finite number.
    Finite,
    /// A finite number above 0.
    Positive,
}

impl Domain {
    /// `true` for numbers of the domain.
    #[inline(always)]
    pub fn contains(self, value: f64) -> bool {
        let above = match self {
            Self::Finite => f64::NEG_INFINITY,
            Self::Positive => 0.0,
        };
        (value > above) & (value < f64::INFINITY)
    }
}

impl Named for Quantity {
    const WHAT: &'static str = "an input";
    const ALL: &'static [Self] = &Quantity::ALL;
}

/// Rounding error of a reading in units in the last place, from computing the resistance and from the arithmetic that
/// follows.
const LAST_PLACES: f64 = 4.0;

/// Returns the standard deviation that rounding can cause in each channel of `readings` (samples × channels), in the
/// unit of the readings: that of the last digits or, where all readings of a channel are multiples of a converter step
/// or of a printed decimal, that of a single sample one step off (for few samples, that of rounding itself, step/√12).
pub(super) fn rounding(readings: ArrayView2<'_, f64>) -> Vec<f64> {
    let of_channel = |channel: ArrayView1<'_, f64>| {
        let digits = LAST_PLACES * f64::EPSILON * root_mean_square(channel.iter().map(|value| value.abs()));
        digits.max(step(channel).unwrap_or(0.0) / (channel.len() as f64).max(12.0).sqrt())
    };
    readings.columns().into_iter().map(of_channel).collect()
}

/// Returns the step of which the values of a channel are integer multiples, up to a common offset.
fn step(channel: ArrayView1<'_, f64>) -> Option<f64> {
    /// Tolerance in steps for an integer multiple; one value in 500 is that close by chance.
    const TOLERANCE: f64 = 1e-3;
    /// Minimum number of distinct values that are unlikely to be integer multiples by chance.
    const MIN_VALUES: usize = 4;
    let mut values = channel.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let repeats = channel.len() - values.len();
    let (&lowest, &highest) = (values.first()?, values.last()?);
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
    let step = gaps.min_by(f64::total_cmp)?;
    // Readings that never repeat have steps too fine to matter, or too few values to be sure of the step.
    if values.len() < MIN_VALUES && repeats == 0 {
        return None;
    }
    let rounding = LAST_PLACES * f64::EPSILON * lowest.abs().max(highest.abs());
    let is_whole = |value: &f64| {
        let steps = (value - lowest) / step;
        (steps - steps.round()).abs() < TOLERANCE
    };
    (rounding < TOLERANCE * step && values.iter().all(is_whole)).then_some(step)
}

/// Errors of the values of each channel: standard deviations in the unit of the values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ChannelNoise {
    /// Independent error of each channel.
    pub own: Vec<f64>,
    /// Error common to all channels, with the same sign in each: a drift.
    pub common: Vec<f64>,
}

impl ChannelNoise {
    /// Returns the noise of channels without errors.
    pub fn none(channels: usize) -> Self {
        Self {
            own: vec![0.0; channels],
            common: vec![0.0; channels],
        }
    }

    /// Returns the changes of the values times `scale` caused by one standard deviation of each source (sources × channels):
    /// the error of each channel that has one, and the common error.
    pub(crate) fn changes(&self, scale: &[f64]) -> Array2<f64> {
        let own: Vec<usize> = (0..scale.len()).filter(|&channel| self.own[channel] > 0.0).collect();
        let has_common = self.common.iter().any(|&deviation| deviation > 0.0);
        let sources = own.len() + usize::from(has_common);
        Array2::from_shape_fn((sources, scale.len()), |(source, channel)| match own.get(source) {
            Some(&of) if of == channel => self.own[channel] * scale[channel],
            Some(_) => 0.0,
            None => self.common[channel] * scale[channel],
        })
    }

    /// Returns the variance of the error of Σ weight · value.
    pub fn variance(&self, weights: impl IntoIterator<Item = f64>) -> f64 {
        let (mut own, mut common) = (0.0, 0.0);
        for (weight, (of_own, of_common)) in weights.into_iter().zip(self.own.iter().zip(&self.common)) {
            own += (weight * of_own).powi(2);
            common += weight * of_common;
        }
        own + common * common
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    #[test]
    fn each_quantity_can_be_inverted_and_parsed() {
        for quantity in Quantity::ALL {
            for ohm in [1e-3, 21.7, 4.2e5] {
                assert!((quantity.resistance_ohm(quantity.of(ohm)) / ohm - 1.0).abs() < 1e-14);
                for relative in [1e-9, 1e-3, 0.1] {
                    let change = quantity.of(ohm * (1.0 - 3.0 * relative)) - quantity.of(ohm);
                    let ratio = quantity.deviation(ohm, relative * ohm) / (change.abs() / 3.0);
                    assert!((ratio - 1.0).abs() < 1e-6, "{quantity:?} {relative}: {ratio}");
                }
                let hidden = quantity.deviation(ohm, 1e300);
                assert!(hidden.is_finite() && hidden > quantity.deviation(ohm, 0.3 * ohm));
            }
            assert_eq!(Quantity::parse(quantity.name()), Ok(quantity));
        }
        assert!(Quantity::parse("ohm").unwrap_err().to_string().contains("conductance"));
    }

    #[test]
    fn steps_of_a_converter_and_decimals_are_found_and_others_are_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let draw: Vec<f64> = (0..200).map(|_| rng.random_range(20.0..45.0)).collect();
        let step_ohm = 91.8 / 64.0;
        let readings = Array2::from_shape_fn((200, 4), |(sample, channel)| match channel {
            0 => draw[sample],
            1 => (draw[sample] / step_ohm).round() * step_ohm,
            2 => format!("{:.1}", draw[sample]).parse().unwrap(),
            _ => 31.7,
        });
        let found = rounding(readings.view());
        let expected = [0.0, step_ohm / 200.0_f64.sqrt(), 0.1 / 200.0_f64.sqrt(), 0.0];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            assert!(found > 0.0);
        }
    }

    #[test]
    fn one_sample_one_step_off_is_the_most_that_rounding_explains() {
        for off in [1, 2] {
            let readings = Array2::from_shape_fn((100, 1), |(sample, _)| 31.0 + if sample < off { 0.25 } else { 0.0 });
            let deviation = readings.std(0.0);
            assert_eq!(rounding(readings.view())[0] > deviation, off == 1, "{off}");
        }
    }

    #[test]
    fn few_or_no_samples_have_no_steps() {
        for samples in 0..4 {
            let readings = Array2::from_shape_fn((samples, 1), |(sample, _)| 3.0 + (sample as f64).sqrt());
            assert!(rounding(readings.view())[0] < 1e-14);
        }
    }

    #[test]
    fn the_variance_of_a_sum_is_that_of_samples() {
        let noise = ChannelNoise {
            own: vec![0.1, 0.4, 0.0],
            common: vec![0.2, 0.3, -0.5],
        };
        let weights = [1.0, -2.0, 0.5];
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let draws = 40_000;
        let squares: f64 = (0..draws)
            .map(|_| {
                let drift = standard_normal(&mut rng);
                let error = |c: usize, own: f64| weights[c] * (noise.own[c] * own + noise.common[c] * drift);
                let sum: f64 = (0..3).map(|c| error(c, standard_normal(&mut rng))).sum();
                sum * sum
            })
            .sum();
        let ratio = noise.variance(weights) / (squares / f64::from(draws));
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
}
