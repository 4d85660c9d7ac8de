//! A camera that circles the plot.
//!
//! From points on the screen back to millimetres.

use glam::{DVec2, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{box_axes::PlanAxes, projection::Projection};

const RADIANS_PER_POINT: f32 = 0.008;
const RADIANS_PER_KEY: f32 = 0.1;
const ZOOM_PER_POINT: f32 = 0.0025;
const ZOOM_PER_KEY: f32 = 1.15;
/// Always from above: the floor of the box is never in front of the surface.
const PITCH: std::ops::RangeInclusive<f32> = 0.09..=1.5;
const ZOOM: std::ops::RangeInclusive<f32> = 0.5..=8.0;
const PAN: std::ops::RangeInclusive<f32> = -2.0..=2.0;

/// Camera that orbits the plot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OrbitCamera {
    /// Direction of the eye in the x-y plane, radians from the x axis.
    pub yaw: f32,
    /// Elevation of the eye, radians.
    pub pitch: f32,
    /// 1 makes the plot fill its card.
    pub zoom: f32,
    /// Shift to the right and down, in card widths and heights.
    pub pan: [f32; 2],
}

impl Default for OrbitCamera {
    fn default() -> Self {
        Self {
            yaw: -0.9,
            pitch: 0.5,
            zoom: 1.0,
            pan: [0.0; 2],
        }
    }
}

impl OrbitCamera {
    /// Unit vector from the middle of the plot towards the eye; z points up.
    pub fn towards_eye(&self) -> Vec3 {
        Vec3::new(
            self.pitch.cos() * self.yaw.cos(),
            self.pitch.cos() * self.yaw.sin(),
            self.pitch.sin(),
        )
    }

    /// Turned as if the plot were dragged by this many points to the right and down.
    #[must_use]
    pub fn dragged(self, right: f32, down: f32) -> Self {
        self.turned(right * RADIANS_PER_POINT, down * RADIANS_PER_POINT)
    }

    /// Turned by this many presses of an arrow key.
    #[must_use]
    pub fn stepped(self, right: f32, down: f32) -> Self {
        self.turned(right * RADIANS_PER_KEY, down * RADIANS_PER_KEY)
    }

    fn turned(self, right: f32, down: f32) -> Self {
        Self {
            yaw: self.yaw - right,
            pitch: self.pitch + down,
            ..self
        }
        .clamped()
    }

    /// Nearer by this many points of scrolling.
    #[must_use]
    pub fn scrolled(self, points: f32) -> Self {
        self.zoomed((points * ZOOM_PER_POINT).exp())
    }

    /// Nearer by this many presses of a key.
    #[must_use]
    pub fn zoomed_by_keys(self, presses: f32) -> Self {
        self.zoomed(ZOOM_PER_KEY.powf(presses))
    }

    /// Nearer by a factor.
    #[must_use]
    pub fn zoomed(self, factor: f32) -> Self {
        Self {
            zoom: self.zoom * factor,
            ..self
        }
        .clamped()
    }

    /// Shifted by a part of the card to the right and down.
    #[must_use]
    pub fn panned(self, right: f32, down: f32) -> Self {
        Self {
            pan: [self.pan[0] + right, self.pan[1] + down],
            ..self
        }
        .clamped()
    }

    /// As seen at zoom 1, in the middle of the card.
    #[must_use]
    pub fn centred(self) -> Self {
        Self {
            zoom: 1.0,
            pan: [0.0; 2],
            ..self
        }
    }

    /// Within the limits, whatever a saved state says.
    #[must_use]
    pub fn clamped(self) -> Self {
        let start = Self::default();
        let finite = |value: f32, otherwise: f32| if value.is_finite() { value } else { otherwise };
        let (turn, yaw) = (std::f32::consts::TAU, finite(self.yaw, start.yaw));
        // A camera within the limits keeps its bits: being looked at is no change.
        let is_wound = yaw.abs() > 0.5 * turn;
        Self {
            yaw: if is_wound {
                (yaw + 0.5 * turn).rem_euclid(turn) - 0.5 * turn
            } else {
                yaw
            },
            pitch: finite(self.pitch, start.pitch).clamp(*PITCH.start(), *PITCH.end()),
            zoom: finite(self.zoom, start.zoom).clamp(*ZOOM.start(), *ZOOM.end()),
            pan: self.pan.map(|part| finite(part, 0.0).clamp(*PAN.start(), *PAN.end())),
        }
    }
}

const AMBIENT: f32 = 0.66;
const DIRECT: f32 = 0.38;

/// Lambert's law, with a light that follows the viewer: from above, over the left shoulder.
pub(super) struct Shade<'a> {
    units: &'a [Vec3],
    nx: usize,
    ny: usize,
    light: Vec3,
}

impl<'a> Shade<'a> {
    pub(super) fn new(units: &'a [Vec3], ny: usize, eye: Vec3) -> Self {
        let towards_eye = Vec3::new(eye.x, eye.y, 0.0).normalize_or(Vec3::X);
        let left = Vec3::new(towards_eye.y, -towards_eye.x, 0.0);
        let light = (towards_eye * 0.35 + left * 0.55 + Vec3::Z * 0.9).normalize();
        Self {
            units,
            nx: units.len() / ny,
            ny,
            light,
        }
    }

    pub(super) fn at(&self, ix: usize, iy: usize) -> f32 {
        let unit = |ix: usize, iy: usize| self.units[ix * self.ny + iy];
        let slope_x = unit((ix + 1).min(self.nx - 1), iy) - unit(ix.saturating_sub(1), iy);
        let slope_y = unit(ix, (iy + 1).min(self.ny - 1)) - unit(ix, iy.saturating_sub(1));
        // NaN falls through `max` as darkness, on points that are not drawn.
        AMBIENT + DIRECT * slope_x.cross(slope_y).normalize_or(Vec3::Z).dot(self.light).max(0.0)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dragging_there_and_back_changes_nothing() {
        let camera = OrbitCamera::default();
        let back = camera.dragged(40.0, -10.0).dragged(-40.0, 10.0);
        assert!((back.yaw - camera.yaw).abs() < 1e-5 && (back.pitch - camera.pitch).abs() < 1e-5);
    }

    #[test]
    fn the_eye_stays_above_the_floor() {
        for down in [-1e6, 1e6] {
            let eye = OrbitCamera::default().dragged(0.0, down).towards_eye();
            assert!(eye.z > 0.05 && eye.z < 0.999);
        }
    }

    #[test]
    fn a_broken_saved_camera_is_repaired() {
        let camera = OrbitCamera {
            yaw: f32::NAN,
            pitch: f32::INFINITY,
            zoom: -1.0,
            pan: [f32::NAN, 9.0],
        }
        .clamped();
        assert_eq!(
            camera,
            OrbitCamera {
                zoom: 0.5,
                pan: [0.0, 2.0],
                ..OrbitCamera::default()
            }
        );
    }

    #[test]
    fn the_camera_survives_saving() {
        let camera = OrbitCamera::default().dragged(12.0, 3.0).panned(0.1, 0.0);
        let text = serde_json::to_string(&camera).expect("plain numbers");
        assert_eq!(
            serde_json::from_str::<OrbitCamera>(&text).expect("written by us"),
            camera
        );
        assert_eq!(
            serde_json::from_str::<OrbitCamera>("{}").expect("all fields have defaults"),
            OrbitCamera::default()
        );
    }
}
