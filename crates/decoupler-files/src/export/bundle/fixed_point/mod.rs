//! Networks in fixed point: 16-bit weights and activations, 64-bit sums; where the products of a hidden layer nearly
//! cancel, its weights have 24 bits. Readings and outputs are 32-bit numbers of small units.
//!
//! Every number has a range that holds for all readings, because each step begins with a saturation; sums therefore
//! cannot overflow. The bound on the error is computed by interval analysis over the range of readings in training and
//! a tenth of it on either side.
//!
//! The decoder in fixed point performs the same steps as the C source.

mod quantise;
mod scaled;

use decoupler_core::network::Quantity;
use ndarray::Array2;
use thiserror::Error;

pub(super) use self::quantise::{FixedNetwork, FixedNetworks, USUAL_BOUND};
use crate::export::bundle::{
    exact::Twofold,
    layers::Layer,
    meaning::Meaning,
    portable::{ChannelRanges, Portable},
};
pub(super) use scaled::{CONDUCTANCE_BITS, HiddenWidth, LogTable, TangentTable};

/// Reasons why a network cannot be exported in fixed point.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FixedPointError {
    /// A decoder other than a network.
    #[error("fixed16 is for networks only: give --precision f64 or f32")]
    NoNetwork,
    /// The file does not contain the range of the readings.
    #[error(
        "fixed16 needs the range of the readings in training, which the network file does not have: train again, or give --precision f32"
    )]
    NoRange,
    /// Resistances that exceed 32 bits in every unit.
    #[error(
        "fixed16 reads resistances up to 1e9 ohm, and in training they were up to {0:.1e} ohm: give --precision f32"
    )]
    Reading(f64),
    /// Weights or outputs beyond the range of the numbers.
    #[error("fixed16 cannot hold {what}: {cure}, which keeps weights small, or give --precision f32")]
    Range {
        /// A way to train a network with smaller weights.
        cure: &'static str,
        /// Name of the value that is too large.
        what: &'static str,
    },
    /// An error bound that is too large.
    #[error(
        "in fixed point the error is only known to be below {bound:.3} times {scale}: {cure} (the network amplifies differences of its readings too much), or give --precision f32"
    )]
    Coarse {
        /// The bound, in proportion to the range.
        bound: f64,
        /// Name of the range.
        scale: &'static str,
        /// A way to train a network that amplifies less.
        cure: &'static str,
    },
}

/// A network of one hidden layer with the hyperbolic tangent.
#[derive(Clone, Copy, Debug)]
pub(in crate::export::bundle) struct TwoLayers<'a> {
    /// R₀ of each channel.
    pub(super) centre: &'a [f64],
    /// Channels × hidden nodes.
    pub(super) hidden_weights: &'a Array2<Twofold>,
    pub(super) hidden_biases: &'a [Twofold],
    /// Hidden nodes × outputs.
    pub(super) output_weights: &'a Array2<Twofold>,
    pub(super) output_biases: &'a [Twofold],
}

impl<'a> TwoLayers<'a> {
    /// The networks of `portable`; `None` if it is another decoder.
    pub(super) fn of(portable: &'a Portable) -> Option<Vec<Self>> {
        let maps = portable.maps.iter();
        maps.map(|map| match &map.layers[..] {
            [Layer::Affine(hidden), Layer::Tanh, Layer::Affine(output)] => Some(Self {
                centre: &map.centre,
                hidden_weights: &hidden.weights,
                hidden_biases: &hidden.biases,
                output_weights: &output.weights,
                output_biases: &output.biases,
            }),
            _ => None,
        })
        .collect()
    }

    /// Maximum magnitude of an output over all activations.
    pub(super) fn reach(&self, output: usize) -> f64 {
        let weights = self.output_weights.column(output);
        let of_weights: f64 = weights.iter().map(|weight| weight.to_f64().abs()).sum();
        self.output_biases[output].to_f64().abs() + of_weights
    }
}

impl FixedNetworks {
    /// Decodes readings in units: outputs in units, or `None` if a resistance is not above 0.
    pub(in crate::export::bundle) fn decode_whole(&self, network: usize, readings: &[i32]) -> Option<Vec<i32>> {
        let network = &self.networks[network];
        let channels = readings.len();
        let largest_change = i64::from(self.hidden_width.largest_change());
        let mut changes = Vec::new();
        for (channel, &reading) in readings.iter().enumerate() {
            if reading <= 0 && self.quantity != Quantity::Raw {
                return None;
            }
            let change = self.change(reading, network.centres[channel]);
            let scaled = shift(
                change * i64::from(network.factors[channel]),
                network.factor_shifts[channel],
            );
            changes.push(scaled.clamp(-largest_change, largest_change));
        }
        let mut activations = Vec::new();
        for (node, &bias) in network.hidden_biases.iter().enumerate() {
            let weights = &network.hidden_weights[node * channels..][..channels];
            let products = weights
                .iter()
                .zip(&changes)
                .map(|(&weight, change)| i64::from(weight) * change);
            let argument = shift(bias + products.sum::<i64>(), network.hidden_shifts[node]);
            let largest = i64::from(TangentTable::LARGEST);
            activations.push(i64::from(self.tangent.of(argument.clamp(-largest, largest) as i32)));
        }
        let hidden = activations.len();
        let outputs = network.output_biases.iter().enumerate().map(|(output, &bias)| {
            let weights = &network.output_weights[output * hidden..][..hidden];
            let products = weights
                .iter()
                .zip(&activations)
                .map(|(&weight, activation)| i64::from(weight) * activation);
            let sum = shift(bias + products.sum::<i64>(), network.output_shifts[output]);
            // Rounding the weights ensured that it fits.
            sum.clamp(i64::from(-i32::MAX), i64::from(i32::MAX)) as i32
        });
        Some(outputs.collect())
    }

