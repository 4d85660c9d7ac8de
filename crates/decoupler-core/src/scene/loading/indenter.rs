use glam::{DVec2, DVec3};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::press::Press;
use crate::{
    scene::{Deformation, SceneError},
    sensor::SensorModel,
};

/// A rigid body pressed onto the surface: position, depth, size, direction and tilt are drawn for each snapshot.
///
/// The surface follows the body under it; around it, the surface is that of a sheet under tension on an elastic
/// foundation (Pasternak 1954) with decay length λ = `spread_mm`: exp(−distance/λ) next to a cylinder or an edge, which
/// are long in one direction, and the axisymmetric K₀(r/λ)/K₀(a/λ) around the contact radius a of a ball or a punch. A
/// ball or a cylinder touches the sheet up to where its slope equals that of the free surface, so that there is no kink.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Indenter {
    /// Shape, with its range of sizes.
    pub shape: IndenterShape,
    /// Decay length λ of the surface around the indenter.
    pub spread_mm: f64,
}

/// Shape of an indenter. A tilt is the largest slope relative to the surface; the slope is drawn from 0 to the tilt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IndenterShape {
    /// A ball.
    Sphere {
        /// Radius.
        radius_mm: Radii,
    },
    /// The flat end of a round bar.
    #[strum(serialize = "flat punch")]
    FlatPunch(TiltedBody),
    /// A bar lying across the whole surface, in any direction.
    Cylinder(TiltedBody),
    /// The straight edge of a large block, in any direction; one side of it is pressed.
    Edge {
        /// Largest slope along the edge.
        largest_tilt_degrees: f64,
    },
}

/// Size and tilt of a round body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TiltedBody {
    /// Radius.
    pub radius_mm: Radii,
    /// Largest slope: of the face of a punch, along the axis of a cylinder.
    pub largest_tilt_degrees: f64,
}

/// A range of radii in millimetres, drawn uniformly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radii {
    /// Minimum.
    pub smallest: f64,
    /// Maximum.
    pub largest: f64,
}

impl Default for Indenter {
    /// Balls of 2 to 6 mm radius; the surface recovers with a decay length of 2 mm, the node pitch.
    fn default() -> Self {
        let radius_mm = Self::RADIUS_MM;
        Self {
            shape: IndenterShape::Sphere { radius_mm },
            spread_mm: 2.0,
        }
    }
}

impl Indenter {
    /// Default sizes.
    const RADIUS_MM: Radii = Radii {
        smallest: 2.0,
        largest: 6.0,
    };
    /// Default tilt.
    const TILT_DEGREES: f64 = 5.0;

    /// Returns the four shapes with default sizes and tilts, in the order of [`IndenterShape`].
    pub fn all() -> [Self; 4] {
        let (radius_mm, largest_tilt_degrees) = (Self::RADIUS_MM, Self::TILT_DEGREES);
        let body = TiltedBody {
            radius_mm,
            largest_tilt_degrees,
        };
        let shapes = [
            IndenterShape::Sphere { radius_mm },
            IndenterShape::FlatPunch(body),
            IndenterShape::Cylinder(body),
            IndenterShape::Edge { largest_tilt_degrees },
        ];
        shapes.map(|shape| Self {
            shape,
            ..Self::default()
        })
    }

