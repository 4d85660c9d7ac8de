use glam::Vec3;

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
