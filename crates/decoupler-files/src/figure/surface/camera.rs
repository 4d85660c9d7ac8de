//! A camera that orbits the plot, and the projection from millimetres to points on the screen and back.

use glam::{DVec2, DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

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

/// The mapping of places in millimetres to points on the screen and back: in perspective from the eye of the camera, or from
/// straight above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    pub(super) plot_box: PlotBox,
    /// The eye in box units, at the middle of the box if it is straight above.
    pub(super) eye: DVec3,
    pub(super) is_above: bool,
    /// Unit vectors in box units: away from the eye, to the right and up on the screen.
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    /// Points on the screen of a tangent of 1, or of a box unit from above.
    points: f64,
    /// The point on the screen where the eye looks.
    offset: DVec2,
}

/// A line of sight, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Its origin.
    pub from_mm: DVec3,
    /// Its direction, of any length.
    pub direction: DVec3,
}

/// Distance of the eye in half diagonals of the box: a mild perspective.
const EYE_DISTANCE: f64 = 4.0;

impl Sight {
    /// Fits the box into `target`: at zoom 1 its corners just touch it from any angle. Without a camera it is seen from above.
    pub(super) fn fit(plot_box: PlotBox, camera: Option<OrbitCamera>, target: Bounds) -> Self {
        let mut sight = Self {
            plot_box,
            eye: DVec3::ZERO,
            is_above: camera.is_none(),
            forward: DVec3::NEG_Z,
            right: DVec3::X,
            up: DVec3::Y,
            points: 1.0,
            offset: DVec2::ZERO,
        };
        let OrbitCamera { zoom, pan, .. } = camera.unwrap_or_default();
        if let Some(camera) = camera {
            let sides = (plot_box.max_mm - plot_box.min_mm) * plot_box.per_mm;
            sight.eye = camera.towards_eye().as_dvec3() * (EYE_DISTANCE * 0.5 * sides.length());
            // The camera never looks straight down, so its right-hand side is defined.
            sight.forward = -sight.eye.normalize();
            sight.right = sight.forward.cross(DVec3::Z).normalize();
            sight.up = sight.right.cross(sight.forward);
        }
        let [raw_min, raw_max] = sight.corners();
        let size = target.size().as_dvec2();
        sight.points = (size / (raw_max - raw_min)).min_element().max(0.0) * f64::from(zoom);
        let pan = DVec2::new(f64::from(pan[0]), f64::from(pan[1])) * size;
        sight.offset = target.middle().as_dvec2() + pan - 0.5 * (raw_min + raw_max) * sight.points;
        sight
    }