    /// Returns the name of the shape.
    pub fn name(&self) -> &'static str {
        self.shape.into()
    }

    /// Returns the radius in mm, if the shape has one, and the largest tilt in degrees.
    pub fn radius_mm_and_tilt_degrees(&self) -> (Option<Radii>, f64) {
        match self.shape {
            IndenterShape::Sphere { radius_mm } => (Some(radius_mm), 0.0),
            IndenterShape::FlatPunch(body) | IndenterShape::Cylinder(body) => {
                (Some(body.radius_mm), body.largest_tilt_degrees)
            }
            IndenterShape::Edge { largest_tilt_degrees } => (None, largest_tilt_degrees),
        }
    }

    pub(in crate::scene) fn check(&self) -> Result<(), SceneError> {
        if !(self.spread_mm > 0.0 && self.spread_mm.is_finite()) {
            return Err(SceneError::Spread(self.spread_mm));
        }
        let (radius, tilt) = self.radius_mm_and_tilt_degrees();
        if let Some(span) = radius
            && !(span.smallest > 0.0 && span.smallest <= span.largest && span.largest.is_finite())
        {
            return Err(SceneError::Radius(span));
        }
        if !(0.0..=45.0).contains(&tilt) {
            return Err(SceneError::Tilt(tilt));
        }
        Ok(())
    }

    /// Draws one press: its position is uniform over the nodes, its depth uniform up to the stroke.
    pub(super) fn draw(&self, model: &SensorModel, stroke_mm: f64, rng: &mut impl Rng) -> Press {
        let scale = model.scale;
        let first = model.geometry.row_node_mm(scale, 0, 0);
        let last = model
            .geometry
            .row_node_mm(scale, scale.rows() - 1, scale.nodes_per_row() - 1);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let place = DVec2::new(between(first.x, last.x), between(first.y, last.y));
        let depth_mm = between(0.0, stroke_mm);
        let direction = DVec2::from_angle(between(0.0, std::f64::consts::TAU));
        let (radius_mm, largest_tilt_degrees) = self.radius_mm_and_tilt_degrees();
        let slope = match self.shape {
            IndenterShape::Sphere { .. } => 0.0,
            _ => between(0.0, largest_tilt_degrees).to_radians().tan(),
        };
        let radius_mm = radius_mm.map_or(0.0, |span| between(span.smallest, span.largest));
        Press::new(*self, radius_mm, place, depth_mm, direction, slope)
    }

    /// Returns the deformation of the array when the upright indenter of middle size presses `depth_mm` deep at (x, y); a
    /// cylinder or an edge is along y.
    pub fn press(&self, model: &SensorModel, place_mm: DVec2, depth_mm: f64) -> Deformation {
        let press = self.upright(place_mm, depth_mm);
        Deformation::from_fn(model.scale, |row, node| {
            let rest_mm = model.geometry.row_node_mm(model.scale, row, node);
            let depth_at_mm = press.depth_at_mm(rest_mm.x, rest_mm.y);
            DVec3::Z * depth_at_mm.clamp(0.0, depth_mm)
        })
    }

    /// Returns half the width of the part of the surface that touches the upright indenter of middle size: the radius of the
    /// disc under a ball or a punch, half the width of the strip along y under a cylinder; infinite for an edge, which touches
    /// the half-plane to the left of its line.
    pub fn contact_half_width_mm(&self, depth_mm: f64) -> f64 {
        self.upright(DVec2::ZERO, depth_mm).contact_half_width_mm()
    }

    fn upright(&self, place_mm: DVec2, depth_mm: f64) -> Press {
        let radius_mm = (self.radius_mm_and_tilt_degrees().0).map_or(0.0, |span| 0.5 * (span.smallest + span.largest));
        Press::new(*self, radius_mm, place_mm, depth_mm, DVec2::Y, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_bodies_are_reported() {
        let mut indenter = Indenter::default();
        assert!(indenter.check().is_ok());
        indenter.spread_mm = 0.0;
        assert_eq!(indenter.check(), Err(SceneError::Spread(0.0)));
        let backwards = Radii {
            smallest: 3.0,
            largest: 2.0,
        };
        let sphere = Indenter {
            shape: IndenterShape::Sphere { radius_mm: backwards },
            ..Indenter::default()
        };
        assert_eq!(sphere.check(), Err(SceneError::Radius(backwards)));
        let steep = Indenter {
            shape: IndenterShape::Edge {
                largest_tilt_degrees: 90.0,
            },
            ..Indenter::default()
        };
        assert_eq!(steep.check(), Err(SceneError::Tilt(90.0)));
    }
}
