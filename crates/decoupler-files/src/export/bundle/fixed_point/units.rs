use super::{FixedPointError, two_layers::TwoLayers};
use crate::export::bundle::{
    meaning::Meaning,
    portable::{ChannelRanges, Portable},
};

/// Units of whole numbers: each is 10^−`decimals` of the unit in which the network has the reading or the output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::export::bundle) struct Units {
    decimals: Vec<i32>,
}

/// Size that readings within their limits stay below, so that those outside have a factor of 2.
const LARGEST_READING: f64 = (1_u32 << 30) as f64;
/// Units in the range of an output of own data: more than a network in whole numbers can tell.
const OUTPUT_UNITS: f64 = 1e7;
/// Size that outputs of own data stay below whatever the activations, so that their sums fit with all bits of a weight.
const LARGEST_OUTPUT: f64 = (1_u32 << 24) as f64;

impl Units {
    /// Units of the readings. Those of an array share one, with a name of its own.
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

    /// The value in units, at most the largest number.
    pub(in crate::export::bundle) fn whole(&self, index: usize, value: f64) -> i32 {
        (value * self.per_one(index)).round() as i32
    }
}

/// Most decimals with which `size` has at most `units` units.
fn max_decimals(size: f64, units: f64) -> i32 {
    /// Far within the range of double precision, so that units and their squares are numbers.
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
    fn units_are_as_small_as_the_numbers_allow() {
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
