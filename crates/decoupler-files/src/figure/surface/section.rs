//! Sections of surfaces along a wire.

use decoupler_core::surface::Grid;
use glam::{DVec3, Vec2};

use super::{
    Surface,
    camera::Sight,
    field::{Field, cell},
};
use crate::figure::{
    Hue,
    drawing::{Ink, Shape, Stroke},
    plot::unbroken,
};

/// Wire along which surfaces are cut, by its number from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionLine {
    /// Along y, through the nodes of the row-wire.
    RowWire(usize),
    /// Along x, above the column-wire.
    ColumnWire(usize),
}

/// Vertical plane along a wire.
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
    /// surface is drawn; empty if it misses the grid.
    pub fn curve_mm(&self, grid: &Grid, values: &[f64]) -> Vec<DVec3> {
        let is_row = matches!(self.line, SectionLine::RowWire(_));
        let (across, along) = match is_row {
            true => (grid.x_mm(), grid.y_mm()),
            false => (grid.y_mm(), grid.x_mm()),
        };
        let Some(before) = cell(across, self.at_mm).filter(|_| values.len() == grid.len()) else {
            return Vec::new();
        };
        let share = (self.at_mm - across[before]) / (across[before + 1] - across[before]);
        let points = along.iter().enumerate().map(|(index, &at_mm)| {
            let value = |across: usize| match is_row {
                true => values[grid.index(across, index)],
                false => values[grid.index(index, across)],
            };
            // At a grid point, where a wire through the nodes is up to rounding, a gap next to it does not matter.
            let height = match share {
                ..1e-9 => value(before),
                0.999_999_999.. => value(before + 1),
                _ => (1.0 - share) * value(before) + share * value(before + 1),
            };
            match is_row {
                true => DVec3::new(self.at_mm, at_mm, height),
                false => DVec3::new(at_mm, self.at_mm, height),
            }
        });
        points.collect()
    }

    /// Returns the curve along the surface as it is drawn, in several pieces if it has gaps.
    pub fn shapes(&self, surface: &Surface, sight: &Sight) -> Vec<Shape> {
        let field = Field::new(surface);
        let curve = self.curve_mm(field.grid, &surface.values).into_iter();
        let drawn = curve.map(|place| place.z.is_finite().then(|| sight.drawn(field.drawn(place))));
        let shapes = unbroken(drawn).flat_map(|points: Vec<Vec2>| {
            let under = Stroke::new(Ink::Ground.at(0.7), 3.5);
            let over = Stroke::new(Hue::Orange, 1.8);
            [Shape::Line(points.clone(), under), Shape::Line(points, over)]
        });
        shapes.collect()
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::surface::SurfaceMap;

    use super::*;

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
    fn nothing_is_cut_outside_the_surface_and_a_gap_next_to_a_wire_does_not_matter() {
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
