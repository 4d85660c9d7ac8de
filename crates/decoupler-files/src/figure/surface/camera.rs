//! A camera that orbits the plot, and the projection from millimetres to points on the screen and back.

use glam::{DVec2, DVec3, Mat4, Vec2, Vec3, camera::rh};
use serde::{Deserialize, Serialize};

use super::box_axes::PlanAxes;
use crate::figure::drawing::Bounds;

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

    /// Returns the camera turned as if the plot were dragged by this many points to the right and down.
    #[must_use]
    pub fn dragged(self, right: f32, down: f32) -> Self {
        self.turned(right * RADIANS_PER_POINT, down * RADIANS_PER_POINT)
    }

    /// Returns the camera turned by this many presses of an arrow key.
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

    /// Returns the camera moved nearer by this many points of scrolling.
    #[must_use]
    pub fn scrolled(self, points: f32) -> Self {
        self.zoomed((points * ZOOM_PER_POINT).exp())
    }

    /// Returns the camera moved nearer by this many presses of a key.
    #[must_use]
    pub fn zoomed_by_keys(self, presses: f32) -> Self {
        self.zoomed(ZOOM_PER_KEY.powf(presses))
    }

    /// Returns the camera moved nearer by a factor.
    #[must_use]
    pub fn zoomed(self, factor: f32) -> Self {
        Self {
            zoom: self.zoom * factor,
            ..self
        }
        .clamped()
    }

    /// Returns the camera shifted by a fraction of the card to the right and down.
    #[must_use]
    pub fn panned(self, right: f32, down: f32) -> Self {
        Self {
            pan: [self.pan[0] + right, self.pan[1] + down],
            ..self
        }
        .clamped()
    }

    /// Returns the camera at zoom 1, with the plot in the middle of the card.
    #[must_use]
    pub fn centred(self) -> Self {
        Self {
            zoom: 1.0,
            pan: [0.0; 2],
            ..self
        }
    }

    /// Returns the camera moved into its limits, which a saved state may violate.
    #[must_use]
    pub fn clamped(self) -> Self {
        let start = Self::default();
        let finite = |value: f32, otherwise: f32| if value.is_finite() { value } else { otherwise };
        let (turn, yaw) = (std::f32::consts::TAU, finite(self.yaw, start.yaw));
        // A camera within the limits keeps its bits: checking it changes nothing.
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
        // NaN becomes 0 in `max`, at points that are not drawn.
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
    /// Its origin.
    pub from_mm: DVec3,
    /// Its direction, of any length.
    pub direction: DVec3,
}

impl Sight {
    pub(super) fn of_projection(projection: &Projection) -> Self {
        let (plot_box, eye) = (&projection.plot_box, projection.eye.as_dvec3());
        // The camera never looks straight down, so its right-hand side is defined.
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

    /// Returns the height at which the vertical line through `foot_mm` comes nearest to a point on the screen; `None`
    /// if it is seen end-on, with `stroke_mm` of it shorter than ten points.
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
    /// Returns the place where the ray reaches the level `z_mm`; `None` if it never does.
    pub fn at_level(&self, z_mm: f64) -> Option<DVec3> {
        let share = (z_mm - self.from_mm.z) / self.direction.z;
        let is_straight_down = self.direction.truncate() == DVec2::ZERO;
        if !share.is_finite() || (share < 0.0 && !is_straight_down) {
            return None;
        }
        Some((self.from_mm + self.direction * share).with_z(z_mm))
    }
}

/// Distance of the eye in half diagonals of the box: a mild perspective.
const EYE_DISTANCE: f32 = 4.0;
/// Minimum ratio of the box's horizontal sides; longer arrays are drawn shortened.
const MIN_SIDE: f32 = 0.3;
/// Angle of view, in radians; the view is scaled to fit in any case.
const VIEW: f32 = 0.5;
/// Heights of the box in units of its longer horizontal side: within these, the picture gets the shape of its card.
const HEIGHT: std::ops::RangeInclusive<f32> = 0.4..=1.35;

/// The box of the axes: millimetres on three axes, and its shape in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlotBox {
    pub(super) min_mm: DVec3,
    pub(super) max_mm: DVec3,
    /// Sides in box units; the longer horizontal side is 1.
    sides: Vec3,
    /// Box units per millimetre.
    pub(super) per_mm: DVec3,
    pub(super) middle_mm: DVec3,
}

impl PlotBox {
    /// A box whose height, at the camera's start, gives the picture the ratio of height to width `tall_per_wide`: x and
    /// y keep their proportions, z is exaggerated.
    pub(super) fn new(min_mm: DVec3, max_mm: DVec3, tall_per_wide: f32) -> Self {
        let size = (max_mm - min_mm).as_vec3();
        let longer = size.x.max(size.y);
        let (a, b) = ((size.x / longer).max(MIN_SIDE), (size.y / longer).max(MIN_SIDE));
        let of_height = |height: f32| {
            let sides = Vec3::new(a, b, height);
            let per_mm = sides.as_dvec3() / (max_mm - min_mm);
            Self {
                min_mm,
                max_mm,
                sides,
                per_mm,
                middle_mm: 0.5 * (min_mm + max_mm),
            }
        };
        // The ratio increases with the height, so bisection finds the height.
        let (mut low, mut high) = (*HEIGHT.start(), *HEIGHT.end());
        let unbounded = Bounds {
            min: Vec2::ZERO,
            max: Vec2::ONE,
        };
        for _ in 0..12 {
            let height = 0.5 * (low + high);
            let seen = Projection::fit(of_height(height), OrbitCamera::default(), unbounded)
                .bounds()
                .size();
            if seen.y / seen.x < tall_per_wide {
                low = height;
            } else {
                high = height;
            }
        }
        of_height(0.5 * (low + high))
    }

