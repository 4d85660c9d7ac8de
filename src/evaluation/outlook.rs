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
    /// Standard deviation of a reading of that row relative to it, from all sources of the scene.
    pub noise: f64,
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
        let alike = if scene.rows == Rows::All {
            Identifiability::most_alike_rows(sensor).map_err(IdentifiabilityError::from)?
        } else {
            None
        };
        let noise = RelativeNoise::of(scene.noise, sensor, &[worst_row.row], 0.5 * stroke_mm);
        let noise = noise.map_err(IdentifiabilityError::from)?.total();
        Ok(Self {
            warnings: worst_row.warnings(noise, stroke_mm / 12.0_f64.sqrt(), alike),
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
        assert!(is_hopeless(of(0.0, 0.0, None, 1.0)));
    }
}
