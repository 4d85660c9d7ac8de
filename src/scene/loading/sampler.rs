use glam::DVec3;
use rand::{Rng, RngExt};

use super::{Indenter, Loading, smooth_field::SmoothField};
use crate::{
    scene::{Deformation, Movement, Scene},
    sensor::SensorModel,
};

/// Draws deformations of one array in one scene; what all draws share is computed once.
#[derive(Clone, Debug)]
pub struct DeformationSampler {
    model: SensorModel,
    movement: Movement,
    stroke_mm: f64,
    loading: Prepared,
}

#[derive(Clone, Debug)]
enum Prepared {
    RandomNodes,
    SmoothField(SmoothField),
    Indenter(Indenter),
}

impl DeformationSampler {
    pub(in crate::scene) fn new(scene: &Scene, model: &SensorModel) -> Self {
        let loading = match scene.loading {
            Loading::RandomNodes => Prepared::RandomNodes,
            Loading::SmoothField { correlation_length_mm } => {
                Prepared::SmoothField(SmoothField::new(model.scale, &model.geometry, correlation_length_mm))
            }
            Loading::Indenter(indenter) => Prepared::Indenter(indenter),
        };
        Self {
            model: *model,
            movement: scene.movement,
            stroke_mm: scene.stroke_mm(&model.geometry),
            loading,
        }
    }

    /// Draws the deformation of the whole array at one moment.
    pub fn draw(&self, rng: &mut impl Rng) -> Deformation {
        let scale = self.model.scale;
        let shift_mm = self.movement.largest_shift_mm();
        match &self.loading {
            Prepared::RandomNodes => Deformation::from_fn(scale, |_, _| {
                let z = self.stroke_mm * rng.random::<f64>();
                match self.movement {
                    Movement::Z => DVec3::new(0.0, 0.0, z),
                    Movement::Xyz { .. } => {
                        let mut sideways = || shift_mm * (2.0 * rng.random::<f64>() - 1.0);
                        DVec3::new(sideways(), sideways(), z)
                    }
                }
            }),
            Prepared::SmoothField(field) => {
                let z = field.draw(rng);
                let sideways = match self.movement {
                    Movement::Z => None,
                    Movement::Xyz { .. } => Some((field.draw(rng), field.draw(rng))),
                };
                Deformation::from_fn(scale, |row, node| {
                    let at = (row, node);
                    let (x, y) = sideways
                        .as_ref()
                        .map_or((0.0, 0.0), |(x, y)| (2.0 * x[at] - 1.0, 2.0 * y[at] - 1.0));
                    DVec3::new(shift_mm * x, shift_mm * y, self.stroke_mm * z[at])
                })
            }
            Prepared::Indenter(indenter) => {
                let press = indenter.draw(&self.model, self.stroke_mm, rng);
                let mut sideways = || match self.movement {
                    Movement::Z => 0.0,
                    Movement::Xyz { .. } => shift_mm * (2.0 * rng.random::<f64>() - 1.0),
                };
                // Friction drags the surface along with the body, in proportion to how far it is pressed.
                let (x, y) = (sideways(), sideways());
                Deformation::from_fn(scale, |row, node| {
                    let rest = self.model.geometry.row_node_mm(scale, row, node);
                    let z = press.depth_at_mm(rest.x, rest.y).clamp(0.0, self.stroke_mm);
                    let dragged = z / self.stroke_mm;
                    DVec3::new(x * dragged, y * dragged, z)
                })
            }
        }
    }
}
