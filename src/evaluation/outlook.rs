use super::Simulation;
use crate::{
    scene::Rows,
    sensor::{Identifiability, IdentifiabilityError, IdentifiabilityWarning},
};

/// Identifiability of a scene, assessed before anything is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// Identifiability of the worst-conditioned row-wire read, with its nodes at half the stroke.
    pub worst_row: Identifiability,
    /// Problems to expect, and what to change.
    pub warnings: Vec<IdentifiabilityWarning>,
}

impl Outlook {
    /// Assesses every row-wire that the simulated scene reads.
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
        let warnings = worst_row.warnings(scene.noise.relative, stroke_mm / 12.0_f64.sqrt(), alike);
        Ok(Self { worst_row, warnings })
    }
}

/// Error in assessing a scene.
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
