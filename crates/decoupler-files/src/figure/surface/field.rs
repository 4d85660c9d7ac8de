//! The height field as it is drawn: points, values, and the range of the box around it.

use std::ops::RangeInclusive;

use decoupler_core::surface::Grid;
use glam::DVec3;

use super::{Surface, ViewMode};

/// Room for overshoots of the surface above and below the range, as a fraction of it.
const HEADROOM: f64 = 0.08;

/// A surface on its grid.
pub(super) struct Field<'a> {
    pub(super) surface: &'a Surface,
    pub(super) grid: &'a Grid,
    /// Values at the ends of the colours and of the value axis.
    pub(super) range: RangeInclusive<f64>,
    /// The lowest and the highest value in the box.
    pub(super) shown: [f64; 2],
}

impl<'a> Field<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        let range = usable_range(&surface.range);
        let headroom = HEADROOM * (range.end() - range.start());
        Self {
            surface,
            grid: surface.map.grid(),
            shown: [range.start() - headroom, range.end() + headroom],
            range,
        }
    }

    /// Returns two corners of the box: the extent of the grid, and the range of values.
    pub(super) fn box_mm(&self) -> [DVec3; 2] {
        let (x_mm, y_mm) = (self.grid.x_mm(), self.grid.y_mm());
        let [low, high] = self.shown;
        [
            DVec3::new(x_mm[0], y_mm[0], low),
            DVec3::new(x_mm[x_mm.len() - 1], y_mm[y_mm.len() - 1], high),
        ]
    }

    /// Position of a value on the scale of colours.
    pub(super) fn share(&self, value: f64) -> f32 {
        ((value - self.range.start()) / (self.range.end() - self.range.start())) as f32
    }

    /// Returns the position at which a place of the surface is drawn: in space, beyond the box, at its edge.
    pub(super) fn drawn(&self, place_mm: DVec3) -> DVec3 {
        let [low, high] = self.shown;
        match self.surface.mode {
            ViewMode::ThreeD => place_mm.with_z(place_mm.z.clamp(low, high)),
            ViewMode::Top => place_mm,
        }
    }

    /// Returns the place of a grid point; its value is NaN in a gap.
    pub(super) fn place_mm(&self, [ix, iy]: [usize; 2]) -> DVec3 {
        let value = self.surface.values.get(self.grid.index(ix, iy));
        DVec3::new(
            self.grid.x_mm()[ix],
            self.grid.y_mm()[iy],
            value.copied().unwrap_or(f64::NAN),
        )
    }

    /// Returns the places of the corners of a cell, going round it; `None` in a gap.
    pub(super) fn cell_mm(&self, ix: usize, iy: usize) -> Option<[DVec3; 4]> {
        let corners = corners(ix, iy).map(|corner| self.place_mm(corner));
        corners.iter().all(|corner| corner.z.is_finite()).then_some(corners)
    }
}

/// The grid points at the corners of a cell, going round it.
pub(super) fn corners(ix: usize, iy: usize) -> [[usize; 2]; 4] {
    [[ix, iy], [ix + 1, iy], [ix + 1, iy + 1], [ix, iy + 1]]
}

/// Returns the cell of an ascending axis that contains a place; `None` outside it.
pub(super) fn cell(points_mm: &[f64], at_mm: f64) -> Option<usize> {
    let after = points_mm.partition_point(|point| *point <= at_mm);
    (after > 0 && at_mm <= points_mm[points_mm.len() - 1]).then(|| (after - 1).min(points_mm.len() - 2))
}

/// Returns a range of non-zero width for any input.
fn usable_range(range: &RangeInclusive<f64>) -> RangeInclusive<f64> {
    let (low, high) = (*range.start(), *range.end());
    if !(low.is_finite() && high.is_finite()) {
        0.0..=1.0
    } else if high - low > 1e-9 * low.abs().max(1e-3) {
        low..=high
    } else {
        low - 0.5..=low + 0.5
    }
}
