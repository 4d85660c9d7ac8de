use glam::DVec3;
use rand::{Rng, RngExt};

use super::{Indenter, Loading, press::Press, smooth_field::SmoothField};
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
            Prepared::RandomNodes => {
                let mut uniform = || rng.random::<f64>();
                Deformation::from_fn(scale, |_, _| random_mm(self.movement, self.stroke_mm, &mut uniform))
            }
            Prepared::SmoothField(field) => {
                let z = field.draw(rng);
                let sideways = match self.movement {
                    Movement::Z => None,
                    Movement::Xyz { .. } => Some((field.draw(rng), field.draw(rng))),
                };
                Deformation::from_fn(scale, |row, node| {
                    let at = (row, node);
                    let sideways = sideways.as_ref().map(|(x, y)| (x[at], y[at]));
                    field_mm(z[at], sideways, self.stroke_mm, shift_mm)
                })
            }
            Prepared::Indenter(indenter) => {
                let press = indenter.draw(&self.model, self.stroke_mm, rng);
                let mut sideways = || match self.movement {
                    Movement::Z => 0.0,
                    Movement::Xyz { .. } => shift_mm * (2.0 * rng.random::<f64>() - 1.0),
                };
                let sideways_mm = (sideways(), sideways());
                Deformation::from_fn(scale, |row, node| {
                    let rest_mm = self.model.geometry.row_node_mm(scale, row, node);
                    dragged_mm(&press, rest_mm, sideways_mm, self.stroke_mm)
                })
            }
        }
    }
}

/// Displacement of a random node, from values that are uniform in [0, 1).
pub(super) fn random_mm(movement: Movement, stroke_mm: f64, uniform: &mut impl FnMut() -> f64) -> DVec3 {
    let z = stroke_mm * uniform();
    match movement {
        Movement::Z => DVec3::new(0.0, 0.0, z),
        Movement::Xyz { largest_shift_mm } => {
            let mut sideways = || largest_shift_mm * (2.0 * uniform() - 1.0);
            DVec3::new(sideways(), sideways(), z)
        }
    }
}

/// Displacement of a node from values of smooth fields, which are uniform in [0, 1].
pub(super) fn field_mm(z: f64, sideways: Option<(f64, f64)>, stroke_mm: f64, shift_mm: f64) -> DVec3 {
    let (x, y) = sideways.map_or((0.0, 0.0), |(x, y)| (2.0 * x - 1.0, 2.0 * y - 1.0));
    DVec3::new(shift_mm * x, shift_mm * y, stroke_mm * z)
}

/// Displacement under a press of the node at `rest_mm`. Friction drags the surface along with the body by up to
/// `sideways_mm`, in proportion to how far it is pressed.
pub(super) fn dragged_mm(press: &Press, rest_mm: DVec3, sideways_mm: (f64, f64), stroke_mm: f64) -> DVec3 {
    let z = press.depth_at_mm(rest_mm.x, rest_mm.y).clamp(0.0, stroke_mm);
    let dragged = z / stroke_mm;
    DVec3::new(sideways_mm.0 * dragged, sideways_mm.1 * dragged, z)
}
