use glam::DVec3;

use super::Noise;
pub use crate::sensor::RelativeNoise;
use crate::sensor::{SensorError, SensorModel};

impl RelativeNoise {
    /// The relative noise of the median reading of `rows` (counted from 0), all of whose nodes are pressed down by
    /// `depth_mm`: one number for the whole array, where resistances in ohm need a reading to be compared with.
    ///
    /// # Errors
    /// No resistance at that depth, or at rest, which sets the range of a converter.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;

    fn of(noise: Noise) -> RelativeNoise {
        let model = SensorModel::new(ArrayScale::default());
        RelativeNoise::of(noise, &model, &[0, 4, 9], 0.5).unwrap()
    }

    #[test]
    fn relative_noise_alone_keeps_its_bits() {
        for relative in [0.0, 1e-300, 1e-8, 0.1, 1.0 / 3.0, 1.0] {
            let found = of(Noise::relative(relative));
            assert_eq!((found.own, found.common, found.total()), (relative, 0.0, relative));
        }
    }

    /// The median resistance is found here by counting.
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
