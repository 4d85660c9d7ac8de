//! The scene: what happens to the sensor. Nothing that does not vary in the scene is modelled further on.

mod deformation;

pub use deformation::Deformation;

use glam::DVec3;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::sensor::{ArrayScale, Geometry};

/// How the top surface is loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loading {
    /// Every node is compressed by an independent, uniformly distributed amount: the paper's experiments.
    #[default]
    RandomNodes,
}

/// Which deformations occur. All rows are read, and nodes move along z only, as in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// How the surface is loaded.
    pub loading: Loading,
    /// The largest compression as a fraction of the height, in (0, 1).
    pub largest_compression: f64,
}

/// A scene that cannot be drawn.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SceneError {
    /// The largest compression is out of range.
    #[error("the largest compression is {} %: it must be above 0 and below 100 % of the height", 100.0 * .0)]
    Compression(f64),
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            loading: Loading::RandomNodes,
            largest_compression: 0.2,
        }
    }
}

impl Scene {
    /// Checks that the compression lies between nothing and the whole height.
    ///
    /// # Errors
    /// It does not.
    pub fn check(&self) -> Result<(), SceneError> {
        if self.largest_compression > 0.0 && self.largest_compression < 1.0 {
            Ok(())
        } else {
            Err(SceneError::Compression(self.largest_compression))
        }
    }

    /// The full scale of the deformation: the distance a node can travel.
    pub fn stroke_mm(&self, geometry: &Geometry) -> f64 {
        self.largest_compression * geometry.height_mm
    }

    /// Draws the deformation of the whole array at one moment.
    pub fn draw(&self, scale: ArrayScale, geometry: &Geometry, rng: &mut impl Rng) -> Deformation {
        let stroke_mm = self.stroke_mm(geometry);
        match self.loading {
            Loading::RandomNodes => {
                Deformation::from_fn(scale, |_, _| DVec3::new(0.0, 0.0, stroke_mm * rng.random::<f64>()))
            }
        }
    }
}
