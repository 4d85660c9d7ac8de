use std::f64::consts::TAU;

use glam::DVec3;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::SceneError;
use crate::{
    sensor::{RelativeNoise, SensorError, SensorModel},
    text::Named,
};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
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

impl Named for NoisySets {
    const WHAT: &'static str = "a choice of sets";
    const ALL: &'static [Self] = &[Self::Both, Self::Training, Self::Test];
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
        match self.sets {
            NoisySets::Test => Self::default(),
            NoisySets::Training | NoisySets::Both => self,
        }
    }

    /// Returns the noise of the test set.
    pub fn in_test(self) -> Self {
        match self.sets {
            NoisySets::Training => Self::default(),
            NoisySets::Test | NoisySets::Both => self,
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

    /// Prepares to disturb readings of `model`.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance, so that the converter has no range.
    pub fn source(&self, model: &SensorModel) -> Result<NoiseSource, SensorError> {
        let converter = self.converter_bits.map(|bits| Converter::new(bits, model));
        Ok(NoiseSource {
            noise: *self,
            converter: converter.transpose()?,
        })
    }

    /// Returns the lowest and highest reading of the converter, or of a 16-bit converter if there is none.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    pub fn range_ohm(&self, model: &SensorModel) -> Result<(f64, f64), SensorError> {
        let converter = Converter::new(self.converter_bits.unwrap_or(16), model)?;
        Ok((converter.step_ohm, converter.step_ohm * converter.steps))
    }
}

/// Noise of one sensor, prepared for drawing; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseSource {
    pub(crate) noise: Noise,
    converter: Option<Converter>,
}

impl NoiseSource {
    /// Returns `true` if no reading is changed.
    pub fn is_none(&self) -> bool {
        self.noise.is_none()
    }

    /// Adds noise to the readings of one snapshot in place. Readings remain above 0 and finite: other values are drawn
    /// again.
    pub fn disturb(&self, resistances_ohm: &mut [f64], rng: &mut impl Rng) {
        let Noise {
            relative,
            additive_ohm,
            drift,
            ..
        } = self.noise;
        let gain = positive(|| {
            if drift > 0.0 {
                1.0 + drift * standard_normal(rng)
            } else {
                1.0
            }
        });
        for value in resistances_ohm {
            let true_ohm = *value;
            let mut reading = positive(|| {
                let mut reading = true_ohm * gain;
                if relative > 0.0 {
                    reading *= 1.0 + relative * standard_normal(rng);
                }
                if additive_ohm > 0.0 {
                    reading += additive_ohm * standard_normal(rng);
                }
                reading
            });
            if let Some(converter) = self.converter {
                reading = converter.step(reading) * converter.step_ohm;
            }
            *value = reading;
        }
    }

    /// Lowest and highest value that are converted to `reading_ohm`; `None` without a converter. The last step is open
    /// because the converter clips.
    pub(crate) fn rounded_from_ohm(&self, reading_ohm: f64) -> Option<(f64, f64)> {
        let converter = self.converter?;
        let (step, step_ohm) = (converter.step(reading_ohm), converter.step_ohm);
        let lowest_ohm = if step > 1.0 { (step - 0.5) * step_ohm } else { 0.0 };
        let is_last = step >= converter.steps;
        let highest_ohm = if is_last {
            f64::INFINITY
        } else {
            (step + 0.5) * step_ohm
        };
        Some((lowest_ohm, highest_ohm))
    }

    /// Returns the relative noise of a reading of `resistance_ohm`. Its own part is
    /// √(relative² + (additive² + step²/12)/R²), where step/√12 is the standard deviation of rounding to steps.
    pub fn relative_to(&self, resistance_ohm: f64) -> RelativeNoise {
        let step_ohm = self.converter.map_or(0.0, |converter| converter.step_ohm);
        let additive_ohm = libm::hypot(self.noise.additive_ohm, step_ohm / 12.0_f64.sqrt());
        RelativeNoise {
            own: libm::hypot(self.noise.relative, additive_ohm / resistance_ohm),
            common: self.noise.drift,
        }
    }
}

/// Draws until a value is above 0 and finite.
fn positive(mut draw: impl FnMut() -> f64) -> f64 {
    /// At least half of the draws are positive; at the largest noise, where sums overflow, a third is accepted. All fail
    /// for fewer than one in 10⁴⁵ readings.
    const MAX_DRAWS: usize = 256;
    let mut value = f64::NAN;
    for _ in 0..MAX_DRAWS {
        value = draw();
        if value > 0.0 && value.is_finite() {
            break;
        }
    }
    // Reached with an invalid value only if the resistance itself is invalid.
    value
}

/// Analogue-to-digital converter with a range from 0 to twice the largest resistance at rest, beyond which it clips.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Converter {
    step_ohm: f64,
    steps: f64,
}

