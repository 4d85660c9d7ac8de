use crate::export::bundle::{exported_program::Limits, meaning::Meaning, report::BundleError};

/// Units of integers: each is 10^−`decimals` of the decoder's unit of the reading or target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::export::bundle) struct Units {
    pub(super) decimals: Vec<i32>,
}

/// Upper bound of readings within their limits, which leaves a factor of 2 for readings outside.
const LARGEST_READING: f64 = (1_u32 << 30) as f64;
/// Number of units in the range of a target of own data: finer than fixed point can resolve.
const TARGET_UNITS: f64 = 1e7;
/// Upper bound of targets of own data for all activations: their sums fit with all bits of a weight.
const LARGEST_TARGET: f64 = (1_u32 << 24) as f64;

impl Units {
    /// Units of the readings. The readings of an array share one unit, which has a name.
    ///
    /// # Errors
    /// Resistances of an array are beyond all of these units.
    pub(super) fn of_readings(meaning: &Meaning, limits: &Limits) -> Result<Self, BundleError> {
        let largest = |channel: usize| {
            let limits = limits.iter().map(|of_row| of_row[channel]);
            limits.fold(0.0_f64, |largest, (low, high)| largest.max(low.abs()).max(high.abs()))
        };
        let channels = 0..limits[0].len();
        let decimals = if meaning.is_array {
            let largest_ohm = channels.clone().map(largest).fold(0.0, f64::max);
            let fits = |&decimals: &i32| largest_ohm * ten_to(decimals) <= LARGEST_READING;
            let decimals = [9, 6, 3, 0].into_iter().find(fits).ok_or_else(|| {
                BundleError::Unsuitable(format!(
                    "fixed16 reads resistances up to 1e9 ohm, and in training they were up to {largest_ohm:.1e} ohm: choose \
                     precision f32"
                ))
            });
            vec![decimals?; channels.len()]
        } else {
            channels
                .map(|channel| max_decimals(largest(channel), LARGEST_READING))
                .collect()
        };
        Ok(Self { decimals })
    }

    /// Units of the targets: nanometres for an array; `reach` is the largest magnitude of a target over all activations.
    pub(super) fn of_targets(meaning: &Meaning, scales: &[f64], reach: impl Fn(usize) -> f64) -> Self {
        let decimals = |(target, &scale): (usize, &f64)| match meaning.is_array {
            true => 6,
            false => max_decimals(scale, TARGET_UNITS).min(max_decimals(reach(target), LARGEST_TARGET)),
        };
        Self {
            decimals: scales.iter().enumerate().map(decimals).collect(),
        }
    }

    /// Number of units in 1.
    pub(super) fn per_one(&self, index: usize) -> f64 {
        ten_to(self.decimals[index])
    }

    /// A unit in those of the decoder: 1e-6.
    pub(super) fn unit(&self, index: usize) -> f64 {
        ten_to(-self.decimals[index])
    }

    /// Every unit in those of the decoder.
    pub(in crate::export::bundle) fn all(&self) -> impl Iterator<Item = f64> {
        (0..self.decimals.len()).map(|index| self.unit(index))
    }

    /// Returns the value in units, limited to the largest number.
    pub(super) fn whole(&self, index: usize, value: f64) -> i64 {
        i64::from((value * self.per_one(index)).round() as i32)
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