    /// Box units of a place; the middle of the box is the origin.
    pub(super) fn unit(&self, place_mm: DVec3) -> Vec3 {
        ((place_mm - self.middle_mm) * self.per_mm).as_vec3()
    }

    /// Millimetres of a place in box units.
    pub(super) fn place_mm(&self, unit: Vec3) -> DVec3 {
        self.middle_mm + unit.as_dvec3() / self.per_mm
    }

    /// A corner; each part 0 or 1.
    pub(super) fn corner_mm(&self, x: usize, y: usize, z: usize) -> DVec3 {
        let pick = |from: f64, to: f64, end: usize| if end == 0 { from } else { to };
        DVec3::new(
            pick(self.min_mm.x, self.max_mm.x, x),
            pick(self.min_mm.y, self.max_mm.y, y),
            pick(self.min_mm.z, self.max_mm.z, z),
        )
    }

    fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        (0..8).map(|i| self.corner_mm(i & 1, (i >> 1) & 1, i >> 2))
    }
}

/// A box seen by a camera, fitted into a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) plot_box: PlotBox,
    /// The eye in box units.
    pub(super) eye: Vec3,
    matrix: Mat4,
    scale: f32,
    offset: Vec2,
}

impl Projection {
    /// At zoom 1 the eight corners just touch `target` at any angles.
    pub(super) fn fit(plot_box: PlotBox, camera: OrbitCamera, target: Bounds) -> Self {
        let distance = EYE_DISTANCE * 0.5 * plot_box.sides.length();
        let eye = camera.towards_eye() * distance;
        let view = rh::view::look_at_mat4(eye, Vec3::ZERO, Vec3::Z);
        let lens = rh::proj::opengl::perspective(VIEW, 1.0, 0.05 * distance, 4.0 * distance);
        let mut fitted = Self {
            plot_box,
            eye,
            matrix: lens * view,
            scale: 1.0,
            offset: Vec2::ZERO,
        };
        let raw = Bounds::of(plot_box.corners().map(|corner| fitted.point(corner)));
        let ratio = target.size() / raw.size();
        fitted.scale = ratio.x.min(ratio.y).max(0.0) * camera.zoom;
        let pan = Vec2::from(camera.pan) * target.size();
        fitted.offset = target.middle() + pan - raw.middle() * fitted.scale;
        fitted
    }

    /// Returns the position of a place on the screen.
    pub(super) fn point(&self, place_mm: DVec3) -> Vec2 {
        self.point_of_unit(self.plot_box.unit(place_mm))
    }

    /// Returns the position on the screen of a place in box units.
    pub(super) fn point_of_unit(&self, unit: Vec3) -> Vec2 {
        let seen = self.matrix.project_point3(unit);
        Vec2::new(seen.x, -seen.y) * self.scale + self.offset
    }

    /// Points on the screen of a tangent of 1, and the point where the eye looks.
    pub(super) fn points_and_offset(&self) -> (f64, DVec2) {
        let per_tangent = 1.0 / (0.5 * f64::from(VIEW)).tan();
        (per_tangent * f64::from(self.scale), self.offset.as_dvec2())
    }

    /// The rectangle that the box covers.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds::of(self.plot_box.corners().map(|corner| self.point(corner)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dragging_forth_and_back_changes_nothing() {
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

    #[test]
    fn the_box_fills_its_rectangle_from_every_angle() {
        let target = Bounds {
            min: Vec2::new(20.0, 30.0),
            max: Vec2::new(320.0, 500.0),
        };
        let plot_box = PlotBox::new(DVec3::new(7.5, 5.5, 4.0), DVec3::new(17.5, 25.5, 5.0), 470.0 / 300.0);
        for step in 0..60 {
            let camera = OrbitCamera::default().dragged(13.0 * step as f32, 3.0 * step as f32 - 60.0);
            let bounds = Projection::fit(plot_box, camera, target).bounds();
            let slack = target.size() - bounds.size();
            assert!(
                slack.min_element().abs() < 0.1 && slack.max_element() > -0.1,
                "{slack} at {camera:?}"
            );
            assert!((bounds.middle() - target.middle()).length() < 0.1);
        }
    }

    #[test]
    fn units_and_millimetres_are_inverse() {
        let plot_box = PlotBox::new(DVec3::ZERO, DVec3::new(10.0, 20.0, 1.0), 1.0);
        let place = DVec3::new(3.0, 17.0, 0.2);
        assert!((plot_box.place_mm(plot_box.unit(place)) - place).length() < 1e-5);
    }
}
