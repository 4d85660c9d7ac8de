//! The height field as it is drawn: its points, its values, and what the box around it has room for.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::surface_figure::{Surface, ViewMode};
use decoupler_core::surface::{Grid, SurfaceMap};

/// Room for overshoots of the surface above and below the range, as a part of it.
const HEADROOM: f64 = 0.08;

/// Part of a cell that is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CellPart {
    /// Not a bit.
    Nothing,
    /// What stays in the box, and between the nodes what is beyond it at its edge.
    Cut,
    /// All of it at the edge of the box, beyond which it lies.
    Plateau,
    /// All of it.
    Whole,
}

/// A surface on its grid.
pub(super) struct Field<'a> {
    map: &'a SurfaceMap,
    pub(super) grid: &'a Grid,
    /// `x points × y points`; NaN leaves a gap. Empty if there are not as many as grid points.
    pub(super) values: &'a [f64],
    /// Values at the ends of the colours and of the value axis.
    pub(super) range: RangeInclusive<f64>,
    /// Values that the box has room for.
    shown: RangeInclusive<f64>,
    /// True for a map of colours, which ends between no nodes; heights in space end at the box.
    is_map: bool,
}

impl<'a> Field<'a> {
    pub(super) fn new(surface: &'a Surface) -> Self {
        let (grid, range) = (surface.map.grid(), usable_range(&surface.range));
        let headroom = HEADROOM * (range.end() - range.start());
        let values = Some(&*surface.values).filter(|values| values.len() == grid.len());
        Self {
            map: &surface.map,
            grid,
            values: values.unwrap_or_default(),
            shown: range.start() - headroom..=range.end() + headroom,
            range,
            is_map: surface.mode == ViewMode::Top,
        }
    }

    /// Two corners of the box: the grid, and the values that it has room for.
    pub(super) fn box_mm(&self) -> (DVec3, DVec3) {
        let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
        let ((x0, x1), (y0, y1)) = (ends(self.grid.x_mm()), ends(self.grid.y_mm()));
        (
            DVec3::new(x0, y0, *self.shown.start()),
            DVec3::new(x1, y1, *self.shown.end()),
        )
    }

    /// Position of a value on the scale of colours.
    pub fn share(&self, value: f64) -> f32 {
        ((value - self.range.start()) / (self.range.end() - self.range.start())) as f32
    }

    /// 0 between the nodes, 1 at the rim of the extrapolated margin.
    pub(super) fn beyond(&self, ix: usize, iy: usize) -> f32 {
        self.map.beyond(ix, iy) as f32
    }

    /// Corners of the cell at `(ix, iy)`, going round it.
    pub(super) fn corners(&self, ix: usize, iy: usize) -> [usize; 4] {
        [(ix, iy), (ix + 1, iy), (ix + 1, iy + 1), (ix, iy + 1)].map(|(ix, iy)| self.grid.index(ix, iy))
    }

    /// Places of the corners of a cell, going round it.
    pub(super) fn corners_mm(&self, ix: usize, iy: usize) -> [DVec3; 4] {
        let (x_mm, y_mm) = (self.grid.x_mm(), self.grid.y_mm());
        let corners = [(ix, iy), (ix + 1, iy), (ix + 1, iy + 1), (ix, iy + 1)];
        corners.map(|(ix, iy)| DVec3::new(x_mm[ix], y_mm[iy], self.values[self.grid.index(ix, iy)]))
    }

    /// Returns how much of a cell is drawn, and where.
    pub(super) fn part(&self, ix: usize, iy: usize) -> CellPart {
        let values = self.corners(ix, iy).map(|corner| self.values[corner]);
        let (low, high) = (*self.shown.start(), *self.shown.end());
        if !values.iter().all(|value| value.is_finite()) {
            CellPart::Nothing
        } else if (self.is_map && self.is_between_nodes(ix, iy))
            || values.iter().all(|value| self.shown.contains(value))
        {
            CellPart::Whole
        } else if values.iter().all(|value| *value < low) || values.iter().all(|value| *value > high) {
            if self.keeps_plateau(ix, iy) {
                CellPart::Plateau
            } else {
                CellPart::Nothing
            }
        } else {
            CellPart::Cut
        }
    }

    /// Returns true for a cell that is drawn at the edge of the box where it lies beyond it: in space, between the nodes.
    /// What is extrapolated ends there.
    pub(super) fn keeps_plateau(&self, ix: usize, iy: usize) -> bool {
        !self.is_map && self.is_between_nodes(ix, iy)
    }

    /// Returns where a place of the surface is drawn: itself within the box, at its edge on a plateau, else nowhere.
    pub(super) fn drawn_at(&self, place_mm: DVec3) -> Option<DVec3> {
        let within = place_mm.z.clamp(*self.shown.start(), *self.shown.end());
        let spans = |points_mm: &[f64], inside: RangeInclusive<usize>, at: f64| {
            (points_mm[*inside.start()]..=points_mm[*inside.end()]).contains(&at)
        };
        let is_between = || {
            spans(self.grid.x_mm(), self.grid.inside_x(), place_mm.x)
                && spans(self.grid.y_mm(), self.grid.inside_y(), place_mm.y)
        };
        (within == place_mm.z || (place_mm.z.is_finite() && is_between())).then(|| place_mm.with_z(within))
    }

    fn is_between_nodes(&self, ix: usize, iy: usize) -> bool {
        let corners = [(ix, iy), (ix + 1, iy), (ix + 1, iy + 1), (ix, iy + 1)];
        corners.iter().all(|&(ix, iy)| self.map.beyond(ix, iy) == 0.0)
    }

    /// Values that the box has room for.
    pub(super) fn shown(&self) -> &RangeInclusive<f64> {
        &self.shown
    }
}

/// A range that can be divided by, whatever was given.
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
