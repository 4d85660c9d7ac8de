use glam::DVec2;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::{scene::SceneError, sensor::SensorModel};

/// A body pressed somewhere onto the surface: place, depth, size, direction and tilt are drawn for each snapshot.
///
/// Under the body the surface follows it; around it the surface comes back as exp(−distance / spread): a sheet under
/// tension on an elastic foundation (Pasternak 1954), of which `spread_mm` is the characteristic length. A round body touches the
/// sheet as far as its slope equals that of the free surface, so that there is no kink.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Indenter {
    /// Its shape with the range of its sizes.
    pub shape: IndenterShape,
    /// Distance over which the surface comes back around the body.
    pub spread_mm: f64,
}

/// Shapes of an indenter. Tilts are the largest slope against the surface; each is drawn from 0 to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IndenterShape {
    /// A ball.
    Sphere {
        /// Its radius.
        radius_mm: Span,
    },
    /// The flat end of a round bar.
    FlatPunch {
        /// Its radius.
        radius_mm: Span,
        /// Largest slope of its face.
        largest_tilt_degrees: f64,
    },
    /// A bar lying across the whole surface, in any direction.
    Cylinder {
        /// Its radius.
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
    /// The smallest.
    pub smallest: f64,
    /// The largest.
    pub largest: f64,
}

impl Span {
    fn draw(self, rng: &mut impl Rng) -> f64 {
        self.smallest + (self.largest - self.smallest) * rng.random::<f64>()
    }
}

impl Default for Indenter {
    /// Balls of 2 to 6 mm radius; the surface comes back within 2 mm, the node pitch.
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
    /// Sizes offered.
    pub const RADIUS_MM: Span = Span {
        smallest: 2.0,
        largest: 6.0,
    };
    /// Tilt offered.
    pub const TILT_DEGREES: f64 = 5.0;

    /// The four shapes with sizes and tilts as offered, in the order of [`IndenterShape`].
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

    /// Its name.
    pub fn name(&self) -> &'static str {
        match self.shape {
            IndenterShape::Sphere { .. } => "sphere",
            IndenterShape::FlatPunch { .. } => "flat punch",
            IndenterShape::Cylinder { .. } => "cylinder",
            IndenterShape::Edge { .. } => "edge",
        }
    }

    pub(in crate::scene) fn check(&self) -> Result<(), SceneError> {
        if !(self.spread_mm > 0.0 && self.spread_mm.is_finite()) {
            return Err(SceneError::Spread(self.spread_mm));
        }
        let (radius, tilt) = match self.shape {
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
        };
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

    /// Draws one press: its place uniform over the nodes, its depth uniform up to the stroke.
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
        let mut slope = |largest_degrees: f64| between(0.0, largest_degrees).to_radians().tan();
        let (slope, body) = match self.shape {
            IndenterShape::Sphere { radius_mm } => (0.0, Body::Sphere(radius_mm.draw(rng))),
            IndenterShape::FlatPunch {
                radius_mm,
                largest_tilt_degrees,
            } => (slope(largest_tilt_degrees), Body::FlatPunch(radius_mm.draw(rng))),
            IndenterShape::Cylinder {
                radius_mm,
                largest_tilt_degrees,
            } => (slope(largest_tilt_degrees), Body::Cylinder(radius_mm.draw(rng))),
            IndenterShape::Edge { largest_tilt_degrees } => (slope(largest_tilt_degrees), Body::Edge),
        };
        Press {
            body,
            place,
            depth_mm,
            direction,
            slope,
            spread_mm: self.spread_mm,
        }
    }
}

/// A body with its radius in millimetres.
#[derive(Clone, Copy, Debug)]
enum Body {
    Sphere(f64),
    FlatPunch(f64),
    Cylinder(f64),
    Edge,
}

/// One press of an indenter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Press {
    body: Body,
    place: DVec2,
    /// Depth of the middle of the body.
    depth_mm: f64,
    /// Unit vector along which the body is inclined; the axis of a cylinder, the line of an edge.
    direction: DVec2,
    /// Depth gained for each millimetre along `direction`.
    slope: f64,
    spread_mm: f64,
}

