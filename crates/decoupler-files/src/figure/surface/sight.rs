//! From points on the screen back to millimetres.

use glam::{DVec2, DVec3};

use super::{plan_axes::PlanAxes, projection::Projection};

/// The line of sight through each point of a laid-out surface: the inverse of how it is drawn, in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// From the eye of the camera.
    Eye(EyeSight),
    /// From straight above.
    Above(AboveSight),
}

/// Sight in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeSight {
    /// The middle of the box, where the eye looks.
    middle_mm: DVec3,
    /// Box units per millimetre.
    per_mm: DVec3,
    /// The eye, in box units around that middle.
    eye: DVec3,
    /// Unit vectors in box units: away from the eye, to the right and up on the screen.
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    /// Points on the screen of a tangent of 1.
    points: f64,
    /// The point on the screen where the eye looks.
    offset: DVec2,
}

/// Sight from above, x to the right and y upwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AboveSight {
    /// A place and its point on the screen.
    corner_mm: DVec2,
    corner: DVec2,
    points_per_mm: f64,
}

/// A line of sight, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Its begin.
    pub from_mm: DVec3,
    /// Its direction, of any length.
    pub direction: DVec3,
}

impl Sight {
    pub(super) fn of_projection(projection: &Projection) -> Self {
        let (plot_box, eye) = (&projection.plot_box, projection.eye.as_dvec3());
        // The camera never looks straight down, so that it has a right-hand side.
        let forward = -eye.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let (points, offset) = projection.points_and_offset();
        Self::Eye(EyeSight {
            middle_mm: plot_box.middle_mm,
            per_mm: plot_box.per_mm,
            eye,
            forward,
            right,
            up: right.cross(forward),
            points,
            offset,
        })
    }

    pub(super) fn of_plan(plan: &PlanAxes<'_>) -> Self {
        let (corner_mm, corner, points_per_mm) = plan.corner();
        Self::Above(AboveSight {
            corner_mm,
            corner: corner.as_dvec2(),
            points_per_mm,
        })
    }

    /// Returns the point on the screen of a place.
    pub fn point(&self, place_mm: DVec3) -> DVec2 {
        match self {
            Self::Eye(sight) => {
                let apart = (place_mm - sight.middle_mm) * sight.per_mm - sight.eye;
                let depth = apart.dot(sight.forward);
                let (right, up) = (apart.dot(sight.right) / depth, apart.dot(sight.up) / depth);
                sight.offset + DVec2::new(right, -up) * sight.points
            }
            Self::Above(sight) => {
                let apart = (place_mm.truncate() - sight.corner_mm) * sight.points_per_mm;
                sight.corner + DVec2::new(apart.x, -apart.y)
            }
        }
    }

    /// Returns the line of sight through a point on the screen.
    pub fn ray(&self, at: DVec2) -> Ray {
        match self {
            Self::Eye(sight) => {
                let tangents = (at - sight.offset) / sight.points;
                let direction = sight.forward + sight.right * tangents.x - sight.up * tangents.y;
                Ray {
                    from_mm: sight.middle_mm + sight.eye / sight.per_mm,
                    direction: direction / sight.per_mm,
                }
            }
            Self::Above(sight) => {
                let apart = (at - sight.corner) / sight.points_per_mm;
                let place = sight.corner_mm + DVec2::new(apart.x, -apart.y);
                Ray {
                    from_mm: place.extend(0.0),
                    direction: DVec3::NEG_Z,
                }
            }
        }
    }

    /// Returns the height at which the upright line through `foot_mm` comes nearest to a point on the screen; `None` where
    /// it is seen end-on, `stroke_mm` of it less than ten points long.
    pub fn height_mm(&self, foot_mm: DVec3, stroke_mm: f64, at: DVec2) -> Option<f64> {
        const SHORTEST_POINTS: f64 = 10.0;
        let foot = self.point(foot_mm);
        let along = (self.point(foot_mm - DVec3::Z * stroke_mm) - foot) / stroke_mm;
        if along.length() * stroke_mm < SHORTEST_POINTS {
            return None;
        }
        let Self::Eye(sight) = self else { return None };
        // The point moved onto the image of the line, which is straight, and back from there into space: the place on the
        // line whose tangents are those of the point, a(z) / b(z) with both linear in z.
        let image = foot + along * ((at - foot).dot(along) / along.length_squared());
        let tangents = (image - sight.offset) / sight.points;
        let axis = if along.x.abs() > along.y.abs() {
            sight.right - sight.forward * tangents.x
        } else {
            sight.up + sight.forward * tangents.y
        };
        let apart = (foot_mm - sight.middle_mm) * sight.per_mm - sight.eye;
        let per_mm = sight.per_mm.z * axis.z;
        let height_mm = foot_mm.z - apart.dot(axis) / per_mm;
        Some(height_mm).filter(|height_mm| height_mm.is_finite())
    }
}

impl Ray {
    /// Returns where the ray meets the level `z_mm`; `None` if it never does.
    pub fn at_level(&self, z_mm: f64) -> Option<DVec3> {
        let share = (z_mm - self.from_mm.z) / self.direction.z;
        let is_straight_down = self.direction.truncate() == DVec2::ZERO;
        if !share.is_finite() || (share < 0.0 && !is_straight_down) {
            return None;
        }
        Some((self.from_mm + self.direction * share).with_z(z_mm))
    }
}
