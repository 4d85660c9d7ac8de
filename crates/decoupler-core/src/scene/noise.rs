use std::f64::consts::TAU;

use glam::DVec3;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::{Converter, SceneError};
pub use crate::sensor::RelativeNoise;
use crate::sensor::{SensorError, SensorModel};

/// Noise of the readings: Gaussian noise and the rounding of the converter.
///
/// reading = round(R · (1 + drift · η) · (1 + relative · ε₁) + additive · ε₂), with ε₁ and ε₂ drawn for each resistance
/// and η once per snapshot. The Gaussians are truncated to possible readings: η is redrawn until the gain is above 0, and
/// ε₁ and ε₂ until the sum is above 0 and finite. With noise up to a tenth of the reading this practically never happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Standard deviation relative to the resistance.
    pub relative: f64,
    /// Standard deviation in ohm, independent of the resistance.
    pub additive_ohm: f64,
    /// Number of bits of the analogue-to-digital converter; `None` for readings without quantisation.
    pub converter_bits: Option<u8>,
    /// Gain error shared by all readings of a snapshot, e.g. from temperature (standard deviation, relative).
    pub drift: f64,
    /// Data sets whose readings have noise.
    pub sets: NoisySets,
}

/// Data sets whose readings have noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoisySets {
    /// Training and test samples: the network is trained for the noise.
    #[default]
    Both,
    /// Training only.
    Training,
    /// Test only: a network trained on noise-free readings is tested with noise.
    Test,
}

/// Largest additive noise for which the squares of readings remain finite.
const LARGEST_ADDITIVE_OHM: f64 = 1e150;

impl Noise {
    /// Maximum number of bits of a converter.
    pub const MAX_BITS: u8 = 32;

    /// Creates noise with standard deviation `relative` relative to the resistance, in both sets.
    pub fn relative(relative: f64) -> Self {
        Self {
            relative,
            ..Self::default()
        }
    }

    /// Returns `true` if no reading is changed.
    pub fn is_none(&self) -> bool {
        self.relative == 0.0 && self.additive_ohm == 0.0 && self.drift == 0.0 && self.converter_bits.is_none()
    }

    /// Returns the noise of the training set.
    pub fn in_training(self) -> Self {
        if self.sets == NoisySets::Test {
            Self::default()
        } else {
            self
        }
    }

    /// Returns the noise of the test set.
    pub fn in_test(self) -> Self {
        if self.sets == NoisySets::Training {
            Self::default()
        } else {
            self
        }
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        let values = [
            ("relative noise", self.relative, 1.0),
            ("additive noise", self.additive_ohm, LARGEST_ADDITIVE_OHM),
            ("drift", self.drift, 1.0),
        ];
        for (what, value, largest) in values {
            if !(0.0..=largest).contains(&value) {
                return Err(SceneError::Noise { what, value, largest });
            }
        }
        match self.converter_bits {
            Some(bits) if !(1..=Self::MAX_BITS).contains(&bits) => Err(SceneError::Bits(bits)),
            _ => Ok(()),
        }
    }

    /// Returns the lowest and highest reading of the converter, or of a 16-bit converter if there is none.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    pub(crate) fn range_ohm(&self, model: &SensorModel) -> Result<(f64, f64), SensorError> {
        Ok(Converter::new(self.converter_bits.unwrap_or(16), model)?.range_ohm())
    }
}

impl RelativeNoise {
    /// Returns the relative noise of the median reading of `rows` (counted from 0) with all nodes pressed down by
    /// `depth_mm`: a single figure for the whole array, which relates noise in ohm to a typical reading.
    ///
    /// # Errors
    /// If there is no resistance at that depth, or at rest, which sets the range of a converter.
    pub fn of(noise: Noise, model: &SensorModel, rows: &[usize], depth_mm: f64) -> Result<Self, SensorError> {
        let displacements_mm = vec![DVec3::Z * depth_mm; model.scale.nodes_per_row()];
        let mut readings_ohm = Vec::new();
        for &row in rows {
            readings_ohm.extend(model.row_resistances(row, &displacements_mm)?);
        }
        readings_ohm.sort_by(f64::total_cmp);
        let source = noise.source(model)?;
        let median_ohm = readings_ohm.get(readings_ohm.len() / 2);
        Ok(median_ohm.map_or_else(Self::default, |&ohm| source.relative_to(ohm)))
    }
}

/// Draws a standard normal value by the method of Box and Muller (1958).
pub(crate) fn standard_normal(rng: &mut impl Rng) -> f64 {
    // 1 − u lies in (0, 1], where the logarithm is finite.
    let length = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    length * (TAU * rng.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;

    fn of(noise: Noise) -> RelativeNoise {
        let model = SensorModel::new(ArrayScale::default());
        RelativeNoise::of(noise, &model, &[0, 4, 9], 0.5).unwrap()
    }

    #[test]
    fn relative_noise_alone_is_returned_exactly() {
        for relative in [0.0, 1e-300, 1e-8, 0.1, 1.0 / 3.0, 1.0] {
            let found = of(Noise::relative(relative));
            assert_eq!((found.own, found.common, found.total()), (relative, 0.0, relative));
        }
    }

    /// The median resistance is determined here by counting.
    #[test]
    fn sources_in_ohm_are_compared_with_the_median_reading() {
        let model = SensorModel::new(ArrayScale::default());
        let pressed = vec![DVec3::new(0.0, 0.0, 0.5); 10];
        let readings: Vec<f64> = [0, 4, 9]
            .iter()
            .flat_map(|&row| model.row_resistances(row, &pressed).unwrap())
            .collect();
        let below = |ohm: f64| readings.iter().filter(|&&other| other < ohm).count();
        let median = readings
            .iter()
            .copied()
            .find(|&ohm| (44..=45).contains(&below(ohm)))
            .unwrap();
        let noise = Noise {
            relative: 3e-3,
            additive_ohm: 0.2,
            drift: 4e-3,
            ..Noise::default()
        };
        let found = of(noise);
        assert!(
            (found.own / (9e-6 + (0.2 / median).powi(2)).sqrt() - 1.0).abs() < 1e-2,
            "{found:?}"
        );
        assert_eq!(found.common, 4e-3);
        assert!((found.total().powi(2) - found.own.powi(2) - 16e-6).abs() < 1e-18);
    }

    #[test]
    fn enormous_noise_stays_finite() {
        let noise = Noise {
            additive_ohm: f64::MAX,
            ..Noise::default()
        };
        assert!(of(noise).total().is_finite());
    }
}