    fn change(&self, reading: i32, centre: i32) -> i64 {
        match self.quantity {
            Quantity::Resistance | Quantity::Raw => i64::from(reading) - i64::from(centre),
            Quantity::Conductance => {
                let difference = i64::from(centre) - i64::from(reading);
                let relative = difference * (1_i64 << CONDUCTANCE_BITS) / i64::from(reading);
                relative.clamp(-(1 << 31), 1 << 31)
            }
            Quantity::LogResistance => i64::from(self.logarithm.of(reading)) - i64::from(centre),
        }
    }
}

/// value / 2^bits, rounded to the nearest, halves up.
fn shift(value: i64, bits: u8) -> i64 {
    if bits == 0 {
        return value;
    }
    (value + (1 << (bits - 1))) >> bits
}

/// Units of integers: each is 10^−`decimals` of the network's unit of the reading or output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::export::bundle) struct Units {
    decimals: Vec<i32>,
}

/// Upper bound of readings within their limits, which leaves a factor of 2 for readings outside.
const LARGEST_READING: f64 = (1_u32 << 30) as f64;
/// Number of units in the range of an output of own data: finer than a fixed-point network can resolve.
const OUTPUT_UNITS: f64 = 1e7;
/// Upper bound of outputs of own data for all activations: their sums fit with all bits of a weight.
const LARGEST_OUTPUT: f64 = (1_u32 << 24) as f64;

impl Units {
    /// Units of the readings. The readings of an array share one unit, which has a name.
    ///
    /// # Errors
    /// Resistances of an array are beyond all of these units.
    pub(super) fn of_readings(portable: &Portable, ranges: &[&ChannelRanges]) -> Result<Self, FixedPointError> {
        let largest = |channel: usize| {
            let limits = ranges.iter().map(|range| range.limits[channel]);
            limits.fold(0.0_f64, |largest, (low, high)| largest.max(low.abs()).max(high.abs()))
        };
        let channels = 0..portable.channels;
        let decimals = match portable.meaning {
            Meaning::Array(_) => {
                let largest_ohm = channels.map(largest).fold(0.0, f64::max);
                let fits = |&decimals: &i32| largest_ohm * ten_to(decimals) <= LARGEST_READING;
                let decimals = [9, 6, 3, 0].into_iter().find(fits);
                vec![decimals.ok_or(FixedPointError::Reading(largest_ohm))?; portable.channels]
            }
            Meaning::Own { .. } => channels
                .map(|channel| max_decimals(largest(channel), LARGEST_READING))
                .collect(),
        };
        Ok(Self { decimals })
    }

    /// Units of the outputs: nanometres for an array.
    pub(super) fn of_outputs(portable: &Portable, networks: &[TwoLayers<'_>]) -> Self {
        let decimals = match portable.meaning {
            Meaning::Array(_) => vec![6; portable.outputs],
            Meaning::Own { .. } => (0..portable.outputs)
                .map(|output| {
                    let reaches = networks.iter().map(|network| network.reach(output));
                    let reach = reaches.fold(0.0, f64::max);
                    max_decimals(portable.scales[output], OUTPUT_UNITS).min(max_decimals(reach, LARGEST_OUTPUT))
                })
                .collect(),
        };
        Self { decimals }
    }

    /// Number of units in 1.
    pub(in crate::export::bundle) fn per_one(&self, index: usize) -> f64 {
        ten_to(self.decimals[index])
    }

    /// Decimals of the first, and of all where they share one.
    pub(in crate::export::bundle) fn first_decimals(&self) -> i32 {
        self.decimals[0]
    }

    /// A unit in those of the network: 1e-6.
    pub(in crate::export::bundle) fn unit(&self, index: usize) -> f64 {
        ten_to(-self.decimals[index])
    }

    /// Every unit in those of the network.
    pub(in crate::export::bundle) fn all(&self) -> impl Iterator<Item = f64> {
        (0..self.decimals.len()).map(|index| self.unit(index))
    }

    /// Returns the value in units, limited to the largest number.
    pub(in crate::export::bundle) fn whole(&self, index: usize, value: f64) -> i32 {
        (value * self.per_one(index)).round() as i32
    }
}

/// Returns the maximum number of decimals with which `size` has at most `units` units.
fn max_decimals(size: f64, units: f64) -> i32 {
    /// Far within the range of double precision: units and their squares are finite.
    const MAX: f64 = 120.0;
    if size == 0.0 {
        return 0;
    }
    (units / size).log10().floor().clamp(-MAX, MAX) as i32
}

fn ten_to(decimals: i32) -> f64 {
    10.0_f64.powi(decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_as_small_as_the_range_of_the_numbers_allows() {
        for (size, units, expected) in [
            (1.0, 1e7, 7),
            (9.9, 1e7, 6),
            (1e9, LARGEST_READING, 0),
            (2e9, LARGEST_READING, -1),
            (3e-12, 1e7, 18),
            (0.0, 1e7, 0),
            (1e300, 1e7, -120),
        ] {
            assert_eq!(max_decimals(size, units), expected, "{size} {units}");
        }
    }
}
