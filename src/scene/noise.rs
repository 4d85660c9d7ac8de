use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{RelativeNoise, SceneError, normal::standard_normal};
use crate::sensor::{SensorError, SensorModel};
use glam::DVec3;

/// Noise of the readings. Everything is Gaussian but the converter, which rounds.
///
/// reading = round(R · (1 + drift · η) · (1 + relative · ε₁) + additive · ε₂), with ε drawn for each resistance and η once
/// for each snapshot.
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
    /// Training and test alike: the network learns what noise does.
    #[default]
    Both,
    /// Training only.
    Training,
    /// Test only: a network trained on clean readings meets noise.
    Test,
}

/// The steps of a converter: it reads from 0 to twice the largest resistance at rest, and clips beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Converter {
    step_ohm: f64,
    steps: f64,
}

impl Noise {
    /// The most bits of a converter.
    pub const MOST_BITS: u8 = 32;

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
            ("additive noise", self.additive_ohm, f64::MAX),
            ("drift", self.drift, 1.0),
        ];
        for (what, value, largest) in values {
            if !(0.0..=largest).contains(&value) {
                return Err(SceneError::Noise { what, value, largest });
            }
        }
        match self.converter_bits {
            Some(bits) if !(1..=Self::MOST_BITS).contains(&bits) => Err(SceneError::Bits(bits)),
            _ => Ok(()),
        }
    }

    fn converter(&self, model: &SensorModel) -> Result<Option<Converter>, SensorError> {
        let Some(bits) = self.converter_bits else {
            return Ok(None);
        };
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let mut largest_ohm = 0.0_f64;
        for row in 0..model.scale.rows() {
            largest_ohm = model
                .row_resistances(row, &rest)?
                .into_iter()
                .fold(largest_ohm, f64::max);
        }
        let steps = 2.0_f64.powi(i32::from(bits));
        Ok(Some(Converter {
            step_ohm: 2.0 * largest_ohm / steps,
            steps,
        }))
    }

    /// Prepares to disturb readings of `model`.
    ///
    /// # Errors
    /// The undeformed sensor has no resistance, hence the converter no range.
    pub fn source(&self, model: &SensorModel) -> Result<NoiseSource, SensorError> {
        Ok(NoiseSource {
            noise: *self,
            converter: self.converter(model)?,
        })
    }
}

/// Noise of one sensor, ready to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseSource {
    noise: Noise,
    converter: Option<Converter>,
}

impl NoiseSource {
    /// Disturbs the readings of one snapshot in place. Readings stay above 0: what noise would turn around reads as a
    /// millionth of itself, or as one step of the converter.
    pub fn disturb(&self, resistances_ohm: &mut [f64], rng: &mut impl Rng) {
        let Noise {
            relative,
            additive_ohm,
            drift,
            ..
        } = self.noise;
        let gain = if drift > 0.0 {
            1.0 + drift * standard_normal(rng)
        } else {
            1.0
        };
        for value in resistances_ohm {
            let true_ohm = *value;
            let mut reading = true_ohm * gain;
            if relative > 0.0 {
                reading *= 1.0 + relative * standard_normal(rng);
            }
            if additive_ohm > 0.0 {
                reading += additive_ohm * standard_normal(rng);
            }
            reading = reading.max(1e-6 * true_ohm);
            if let Some(Converter { step_ohm, steps }) = self.converter {
                reading = (reading / step_ohm).round().clamp(1.0, steps) * step_ohm;
            }
            *value = reading;
        }
    }

    /// Standard deviation in proportion to the resistance.
    pub(crate) fn relative(&self) -> f64 {
        self.noise.relative
    }

    /// Standard deviation in ohm, whatever the resistance.
    pub(crate) fn additive_ohm(&self) -> f64 {
        self.noise.additive_ohm
    }

    /// Gain error shared by all readings of a snapshot (standard deviation, relative).
    pub(crate) fn drift(&self) -> f64 {
        self.noise.drift
    }

