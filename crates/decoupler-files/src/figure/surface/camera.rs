//! A camera that orbits the plot, and the projection from millimetres to points on the screen and back.

use glam::{DMat3, DVec2, DVec3, Vec2};
use serde::{Deserialize, Serialize};

use crate::figure::drawing::Bounds;

const RADIANS_PER_POINT: f32 = 0.008;
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
    fn towards_eye(&self) -> DVec3 {
        let across = DVec2::from_angle(f64::from(self.yaw)) * f64::from(self.pitch).cos();
        across.extend(f64::from(self.pitch).sin())
    }

    /// Returns the camera turned as if the plot were dragged by this many points to the right and down.
    #[must_use]
    pub fn dragged(mut self, right: f32, down: f32) -> Self {
        self.yaw -= right * RADIANS_PER_POINT;
        self.pitch += down * RADIANS_PER_POINT;
        self.clamped()
    }

    /// Returns the camera moved nearer by a factor.
    #[must_use]
    pub fn zoomed(mut self, factor: f32) -> Self {
        self.zoom *= factor;
        self.clamped()
    }

    /// Returns the camera shifted by a fraction of the card to the right and down.
    #[must_use]
    pub fn panned(mut self, right: f32, down: f32) -> Self {
        self.pan = [self.pan[0] + right, self.pan[1] + down];
        self.clamped()
    }

    /// Returns the camera at zoom 1, with the plot in the middle of the card.
    pub(super) fn centred(mut self) -> Self {
        (self.zoom, self.pan) = (1.0, [0.0; 2]);
        self
    }

    /// Returns the camera moved into its limits, which a saved state may violate. One within the limits keeps its bits.
    #[must_use]
    pub fn clamped(self) -> Self {
        const TURN: f32 = std::f32::consts::TAU;
        let start = Self::default();
        let within = |value: f32, otherwise: f32, limits: std::ops::RangeInclusive<f32>| match value.is_finite() {
            true => value.clamp(*limits.start(), *limits.end()),
            false => otherwise,
        };
        let yaw = within(self.yaw, start.yaw, f32::MIN..=f32::MAX);
        Self {
            yaw: yaw - TURN * (yaw / TURN).round(),
            pitch: within(self.pitch, start.pitch, PITCH),
            zoom: within(self.zoom, start.zoom, ZOOM),
            pan: self.pan.map(|part| within(part, 0.0, PAN)),
        }
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
    /// Turns box units to the right and down on the screen, and away from the eye.
    view: DMat3,
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
        let towards_eye = camera.map_or(DVec3::Z, |camera| camera.towards_eye());
        // The camera never looks straight down.
        let right = towards_eye.cross(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::X);
        let half_diagonal = 0.5 * ((plot_box.max_mm - plot_box.min_mm) * plot_box.per_mm).length();
        let mut sight = Self {
            plot_box,
            eye: camera.map_or(DVec3::ZERO, |_| towards_eye * (EYE_DISTANCE * half_diagonal)),
            is_above: camera.is_none(),
            view: DMat3::from_cols(right, right.cross(towards_eye), -towards_eye).transpose(),
            points: 1.0,
            offset: DVec2::ZERO,
        };
        let OrbitCamera { zoom, pan, .. } = camera.unwrap_or_default();
        let [raw_min, raw_max] = sight.corners();
        let size = target.size().as_dvec2();
        sight.points = (size / (raw_max - raw_min)).min_element().max(0.0) * f64::from(zoom);
        let pan = Vec2::from(pan).as_dvec2() * size;
        sight.offset = target.middle().as_dvec2() + pan - 0.5 * (raw_min + raw_max) * sight.points;
        sight
    }

    /// Least and largest coordinates on the screen of the corners of the box.
    fn corners(&self) -> [DVec2; 2] {
        let corners = (0..8).map(|corner| self.point(self.plot_box.corner_mm(corner)));
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
        let seen = self.view * (self.plot_box.unit(place_mm) - self.eye);
        let depth = if self.is_above { 1.0 } else { seen.z };
        self.offset + seen.truncate() * (self.points / depth)
    }

    /// As [`Self::point`], for what is painted.
    pub(super) fn drawn(&self, place_mm: DVec3) -> Vec2 {
        self.point(place_mm).as_vec2()
    }

    /// The place of the eye.
    pub(super) fn eye_mm(&self) -> DVec3 {
        match self.is_above {
            true => DVec3::INFINITY,
            false => self.plot_box.middle_mm() + self.eye / self.plot_box.per_mm,
        }
    }

    /// Returns the line of sight through a point on the screen.
    pub fn ray(&self, at: DVec2) -> Ray {
        let tangents = (at - self.offset) / self.points;
        let millimetres = |depth: f64| self.view.transpose() * tangents.extend(depth) / self.plot_box.per_mm;
        let (from_mm, direction) = match self.is_above {
            true => ((self.plot_box.middle_mm() + millimetres(0.0)).with_z(0.0), DVec3::NEG_Z),
            false => (self.eye_mm(), millimetres(1.0)),
        };
        Ray { from_mm, direction }
    }

    /// Returns the height at which the vertical line through `foot_mm` comes nearest to a point on the screen; `None`
    /// if it is seen end-on, with `stroke_mm` of it shorter than ten points.
    pub fn height_mm(&self, foot_mm: DVec3, stroke_mm: f64, at: DVec2) -> Option<f64> {
        const SHORTEST_POINTS: f64 = 10.0;
        let foot = self.point(foot_mm);
        let image = self.point(foot_mm - DVec3::Z * stroke_mm) - foot;
        if image.length() < SHORTEST_POINTS {
            return None;
        }
        // The line of sight through the point, moved onto the image of the line, meets the line.
        let Ray { from_mm, direction } = self.ray(foot + (at - foot).project_onto(image));
        let (apart, along) = ((foot_mm - from_mm).truncate(), direction.truncate());
        let height_mm = from_mm.z + direction.z * (apart.dot(along) / along.length_squared());
        Some(height_mm).filter(|height_mm| height_mm.is_finite())
    }
}