impl Press {
    /// How far the surface is pressed at (x, y), in millimetres; below 0 where a tilted body lifts off.
    pub(super) fn depth_at_mm(&self, x: f64, y: f64) -> f64 {
        let apart = DVec2::new(x, y) - self.place;
        let (along, across) = (apart.dot(self.direction), apart.perp_dot(self.direction));
        match self.body {
            Body::Sphere(radius) => self.round(self.depth_mm, radius, apart.length()),
            Body::Cylinder(radius) => self.round(self.depth_mm + self.slope * along, radius, across),
            Body::FlatPunch(radius) => {
                // Outside, the surface starts from the nearest point of the face.
                let inside = (radius / apart.length()).min(1.0);
                let at_face = self.depth_mm + self.slope * along * inside;
                at_face * (-(apart.length() - radius).max(0.0) / self.spread_mm).exp()
            }
            Body::Edge => (self.depth_mm + self.slope * along) * (-across.max(0.0) / self.spread_mm).exp(),
        }
    }

    /// A round body of this depth and radius at `distance` from its middle: the parabola depth − distance²/(2 radius)
    /// up to where its slope equals the free surface's, a/radius = depth(a)/spread, and that surface beyond.
    fn round(&self, depth_mm: f64, radius: f64, distance: f64) -> f64 {
        if depth_mm <= 0.0 {
            return 0.0;
        }
        let contact = (self.spread_mm * self.spread_mm + 2.0 * radius * depth_mm).sqrt() - self.spread_mm;
        let distance = distance.abs();
        let inside = distance.min(contact);
        let at_body = depth_mm - inside * inside / (2.0 * radius);
        at_body * (-(distance - inside) / self.spread_mm).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(body: Body, slope: f64) -> Press {
        Press {
            body,
            place: DVec2::new(3.0, -1.0),
            depth_mm: 0.8,
            direction: DVec2::X,
            slope,
            spread_mm: 2.0,
        }
    }

    #[test]
    fn the_surface_follows_the_body_and_comes_back() {
        let sphere = press(Body::Sphere(4.0), 0.0);
        assert!((sphere.depth_at_mm(3.0, -1.0) - 0.8).abs() < 1e-15);
        assert!((sphere.depth_at_mm(3.5, -1.0) - (0.8 - 0.25 / 8.0)).abs() < 1e-15);
        assert!(sphere.depth_at_mm(30.0, -1.0) < 1e-4);
        let punch = press(Body::FlatPunch(2.0), 0.0);
        assert!((punch.depth_at_mm(3.0, 0.9) - 0.8).abs() < 1e-15);
        assert!((punch.depth_at_mm(3.0, 3.0) - 0.8 * (-1.0_f64).exp()).abs() < 1e-15);
        let edge = press(Body::Edge, 0.0);
        let (one, other) = (edge.depth_at_mm(3.0, 5.0), edge.depth_at_mm(3.0, -7.0));
        assert_eq!(one.max(other), 0.8);
        assert!((one.min(other) - 0.8 * (-3.0_f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn a_round_body_leaves_no_kink() {
        let sphere = press(Body::Sphere(4.0), 0.0);
        let slope =
            |at: f64| (sphere.depth_at_mm(3.0 + at + 1e-6, -1.0) - sphere.depth_at_mm(3.0 + at - 1e-6, -1.0)) / 2e-6;
        let mut last = slope(0.01);
        for step in 2..600 {
            let next = slope(0.01 * f64::from(step));
            assert!((next - last).abs() < 0.01, "{step}");
            last = next;
        }
    }

    #[test]
    fn a_tilted_body_presses_deeper_along_its_tilt() {
        for body in [Body::FlatPunch(2.0), Body::Cylinder(4.0), Body::Edge] {
            let press = press(body, 0.1);
            let rise = press.depth_at_mm(4.0, -1.0) - press.depth_at_mm(2.0, -1.0);
            assert!((rise - 0.2).abs() < 1e-12, "{body:?} {rise}");
        }
    }

    #[test]
    fn impossible_bodies_are_named() {
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
}
