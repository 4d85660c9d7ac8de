use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rand::Rng;

use super::{Converter, Deformation, Indenter, Noise, RelativeNoise, standard_normal};
use crate::sensor::{SensorError, SensorModel};

/// Noise of one sensor, prepared for drawing; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseSource {
    noise: Noise,
    converter: Option<Converter>,
}

impl Noise {
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
                reading = converter.round_ohm(reading);
            }
            *value = reading;
        }
    }

    /// Standard deviation relative to the resistance.
    pub(crate) fn relative(&self) -> f64 {
        self.noise.relative
    }

    /// Standard deviation in ohm, independent of the resistance.
    pub(crate) fn additive_ohm(&self) -> f64 {
        self.noise.additive_ohm
    }

    /// Gain error shared by all readings of a snapshot (standard deviation, relative).
    pub(crate) fn drift(&self) -> f64 {
        self.noise.drift
    }

    /// Lowest and highest value that are converted to `reading_ohm`; `None` without a converter. The last step is open
    /// because the converter clips.
    pub(crate) fn rounded_from_ohm(&self, reading_ohm: f64) -> Option<(f64, f64)> {
        Some(self.converter?.rounded_from_ohm(reading_ohm))
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
    let mut value = draw();
    for _ in 1..MAX_DRAWS {
        if value > 0.0 && value.is_finite() {
            break;
        }
        value = draw();
    }
    // Reached with an invalid value only if the resistance itself is invalid.
    value
}

/// A manually defined deformation: the imprint of an indenter, and individual nodes moved up or down.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Touch {
    /// The indenter pressed onto the surface, if there is one.
    pub print: Option<Print>,
    /// Depths in millimetres of individually moved nodes, by row-wire and node on it, from 0; they override the imprint.
    pub nodes_mm: BTreeMap<(usize, usize), f64>,
}

/// An upright indenter pressed at one position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Print {
    /// The indenter; the middle of its range of sizes is used.
    pub indenter: Indenter,
    /// Position of its centre.
    pub place_mm: DVec2,
    /// Depth at its centre.
    pub depth_mm: f64,
}

impl Touch {
    /// Returns the deformation of an array, with depths limited to between 0 and `stroke_mm`.
    pub fn deformation(&self, model: &SensorModel, stroke_mm: f64) -> Deformation {
        let within = |depth_mm: f64| depth_mm.clamp(0.0, stroke_mm);
        let print = self.print.as_ref().map(|print| {
            let depth_mm = within(print.depth_mm);
            print.indenter.press(model, print.place_mm, depth_mm)
        });
        Deformation::from_fn(model.scale, |row, node| {
            let of_print = print.as_ref().map_or(DVec3::ZERO, |print| print.row_mm(row)[node]);
            let moved_mm = self.nodes_mm.get(&(row, node));
            moved_mm.map_or(of_print, |&depth_mm| DVec3::Z * within(depth_mm))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        numerics::normal_cdf,
        scene::NoisySets,
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

    fn model() -> SensorModel {
        SensorModel::new("10x6_3x18".parse().unwrap())
    }

    #[test]
    fn a_punch_presses_the_nodes_under_its_face_and_leaves_those_far_away() {
        let model = model();
        let middle = model.geometry.row_node_mm(model.scale, 4, 2);
        let indenter = "indenter:flat-punch".parse::<crate::scene::Loading>().unwrap();
        let crate::scene::Loading::Indenter(indenter) = indenter else {
            panic!("an indenter")
        };
        let touch = Touch {
            print: Some(Print {
                indenter,
                place_mm: middle.truncate(),
                depth_mm: 0.6,
            }),
            ..Touch::default()
        };
        let pressed = touch.deformation(&model, 1.0);
        assert_eq!(pressed.row_mm(4)[2], DVec3::new(0.0, 0.0, 0.6));
        // The face of middle size, 4 mm in radius, covers the neighbours 2 mm away.
        assert_eq!(pressed.row_mm(4)[3].z, 0.6);
        assert!(pressed.row_mm(9)[5].z < 0.6 * 0.5);
    }

    #[test]
    fn depths_stay_within_the_limits_of_the_scene() {
        let model = model();
        let deep = |depth_mm| Touch {
            print: Some(Print {
                indenter: Indenter::default(),
                place_mm: DVec2::new(12.0, 9.0),
                depth_mm,
            }),
            nodes_mm: [((0, 0), 7.0), ((1, 1), -7.0), ((2, 2), 0.25)].into(),
        };
        for depth_mm in [-3.0, 0.0, 0.4, 99.0] {
            let pressed = deep(depth_mm).deformation(&model, 0.5);
            for row in 0..10 {
                assert!(pressed.row_mm(row).iter().all(|u| (0.0..=0.5).contains(&u.z)));
            }
            let [low, high, free] = [(0, 0), (1, 1), (2, 2)].map(|(row, node)| pressed.row_mm(row)[node].z);
            assert_eq!(
                [low, high, free],
                [0.5, 0.0, 0.25],
                "moved nodes stay where they were put"
            );
        }
        assert!(
            Touch::default()
                .deformation(&model, 1.0)
                .row_mm(3)
                .iter()
                .all(|u| *u == DVec3::ZERO)
        );
    }
}