impl Ray {
    pub(super) fn is_vertical(&self) -> bool {
        self.direction.truncate() == DVec2::ZERO
    }

    /// Returns the place at this multiple of its direction.
    pub(super) fn at(&self, share: f64) -> DVec3 {
        self.from_mm + self.direction * share
    }

    /// Returns the place where the ray reaches the level `z_mm`; `None` if it never does.
    pub fn at_level(&self, z_mm: f64) -> Option<DVec3> {
        let share = (z_mm - self.from_mm.z) / self.direction.z;
        let reaches = share.is_finite() && (share >= 0.0 || self.is_vertical());
        reaches.then(|| self.at(share).with_z(z_mm))
    }
}

/// Minimum ratio of the box's horizontal sides; longer arrays are drawn shortened.
const MIN_SIDE: f64 = 0.3;

/// The box of the axes: millimetres on three axes, and its shape in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlotBox {
    pub(super) min_mm: DVec3,
    pub(super) max_mm: DVec3,
    /// Box units per millimetre; in space, the longer horizontal side is 1.
    pub(super) per_mm: DVec3,
}

impl PlotBox {
    /// A box with one scale on all axes, to be seen from above.
    pub(super) fn flat([min_mm, max_mm]: [DVec3; 2]) -> Self {
        let per_mm = DVec3::ONE;
        Self { min_mm, max_mm, per_mm }
    }

    /// A box whose height, at the camera's start, gives the picture about the ratio of height to width `tall_per_wide`: x
    /// and y keep their proportions, z is exaggerated.
    pub(super) fn new([min_mm, max_mm]: [DVec3; 2], tall_per_wide: f32) -> Self {
        let size = max_mm - min_mm;
        let sides = (size / size.x.max(size.y)).max(DVec3::splat(MIN_SIDE)).truncate();
        // Without perspective, the picture is as wide as the sides across, and as tall as the sides and the height upwards.
        let towards_eye = OrbitCamera::default().towards_eye();
        let right = towards_eye.cross(DVec3::NEG_Z).normalize();
        let up = towards_eye.cross(right).abs();
        let wide = sides.dot(right.truncate().abs());
        let height = (f64::from(tall_per_wide) * wide - sides.dot(up.truncate())) / up.z;
        // In units of the longer side.
        let per_mm = sides.extend(height.clamp(0.4, 1.35)) / size;
        Self { min_mm, max_mm, per_mm }
    }

    fn middle_mm(&self) -> DVec3 {
        0.5 * (self.min_mm + self.max_mm)
    }

    /// Box units of a place; the middle of the box is the origin.
    pub(super) fn unit(&self, place_mm: DVec3) -> DVec3 {
        (place_mm - self.middle_mm()) * self.per_mm
    }

    /// A corner: bits 0, 1 and 2 of its number are set at the upper ends of x, y and z.
    pub(super) fn corner_mm(&self, corner: usize) -> DVec3 {
        let at_end = |axis: usize| if corner & (1 << axis) == 0 { self.min_mm } else { self.max_mm }[axis];
        DVec3::new(at_end(0), at_end(1), at_end(2))
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
        let plot_box = PlotBox::new([DVec3::new(7.5, 5.5, 4.0), DVec3::new(17.5, 25.5, 5.0)], 470.0 / 300.0);
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
