//! From millimetres to points on the screen.

use glam::{DVec2, DVec3, Mat4, Vec2, Vec3, camera::rh};

use super::{camera::OrbitCamera, shapes::Bounds};

/// Distance of the eye in half diagonals of the box: a mild perspective.
const EYE_DISTANCE: f32 = 4.0;
/// The least ratio of the box's horizontal sides; longer arrays are drawn shorter than they are.
const MIN_SIDE: f32 = 0.3;
/// Angle of view, in radians; what is seen is scaled anyway.
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
    /// A box whose height, at the camera's start, makes the picture as tall as `tall_per_wide` asks: x and y keep
    /// their proportions, z is exaggerated.
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
        // The picture's shape grows with the height, so halving finds the one asked for.
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
    /// At zoom 1 the eight corners just touch `target`, whatever the angles.
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
