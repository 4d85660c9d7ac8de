//! Cuts through a surface along a wire.

use glam::{DVec2, DVec3};

use super::{camera::Sight, field::Field, surface_figure::Surface};
use decoupler_core::surface::Grid;

/// Wire along which surfaces are cut, by its number from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionLine {
    /// Along y, through the nodes of the row-wire.
    RowWire(usize),
    /// Along x, above the column-wire.
    ColumnWire(usize),
}

/// Upright plane along a wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// The wire.
    pub line: SectionLine,
    /// x of a row-wire, y of a column-wire.
    pub at_mm: f64,
}

impl SectionLine {
    /// Returns its name: "row-wire 3".
    pub fn name(self) -> String {
        match self {
            Self::RowWire(row) => format!("row-wire {}", row + 1),
            Self::ColumnWire(column) => format!("column-wire {}", column + 1),
        }
    }
}

impl Section {
    /// Returns the curve in which the plane cuts the surface of these `values` on a grid, linear between its points as the
    /// surface is drawn; empty if it passes next to the grid.
    pub fn curve_mm(&self, grid: &Grid, values: &[f64]) -> Vec<DVec3> {
        let (across, along) = match self.line {
            SectionLine::RowWire(_) => (grid.x_mm(), grid.y_mm()),
            SectionLine::ColumnWire(_) => (grid.y_mm(), grid.x_mm()),
        };
        let Some((before, share)) = cell(across, self.at_mm).filter(|_| values.len() == grid.len()) else {
            return Vec::new();
        };
        let value = |across: usize, along: usize| match self.line {
            SectionLine::RowWire(_) => values[grid.index(across, along)],
            SectionLine::ColumnWire(_) => values[grid.index(along, across)],
        };
        let points = along.iter().enumerate().map(|(index, &at_mm)| {
            // At a point of the grid a gap next to it does not matter.
            let height = match share {
                0.0 => value(before, index),
                _ => (1.0 - share) * value(before, index) + share * value(before + 1, index),
            };
            match self.line {
                SectionLine::RowWire(_) => DVec3::new(self.at_mm, at_mm, height),
                SectionLine::ColumnWire(_) => DVec3::new(at_mm, self.at_mm, height),
            }
        });
        points.collect()
    }

    /// Returns the curve on the screen, along the surface as it is drawn: in pieces where it has gaps or ends at the box of
    /// the axes.
    pub fn pieces(&self, surface: &Surface, sight: &Sight) -> Vec<Vec<DVec2>> {
        let field = Field::new(surface);
        let curve = self.curve_mm(field.grid, field.values);
        let drawn: Vec<Option<DVec3>> = curve.into_iter().map(|place| field.drawn_at(place)).collect();
        let pieces = drawn.split(Option::is_none).filter(|piece| piece.len() > 1);
        pieces
            .map(|piece| piece.iter().flatten().map(|place| sight.point(*place)).collect())
            .collect()
    }
}

/// The point of an ascending axis before a place, and the share of the way to the next; `None` next to the axis.
fn cell(points_mm: &[f64], at_mm: f64) -> Option<(usize, f64)> {
    let after = points_mm.partition_point(|point| *point <= at_mm);
    let before = after.checked_sub(1)?;
    // A wire through the nodes lies on a point of the grid except for rounding.
    let pitch = points_mm.get(1)? - points_mm[0];
    if let Some(near) = [before, after].into_iter().find(|&near| {
        let point = points_mm.get(near);
        point.is_some_and(|point| (point - at_mm).abs() < 1e-9 * pitch)
    }) {
        return Some((near, 0.0));
    }
    let next = points_mm.get(after)?;
    Some((before, (at_mm - points_mm[before]) / (next - points_mm[before])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::surface::SurfaceMap;

    /// A plane over 3 × 4 nodes, which every interpolation reproduces.
    fn plane() -> (SurfaceMap, Vec<f64>) {
        let (x, y) = ([8.0, 9.0, 10.0], [3.0, 5.0, 7.0, 9.0]);
        let map = SurfaceMap::new(&x, &y).unwrap();
        let nodes: Vec<f64> = x.iter().flat_map(|x| y.iter().map(move |y| height(*x, *y))).collect();
        let values = map.evaluate(&nodes);
        (map, values)
    }

    fn height(x: f64, y: f64) -> f64 {
        4.0 + 0.1 * x - 0.03 * y
    }

    #[test]
    fn a_plane_is_cut_in_straight_lines() {
        let (map, values) = plane();
        for line in [SectionLine::RowWire(0), SectionLine::ColumnWire(4)] {
            // On nodes, between them, and in the margin beyond them.
            for at_mm in [9.0, 8.37, 9.999_999, 7.6] {
                let curve = Section { line, at_mm }.curve_mm(map.grid(), &values);
                assert!(curve.len() > 20, "{line:?} at {at_mm}");
                for place in curve {
                    let fixed = if matches!(line, SectionLine::RowWire(_)) {
                        place.x
                    } else {
                        place.y
                    };
                    assert!((fixed - at_mm).abs() < 1e-12);
                    assert!((place.z - height(place.x, place.y)).abs() < 1e-9, "{place} of {line:?}");
                }
            }
        }
    }

    #[test]
    fn beside_the_surface_nothing_is_cut_and_a_gap_beside_a_wire_does_not_matter() {
        let (map, mut values) = plane();
        let grid = map.grid();
        let outside = Section {
            line: SectionLine::RowWire(0),
            at_mm: 2.0,
        };
        assert!(outside.curve_mm(grid, &values).is_empty());
        let row = grid.x_mm().iter().position(|x| (x - 9.0).abs() < 1e-9).unwrap();
        for iy in 0..grid.y_mm().len() {
            values[grid.index(row + 1, iy)] = f64::NAN;
        }
        let on = Section {
            line: SectionLine::RowWire(1),
            at_mm: 9.0 + 1e-13,
        };
        assert!(on.curve_mm(grid, &values).iter().all(|place| place.z.is_finite()));
    }
}