impl Converter {
    /// Creates a converter with this many bits for the readings of `model`.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    fn new(bits: u8, model: &SensorModel) -> Result<Self, SensorError> {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let mut largest_ohm = 0.0_f64;
        for row in 0..model.scale.rows() {
            largest_ohm = model
                .row_resistances(row, &rest)?
                .into_iter()
                .fold(largest_ohm, f64::max);
        }
        let steps = 2.0_f64.powi(i32::from(bits));
        Ok(Self {
            step_ohm: 2.0 * largest_ohm / steps,
            steps,
        })
    }

    /// Number of the step to which a reading is rounded.
    fn step(self, reading_ohm: f64) -> f64 {
        (reading_ohm / self.step_ohm).round().clamp(1.0, self.steps)
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
    use crate::{
        dataset::{Seed, Stream},
        numerics::normal_cdf,
        sensor::ArrayScale,
    };

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
    fn enormous_noise_leaves_finite_positive_readings() {
        for additive_ohm in [1e6, 1e308, f64::MAX] {
            let noise = Noise {
                relative: 1.0,
                drift: 1.0,
                additive_ohm,
                ..Noise::default()
            };
            let readings = disturbed(noise, 10.0, 1000);
            assert!(readings.iter().all(|&r| r > 0.0 && r.is_finite()), "{additive_ohm}");
        }
    }

    /// Kolmogorov-Smirnov test: with 20 000 readings the distance exceeds 0.0138 with a probability of 0.001.
    #[test]
    fn readings_follow_the_truncated_normal_distribution_and_do_not_reveal_the_truth() {
        let cases = [
            (Noise::relative(1.0), 10.0, 10.0),
            (Noise::relative(0.5), 10.0, 5.0),
            (
                Noise {
                    additive_ohm: 300.0,
                    ..Noise::default()
                },
                10.0,
                300.0,
            ),
        ];
        for (noise, mean_ohm, deviation_ohm) in cases {
            let mut readings = disturbed(noise, mean_ohm, 20_000);
            readings.sort_by(f64::total_cmp);
            assert!(
                readings.windows(2).all(|pair| pair[0] < pair[1]),
                "no value is drawn twice"
            );
            let below = |ohm: f64| normal_cdf((ohm - mean_ohm) / deviation_ohm);
            let count = readings.len() as f64;
            let distance = readings.iter().enumerate().map(|(index, &ohm)| {
                let expected = (below(ohm) - below(0.0)) / (1.0 - below(0.0));
                ((index as f64 + 0.5) / count - expected).abs()
            });
            let distance = distance.fold(0.0, f64::max);
            assert!(distance < 0.0138, "{noise:?}: {distance}");
        }
    }

    #[test]
    fn drift_makes_no_snapshot_negative() {
        let noise = Noise {
            drift: 1.0,
            ..Noise::default()
        };
        let source = noise.source(&SensorModel::new("10x6_3x18".parse().unwrap())).unwrap();
        let mut rng = Seed(0).rng(Stream::TrainingNoise);
        let mut gains = Vec::new();
        for _ in 0..2000 {
            let mut readings = [10.0, 20.0];
            source.disturb(&mut readings, &mut rng);
            assert!((readings[1] / readings[0] - 2.0).abs() < 1e-12);
            gains.push(readings[0] / 10.0);
        }
        // The mean of a normal distribution with mean and standard deviation 1, truncated to values above 0, is 1 +
        // φ(1)/Φ(1).
        let (mean, _) = spread(&gains);
        assert!((mean - 1.2876).abs() < 0.06, "{mean}");
        assert!(
            gains.iter().all(|&gain| gain > 0.0 && gain != 1e-6),
            "the floor carries no information"
        );
    }

    /// The first draw is kept if it is positive, so ordinary noise needs one draw per reading.
    #[test]
    fn ordinary_noise_takes_one_draw_per_reading() {
        let noise = Noise {
            relative: 0.05,
            additive_ohm: 0.1,
            drift: 0.02,
            ..Noise::default()
        };
        let readings = disturbed(noise, 10.0, 100);
        let mut rng = Seed(0).rng(Stream::TrainingNoise);
        let gain = 1.0 + 0.02 * standard_normal(&mut rng);
        for reading in readings {
            let expected = 10.0 * gain * (1.0 + 0.05 * standard_normal(&mut rng)) + 0.1 * standard_normal(&mut rng);
            assert_eq!(reading, expected);
        }
    }

    #[test]
    fn zero_noise_changes_nothing_and_sets_are_respected() {
        assert!(disturbed(Noise::default(), 12.5, 5).iter().all(|&r| r == 12.5));
        let test_only = Noise {
            sets: NoisySets::Test,
            ..Noise::relative(0.1)
        };
        assert!(test_only.in_training().is_none() && !test_only.in_test().is_none());
    }

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
    fn enormous_noise_relative_to_a_reading_stays_finite() {
        let noise = Noise {
            additive_ohm: f64::MAX,
            ..Noise::default()
        };
        assert!(of(noise).total().is_finite());
    }
}
