//! The height field as it is drawn: its points, its values, and what the box around it has room for.

use std::{borrow::Cow, ops::RangeInclusive};

use glam::DVec3;

use super::value::Surface;

/// Room for overshoots of the surface above and below the range, as a part of it.
const HEADROOM: f64 = 0.08;

/// A surface on a rectangular grid, thinned where it is finer than asked for.
pub(super) struct Field<'a> {
    pub(super) x_mm: Cow<'a, [f64]>,
    pub(super) y_mm: Cow<'a, [f64]>,
    /// `x points × y points`; NaN leaves a gap. Empty if there are not as many as grid points.
    pub(super) values: Cow<'a, [f64]>,
    /// Indices between the outermost nodes.
    inside: [RangeInclusive<usize>; 2],
    /// Values at the ends of the colours and of the value axis.
    pub(super) range: RangeInclusive<f64>,
    /// Values that the box has room for.
    pub(super) shown: RangeInclusive<f64>,
}

impl<'a> Field<'a> {
    /// The surface with at most about `most_cells` cells a side.
    pub(super) fn new(surface: &'a Surface, most_cells: usize) -> Self {
        let (grid, range) = (surface.map.grid(), usable_range(&surface.range));
        let headroom = HEADROOM * (range.end() - range.start());
        let shown = range.start() - headroom..=range.end() + headroom;
        let values = Some(&*surface.values).filter(|values| values.len() == grid.len());
        let values = values.unwrap_or_default();
        if grid.x_mm().len().max(grid.y_mm().len()) <= most_cells + 1 {
            return Self {
                x_mm: grid.x_mm().into(),
                y_mm: grid.y_mm().into(),
                values: values.into(),
                inside: [grid.inside_x(), grid.inside_y()],
                range,
                shown,
            };
        }
        let (columns, inside_x) = kept(grid.x_mm().len(), grid.inside_x(), most_cells);
        let (rows, inside_y) = kept(grid.y_mm().len(), grid.inside_y(), most_cells);
        let at = |points: &[f64], indices: &[usize]| indices.iter().map(|&index| points[index]).collect();
        let value = |&ix: &usize| rows.iter().filter_map(move |&iy| values.get(grid.index(ix, iy)));
        Self {
            x_mm: at(grid.x_mm(), &columns),
            y_mm: at(grid.y_mm(), &rows),
            values: columns.iter().flat_map(value).copied().collect(),
            inside: [inside_x, inside_y],
            range,
            shown,
        }
    }

    /// Index of a point among the values.
    pub(super) fn index(&self, ix: usize, iy: usize) -> usize {
        ix * self.y_mm.len() + iy
    }

    /// Two corners of the box: the grid, and the values that it has room for.
    pub(super) fn box_mm(&self) -> (DVec3, DVec3) {
        let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
        let ((x0, x1), (y0, y1)) = (ends(&self.x_mm), ends(&self.y_mm));
        (
            DVec3::new(x0, y0, *self.shown.start()),
            DVec3::new(x1, y1, *self.shown.end()),
        )
    }

    /// Position of a value on the scale of colours.
    pub(super) fn share(&self, value: f64) -> f32 {
        ((value - self.range.start()) / (self.range.end() - self.range.start())) as f32
    }

    /// 0 within the nodes' rectangle, 1 at the rim of the extrapolated margin.
    pub(super) fn beyond(&self, ix: usize, iy: usize) -> f32 {
        let outside = |index: usize, inside: &RangeInclusive<usize>, count: usize| {
            if index < *inside.start() {
                (inside.start() - index) as f32 / *inside.start() as f32
            } else {
                index.saturating_sub(*inside.end()) as f32 / (count - 1 - inside.end()).max(1) as f32
            }
        };
        let [inside_x, inside_y] = &self.inside;
        outside(ix, inside_x, self.x_mm.len()).max(outside(iy, inside_y, self.y_mm.len()))
    }

    /// Corners of the cell at `(ix, iy)`, going round it.
    pub(super) fn corners(&self, ix: usize, iy: usize) -> [usize; 4] {
        [(ix, iy), (ix + 1, iy), (ix + 1, iy + 1), (ix, iy + 1)].map(|(ix, iy)| self.index(ix, iy))
    }

    /// Whether a cell has values; in the margin also whether they stay in the box, for extrapolation knows no bounds.
    pub(super) fn is_drawn(&self, ix: usize, iy: usize) -> bool {
        let [inside_x, inside_y] = &self.inside;
        let is_inside =
            (inside_x.start()..inside_x.end()).contains(&&ix) && (inside_y.start()..inside_y.end()).contains(&&iy);
        let is_shown = |value: f64| value.is_finite() && (is_inside || self.shown.contains(&value));
        let corners = self.corners(ix, iy);
        corners
            .iter()
            .all(|&corner| self.values.get(corner).is_some_and(|value| is_shown(*value)))
    }
}

/// Every so many of `count` indices, so that about `most_cells` intervals remain; the ends and those of `inside` stay.
/// With them, where `inside` lies among them.
fn kept(count: usize, inside: RangeInclusive<usize>, most_cells: usize) -> (Vec<usize>, RangeInclusive<usize>) {
    let (first, last) = inside.into_inner();
    let stride = (count - 1).div_ceil(most_cells).max(1);
    let mut indices: Vec<usize> = (0..first).step_by(stride).collect();
    let start = indices.len();
    indices.extend((first..last).step_by(stride));
    let end = indices.len();
    indices.push(last);
    let margin = (last + 1..count).rev().step_by(stride);
    indices.extend(margin);
    indices[end + 1..].reverse();
    (indices, start..=end)
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

#[cfg(test)]
mod tests {
    use super::kept;

    #[test]
    fn thinning_keeps_the_ends_and_the_outermost_nodes() {
        for (count, inside, most) in [(100, 5..=94, 64), (110, 0..=109, 64), (300, 8..=290, 64), (9, 3..=5, 2)] {
            let (indices, among) = kept(count, inside.clone(), most);
            assert!(indices.is_sorted_by(|a, b| a < b), "{indices:?}");
            assert_eq!((indices[0], indices[indices.len() - 1]), (0, count - 1));
            assert_eq!(indices[*among.start()]..=indices[*among.end()], inside);
            assert!(indices.len() <= most + 4, "{} of {count}", indices.len());
        }
    }
}
