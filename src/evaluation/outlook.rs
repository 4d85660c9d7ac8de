use super::Simulation;
use crate::{
    scene::Rows,
    sensor::{Identifiability, IdentifiabilityError, IdentifiabilityWarning},
};

/// What can be hoped for in a scene, before anything is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// Of the worst conditioned row-wire of those read, its nodes half way down.
    pub worst_row: Identifiability,
    /// What stands in the way, and what to change.
    pub warnings: Vec<IdentifiabilityWarning>,
}

impl Outlook {
    /// Looks at every row-wire that the simulated scene reads.
    ///
    /// # Errors
    /// An impossible sensor or scene, or singular values that do not converge.
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

/// Why there is no outlook.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OutlookError {
    /// An impossible scene.
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    /// An impossible sensor.
    #[error(transparent)]
    Identifiability(#[from] IdentifiabilityError),
}
