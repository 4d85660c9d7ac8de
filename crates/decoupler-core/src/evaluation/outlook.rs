use super::Simulation;
use crate::{
    scene::{RelativeNoise, Rows},
    sensor::{Identifiability, IdentifiabilityError, IdentifiabilityWarning},
};

/// Conditioning of a scene and the warnings that follow, known before anything is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// Analysis of the worst conditioned row-wire of those read, its nodes half way down.
    pub worst_row: Identifiability,
    /// Noise of a reading of that row relative to it, from all sources of the scene.
    pub noise: RelativeNoise,
    /// Standard deviation in mm to which readings with this noise know the pattern seen worst; 0 without noise.
    pub worst_spread_mm: f64,
    /// Obstacles to decoupling, and what to change.
    pub warnings: Vec<IdentifiabilityWarning>,
}

impl Outlook {
    /// Analyses every row-wire that the simulated scene reads.
    ///
    /// # Errors
    /// If the sensor or scene is invalid, or singular values do not converge.
    pub fn of(simulation: &Simulation) -> Result<Self, OutlookError> {
        let Simulation { sensor, scene, .. } = simulation;
        sensor.check().map_err(IdentifiabilityError::from)?;
        scene.check()?;
        let stroke_mm = simulation.stroke_mm();
        let half_way = vec![glam::DVec3::new(0.0, 0.0, 0.5 * stroke_mm); sensor.scale.nodes_per_row()];
        let mut worst: Option<Identifiability> = None;
        for row in scene.rows.read(sensor.scale.rows())? {
            let seen = Identifiability::of_row(sensor, row, &half_way, scene.movement.axes())?;
            if worst.as_ref().is_none_or(|worst| seen.condition() > worst.condition()) {
                worst = Some(seen);
            }
        }
        let worst_row = worst.expect("an array has row-wires");
        let noise = RelativeNoise::of(scene.noise, sensor, &[worst_row.row], 0.5 * stroke_mm);
        let noise = noise.map_err(IdentifiabilityError::from)?;
        let alike = if scene.rows == Rows::All {
            Identifiability::most_alike_rows(sensor, noise).map_err(IdentifiabilityError::from)?
        } else {
            None
        };
        let seen = Identifiability::of_row_with_gain(sensor, worst_row.row, &half_way, worst_row.axes, noise)?;
        Ok(Self {
            warnings: seen.warnings(noise.own, stroke_mm / 12.0_f64.sqrt(), alike),
            worst_spread_mm: seen.worst_spread_mm(noise.own),
            worst_row,
            noise,
        })
    }
}

/// Error of an outlook.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OutlookError {
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    /// The sensor is invalid.
    #[error(transparent)]
    Identifiability(#[from] IdentifiabilityError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Noise, Scene};

    fn is_hopeless(noise: Noise) -> bool {
        let simulation = Simulation {
            scene: Scene {
                noise,
                ..Scene::default()
            },
            ..Simulation::default()
        };
        let warnings = Outlook::of(&simulation).unwrap().warnings;
        warnings
            .iter()
            .any(|warning| matches!(warning, IdentifiabilityWarning::Hopeless { .. }))
    }

    /// The Bayesian reference of the same scene is far below the error of the mean, and rows differ by 20 times the noise.
    #[test]
    fn drift_is_not_taken_for_noise_of_each_reading() {
        let simulation = Simulation {
            scene: Scene {
                noise: Noise {
                    drift: 0.1,
                    ..Noise::relative(1e-3)
                },
                ..Scene::default()
            },
            sensor: crate::sensor::SensorModel::new("10x6_3x18".parse().unwrap()),
            ..Simulation::default()
        };
        let outlook = Outlook::of(&simulation).unwrap();
        assert_eq!(outlook.warnings, []);
        assert_eq!((outlook.noise.own, outlook.noise.common), (1e-3, 0.1));
    }

    #[test]
    fn every_kind_of_noise_is_warned_of() {
        let of = |relative, additive_ohm, converter_bits, drift| Noise {
            relative,
            additive_ohm,
            converter_bits,
            drift,
            ..Noise::default()
        };
        assert!(!is_hopeless(of(1e-4, 0.0, None, 0.0)));
        assert!(is_hopeless(of(1.0, 0.0, None, 0.0)));
        // Resistances are below 100 ohm; 1 bit rounds to steps as large as the largest.
        assert!(is_hopeless(of(0.0, 1e3, None, 0.0)));
        assert!(is_hopeless(of(0.0, 0.0, Some(1), 0.0)));
        // A gain that is common to all readings hides one pattern, and leaves the others.
        assert!(!is_hopeless(of(0.0, 0.0, None, 1.0)));
        assert!(is_hopeless(of(1.0, 0.0, None, 1.0)));
    }
}
