use serde::{Deserialize, Serialize};

use super::{SceneError, converter::Converter};
use crate::sensor::{SensorError, SensorModel};

/// Noise of the readings. Everything is Gaussian but the converter, which rounds.
///
/// reading = round(R · (1 + drift · η) · (1 + relative · ε₁) + additive · ε₂), with ε drawn for each resistance and η once
/// for each snapshot. The Gaussians are truncated to what a reading can be: η is drawn again until the gain is above 0, ε₁
/// and ε₂ until the sum is above 0 and finite. Up to noise of a tenth of the reading that never happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Standard deviation in proportion to the resistance.
    pub relative: f64,
    /// Standard deviation in ohm, whatever the resistance.
    pub additive_ohm: f64,
    /// Bits of the converter that digitises readings; `None` for one without steps.
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
    /// Training and test samples: the network learns to handle the noise.
    #[default]
    Both,
    /// Training only.
    Training,
    /// Test only: a network trained on clean readings meets noise.
    Test,
}

/// Largest additive noise: the squares of readings with it are still finite numbers.
const LARGEST_ADDITIVE_OHM: f64 = 1e150;

impl Noise {
    /// The most bits of a converter.
    pub const MAX_BITS: u8 = 32;

    /// Noise of standard deviation `relative` in proportion to the resistance, in both sets.
    pub fn relative(relative: f64) -> Self {
        Self {
            relative,
            ..Self::default()
        }
    }

    /// True if no reading is changed.
    pub fn is_none(&self) -> bool {
        self.relative == 0.0 && self.additive_ohm == 0.0 && self.drift == 0.0 && self.converter_bits.is_none()
    }

    /// Noise of the training set.
    pub fn in_training(self) -> Self {
        if self.sets == NoisySets::Test {
            Self::default()
        } else {
            self
        }
    }

    /// Noise of the test set.
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

    /// The lowest and the highest reading of the converter, or of one of 16 bits if there is none.
    ///
    /// # Errors
    /// The undeformed sensor has no resistance.
    pub(crate) fn range_ohm(&self, model: &SensorModel) -> Result<(f64, f64), SensorError> {
        Ok(Converter::new(self.converter_bits.unwrap_or(16), model)?.range_ohm())
    }
}