    /// Least and largest coordinates on the screen of the corners of the box.
    fn corners(&self) -> [DVec2; 2] {
        let corners =
            (0..8).map(|corner| self.point(self.plot_box.corner_mm(corner & 1, (corner >> 1) & 1, corner >> 2)));
        corners.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[min, max], at| {
            [min.min(at), max.max(at)]
        })
    }

    /// The rectangle that the box covers.
    pub(super) fn bounds(&self) -> Bounds {
        let [min, max] = self.corners().map(|corner| corner.as_vec2());
        Bounds { min, max }
    }

    /// Returns the point on the screen of a place.
    pub fn point(&self, place_mm: DVec3) -> DVec2 {
        let apart = (place_mm - self.plot_box.middle_mm) * self.plot_box.per_mm - self.eye;
        let depth = if self.is_above { 1.0 } else { apart.dot(self.forward) };
        let (right, up) = (apart.dot(self.right) / depth, apart.dot(self.up) / depth);
        self.offset + DVec2::new(right, -up) * self.points
    }

    /// As [`Self::point`], for what is painted.
    pub(super) fn drawn(&self, place_mm: DVec3) -> Vec2 {
        self.point(place_mm).as_vec2()
    }

    /// The place of the eye.
    pub(super) fn eye_mm(&self) -> DVec3 {
        match self.is_above {
            true => DVec3::INFINITY,
            false => self.plot_box.middle_mm + self.eye / self.plot_box.per_mm,
        }
    }

    /// Returns the line of sight through a point on the screen.
    pub fn ray(&self, at: DVec2) -> Ray {
        let PlotBox { middle_mm, per_mm, .. } = self.plot_box;
        let tangents = (at - self.offset) / self.points;
        let across = self.right * tangents.x - self.up * tangents.y;
        if self.is_above {
            return Ray {
                from_mm: (middle_mm + across / per_mm).with_z(0.0),
                direction: self.forward,
            };
        }
        Ray {
            from_mm: self.eye_mm(),
            direction: (self.forward + across) / per_mm,
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
        // The point moved onto the image of the line, which is straight, and back from there into space: the place on the
        // line whose tangents are those of the point, a(z) / b(z) with both linear in z.
        let image = foot + along * ((at - foot).dot(along) / along.length_squared());
        let tangents = (image - self.offset) / self.points;
        let axis = if along.x.abs() > along.y.abs() {
            self.right - self.forward * tangents.x
        } else {
            self.up + self.forward * tangents.y
        };
        let PlotBox { middle_mm, per_mm, .. } = self.plot_box;
        let apart = (foot_mm - middle_mm) * per_mm - self.eye;
        let height_mm = foot_mm.z - apart.dot(axis) / (per_mm.z * axis.z);
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

/// Minimum ratio of the box's horizontal sides; longer arrays are drawn shortened.
const MIN_SIDE: f64 = 0.3;
/// Heights of the box in units of its longer horizontal side: within these, the picture gets the shape of its card.
const HEIGHT: std::ops::RangeInclusive<f64> = 0.4..=1.35;

/// The box of the axes: millimetres on three axes, and its shape in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlotBox {
    pub(super) min_mm: DVec3,
    pub(super) max_mm: DVec3,
    /// Box units per millimetre; in space, the longer horizontal side is 1.
    pub(super) per_mm: DVec3,
    pub(super) middle_mm: DVec3,
}

impl PlotBox {
    /// A box with one scale on all axes, to be seen from above.
    pub(super) fn flat(min_mm: DVec3, max_mm: DVec3) -> Self {
        Self {
            min_mm,
            max_mm,
            per_mm: DVec3::ONE,
            middle_mm: 0.5 * (min_mm + max_mm),
        }
    }

    /// A box whose height, at the camera's start, gives the picture the ratio of height to width `tall_per_wide`: x and
    /// y keep their proportions, z is exaggerated.
    pub(super) fn new(min_mm: DVec3, max_mm: DVec3, tall_per_wide: f32) -> Self {
        let size = max_mm - min_mm;
        let longer = size.x.max(size.y);
        let of_height = |height: f64| Self {
            per_mm: DVec3::new((size.x / longer).max(MIN_SIDE), (size.y / longer).max(MIN_SIDE), height) / size,
            ..Self::flat(min_mm, max_mm)
        };
        // The ratio increases with the height, so bisection finds the height.
        let (mut low, mut high) = (*HEIGHT.start(), *HEIGHT.end());
        let unbounded = Bounds::of_size(Vec2::ZERO, Vec2::ONE);
        for _ in 0..12 {
            let height = 0.5 * (low + high);
            let seen = Sight::fit(of_height(height), Some(OrbitCamera::default()), unbounded)
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

    /// A corner; each part 0 or 1.
    pub(super) fn corner_mm(&self, x: usize, y: usize, z: usize) -> DVec3 {
        let ends = [self.min_mm, self.max_mm];
        DVec3::new(ends[x].x, ends[y].y, ends[z].z)
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
            let bounds = Sight::fit(plot_box, Some(camera), target).bounds();
            let slack = target.size() - bounds.size();
            assert!(
                slack.min_element().abs() < 0.1 && slack.max_element() > -0.1,
                "{slack} at {camera:?}"
            );
            assert!((bounds.middle() - target.middle()).length() < 0.1);
        }
    }
}