    /// The lowest and the highest value that the converter gives as `reading_ohm`; `None` without a converter. The last
    /// step is open, for the converter clips.
    pub(crate) fn rounded_from_ohm(&self, reading_ohm: f64) -> Option<(f64, f64)> {
        let Converter { step_ohm, steps } = self.converter?;
        let step = (reading_ohm / step_ohm).round().clamp(1.0, steps);
        let lowest_ohm = if step > 1.0 { (step - 0.5) * step_ohm } else { 0.0 };
        let highest_ohm = if step < steps {
            (step + 0.5) * step_ohm
        } else {
            f64::INFINITY
        };
        Some((lowest_ohm, highest_ohm))
    }

    /// The noise of a reading of `resistance_ohm` relative to it, with own part
    /// √(relative² + (additive² + step²/12)/R²); step/√12 is the standard deviation of rounding to steps.
    pub fn relative_to(&self, resistance_ohm: f64) -> RelativeNoise {
        let step_ohm = self.converter.map_or(0.0, |converter| converter.step_ohm);
        let additive_ohm = libm::hypot(self.noise.additive_ohm, step_ohm / 12.0_f64.sqrt());
        RelativeNoise {
            own: libm::hypot(self.noise.relative, additive_ohm / resistance_ohm),
            common: self.noise.drift,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};

    fn disturbed(noise: Noise, resistance_ohm: f64, count: usize) -> Vec<f64> {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let source = noise.source(&model).unwrap();
        let mut rng = Seed(0).rng(Stream::TrainingNoise);
        let mut readings = vec![resistance_ohm; count];
        source.disturb(&mut readings, &mut rng);
        readings
    }

    fn spread(readings: &[f64]) -> (f64, f64) {
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        let squares = readings.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
        (mean, (squares / readings.len() as f64).sqrt())
    }

    #[test]
    fn each_kind_has_its_documented_spread() {
        let noise = Noise {
            relative: 0.01,
            additive_ohm: 0.5,
            ..Noise::default()
        };
        let (mean, deviation) = spread(&disturbed(noise, 100.0, 100_000));
        assert!((mean - 100.0).abs() < 0.02, "{mean}");
        let expected = noise.source(&SensorModel::new("10x6_3x18".parse().unwrap())).unwrap();
        assert!((deviation / (100.0 * expected.relative_to(100.0).own) - 1.0).abs() < 0.01);
        assert!((deviation - (1.0 + 0.25_f64).sqrt()).abs() < 0.02, "{deviation}");
    }

    #[test]
    fn drift_is_common_to_a_snapshot() {
        let noise = Noise {
            drift: 0.1,
            ..Noise::default()
        };
        let readings = disturbed(noise, 50.0, 20);
        assert!(readings.iter().all(|&r| r == readings[0]) && readings[0] != 50.0);
    }

    #[test]
    fn a_converter_gives_whole_steps_and_never_zero() {
        let noise = Noise {
            converter_bits: Some(4),
            ..Noise::default()
        };
        let step = disturbed(noise, 1e-9, 1)[0];
        for ohm in [1.0, 30.0, 77.0, 1e9] {
            let steps = disturbed(noise, ohm, 1)[0] / step;
            assert_eq!(steps, steps.round());
            assert!((1.0..=16.0).contains(&steps));
        }
    }

    #[test]
    fn enormous_noise_leaves_positive_readings() {
        let noise = Noise {
            relative: 1.0,
            additive_ohm: 1e6,
            ..Noise::default()
        };
        assert!(disturbed(noise, 10.0, 1000).iter().all(|&r| r > 0.0));
    }

    #[test]
    fn no_noise_changes_nothing_and_sets_choose() {
        assert!(disturbed(Noise::default(), 12.5, 5).iter().all(|&r| r == 12.5));
        let test_only = Noise {
            sets: NoisySets::Test,
            ..Noise::relative(0.1)
        };
        assert!(test_only.in_training().is_none() && !test_only.in_test().is_none());
    }
}
