//! The height field as it is drawn (points, values, and the range of the box around it), and the colour scale of
//! surfaces.

use std::{borrow::Cow, ops::RangeInclusive, sync::Arc};

use decoupler_core::surface::{Grid, SurfaceMap};
use glam::{DVec3, Vec2};

use super::{Surface, ViewMode};
use crate::figure::{
    axis::PlotAxis,
    colour_map::{ColourMap, SequentialMap},
    drawing::{Bounds, Measure, Shape, lay_out_scale},
};

/// Room for overshoots of the surface above and below the range, as a fraction of it.
const HEADROOM: f64 = 0.08;

/// Part of a cell that is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CellPart {
    /// Nothing.
    Nothing,
    /// The part in the box; between the nodes, parts beyond the box are drawn at its edge.
    Cut,
    /// All of it at the edge of the box, because it is beyond it.
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
    /// Range of values in the box.
    shown: RangeInclusive<f64>,
    /// True for a colour map, which has no holes between nodes; heights in space end at the box.
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

    /// Returns two corners of the box: the extent of the grid, and the range of values.
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

    /// Returns the part of a cell that is drawn, and its place.
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

    /// Returns true for a cell whose parts beyond the box are drawn at its edge: in space, between the nodes.
    /// Extrapolated cells end there.
    pub(super) fn keeps_plateau(&self, ix: usize, iy: usize) -> bool {
        !self.is_map && self.is_between_nodes(ix, iy)
    }

    /// Returns the position at which a place of the surface is drawn: unchanged within the box, at its edge on a
    /// plateau, else `None`.
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

    /// Range of values in the box.
    pub(super) fn shown(&self) -> &RangeInclusive<f64> {
        &self.shown
    }
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

/// Scale of colours: a quantity and its range.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourScale {
    /// Quantity of the values.
    pub quantity: Quantity,
    /// Values at both ends.
    pub range: RangeInclusive<f64>,
    /// Colours of values that do not diverge.
    pub colours: SequentialMap,
}

impl ColourScale {
    /// Width of the bar with its numbers, in points.
    pub const WIDTH: f32 = 64.0;

    /// Lays the scale out in `area` in the colours of `map`; empty if the area or the range is too small.
    pub fn lay_out(&self, area: Bounds, map: &ColourMap, measure: Measure<'_>) -> Vec<Shape> {
        let axis = PlotAxis::linear(self.quantity.axis_name());
        let inner = Bounds {
            max: area.max - Vec2::new(0.0, 14.0),
            ..area
        };
        lay_out_scale(inner, &axis, &self.range, map, measure)
    }
}

/// Quantity that a surface shows, which determines its colours.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Heights.
    Height,
    /// Errors, diverging about zero.
    Error,
    /// A deformation pattern of arbitrary scale, diverging about zero.
    Pattern,
    /// Change of the readings with each node.
    Sensitivity,
    /// Values of measured targets in their unit, if that is known.
    Target(Option<Arc<str>>),
    /// Errors of measured targets in their unit, diverging about zero.
    TargetError(Option<Arc<str>>),
}

impl Quantity {
    /// Name of the value axis, with its unit.
    pub fn axis_name(&self) -> Cow<'static, str> {
        let with_unit = |name: &'static str, unit: &Option<Arc<str>>| match unit {
            Some(unit) => format!("{name} ({unit})").into(),
            None => name.into(),
        };
        match self {
            Self::Height => "z (mm)".into(),
            Self::Error => "error (mm)".into(),
            Self::Pattern => "pattern".into(),
            Self::Sensitivity => "1/mm".into(),
            Self::Target(unit) => with_unit("value", unit),
            Self::TargetError(unit) => with_unit("error", unit),
        }
    }

    /// Returns the range from `low` to `high` as text, with the unit; `height` writes heights and errors in
    /// millimetres, `number` all others.
    pub fn range_text(
        &self,
        (low, high): (f64, f64),
        height: impl Fn(f64) -> String,
        number: impl Fn(f64) -> String,
    ) -> String {
        let with_unit = |name: &str, unit: &Option<Arc<str>>| {
            let unit = unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}"));
            format!("{name} {} to {}{unit}", number(low), number(high))
        };
        match self {
            Self::Height => format!("z {} to {} mm", height(low), height(high)),
            Self::Error => format!("error {} to {} mm", height(low), height(high)),
            Self::Pattern => format!("pattern {} to {}", number(low), number(high)),
            Self::Sensitivity => format!("sensitivity {} to {} per mm", number(low), number(high)),
            Self::Target(unit) => with_unit("value", unit),
            Self::TargetError(unit) => with_unit("error", unit),
        }
    }

    /// Returns `true` if the colours diverge from zero.
    pub fn is_diverging(&self) -> bool {
        matches!(self, Self::Error | Self::Pattern | Self::TargetError(_))
    }
}
