use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::press::{Body, Contact, Press};
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IndenterShape {
    /// A ball.
    Sphere {
        /// Radius.
        radius_mm: Span,
    },
    /// The flat end of a round bar.
    FlatPunch {
        /// Radius.
        radius_mm: Span,
        /// Largest slope of its face.
        largest_tilt_degrees: f64,
    },
    /// A bar lying across the whole surface, in any direction.
    Cylinder {
        /// Radius.
        radius_mm: Span,
        /// Largest slope along its axis.
        largest_tilt_degrees: f64,
    },
    /// The straight edge of a large block, in any direction; one side of it is pressed.
    Edge {
        /// Largest slope along the edge.
        largest_tilt_degrees: f64,
    },
}

/// A range of lengths, drawn uniformly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// Minimum.
    pub smallest: f64,
    /// Maximum.
    pub largest: f64,
}

impl Default for Indenter {
    /// Balls of 2 to 6 mm radius; the surface recovers with a decay length of 2 mm, the node pitch.
    fn default() -> Self {
        Self {
            shape: IndenterShape::Sphere {
                radius_mm: Self::RADIUS_MM,
            },
            spread_mm: 2.0,
        }
    }
}

impl Indenter {
    /// Default sizes.
    const RADIUS_MM: Span = Span {
        smallest: 2.0,
        largest: 6.0,
    };
    /// Default tilt.
    const TILT_DEGREES: f64 = 5.0;

    /// Returns the four shapes with default sizes and tilts, in the order of [`IndenterShape`].
    pub fn all() -> [Self; 4] {
        let radius_mm = Self::RADIUS_MM;
        let largest_tilt_degrees = Self::TILT_DEGREES;
        let shapes = [
            IndenterShape::Sphere { radius_mm },
            IndenterShape::FlatPunch {
                radius_mm,
                largest_tilt_degrees,
            },
            IndenterShape::Cylinder {
                radius_mm,
                largest_tilt_degrees,
            },
            IndenterShape::Edge { largest_tilt_degrees },
        ];
        shapes.map(|shape| Self {
            shape,
            ..Self::default()
        })
    }

    /// Returns the name of the shape.
    pub fn name(&self) -> &'static str {
        match self.shape {
            IndenterShape::Sphere { .. } => "sphere",
            IndenterShape::FlatPunch { .. } => "flat punch",
            IndenterShape::Cylinder { .. } => "cylinder",
            IndenterShape::Edge { .. } => "edge",
        }
    }

    /// Returns the radius in mm, if the shape has one, and the largest tilt in degrees.
    pub fn radius_mm_and_tilt_degrees(&self) -> (Option<Span>, f64) {
        match self.shape {
            IndenterShape::Sphere { radius_mm } => (Some(radius_mm), 0.0),
            IndenterShape::FlatPunch {
                radius_mm,
                largest_tilt_degrees,
            }
            | IndenterShape::Cylinder {
                radius_mm,
                largest_tilt_degrees,
            } => (Some(radius_mm), largest_tilt_degrees),
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
        Press::new(self.body(radius_mm), place, depth_mm, direction, slope, self.spread_mm)
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

    /// Returns the part of the surface that touches the pressed indenter.
    pub fn contact(&self, depth_mm: f64) -> Contact {
        self.upright(DVec2::ZERO, depth_mm).contact()
    }

    fn upright(&self, place_mm: DVec2, depth_mm: f64) -> Press {
        let radius_mm = (self.radius_mm_and_tilt_degrees().0).map_or(0.0, |span| 0.5 * (span.smallest + span.largest));
        Press::new(self.body(radius_mm), place_mm, depth_mm, DVec2::Y, 0.0, self.spread_mm)
    }

    fn body(&self, radius_mm: f64) -> Body {
        match self.shape {
            IndenterShape::Sphere { .. } => Body::Sphere(radius_mm),
            IndenterShape::FlatPunch { .. } => Body::FlatPunch(radius_mm),
            IndenterShape::Cylinder { .. } => Body::Cylinder(radius_mm),
            IndenterShape::Edge { .. } => Body::Edge,
        }
    }
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

    #[test]
    fn invalid_bodies_are_reported() {
        let mut indenter = Indenter::default();
        assert!(indenter.check().is_ok());
        indenter.spread_mm = 0.0;
        assert_eq!(indenter.check(), Err(SceneError::Spread(0.0)));
        let backwards = Span {
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

    fn model() -> SensorModel {
        SensorModel::new("10x6_3x18".parse().unwrap())
    }

    #[test]
    fn a_punch_presses_the_nodes_under_its_face_and_leaves_those_far_away() {
        let model = model();
        let middle = model.geometry.row_node_mm(model.scale, 4, 2);
        let indenter = Indenter::all()[1];
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
