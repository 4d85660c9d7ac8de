//! Sections of surfaces along a wire, and their figure.

use decoupler_core::{
    surface::Grid,
    text::{capitalised, format_number},
};
use glam::{DVec3, Vec2};

use super::{Surface, camera::Sight};
use crate::figure::{
    Ink, LineStyle, Look, Marker,
    axis::PlotAxis,
    drawing::{Shape, Stroke},
    plot::{LineAt, Plot, PlotFigure, PlotPoint, Series, unbroken},
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

impl Section {
    /// Returns the curve in which the plane cuts a surface, linear between the points of its grid as the surface is drawn;
    /// empty if it misses the grid.
    pub fn curve_mm(&self, surface: &Surface) -> Vec<DVec3> {
        let (grid, is_row) = (surface.map.grid(), matches!(self.line, SectionLine::RowWire(_)));
        let (across, along) = across_and_along(is_row, grid.x_mm(), grid.y_mm());
        let Some(before) = cell(across, self.at_mm).filter(|_| surface.values.len() == grid.len()) else {
            return Vec::new();
        };
        let share = (self.at_mm - across[before]) / (across[before + 1] - across[before]);
        let points = (0..along.len()).map(|at| {
            let [low, high] = [before, before + 1].map(|across| {
                let (ix, iy) = across_and_along(is_row, across, at);
                surface.place_mm([ix, iy])
            });
            // At a grid point, where a wire through the nodes is up to rounding, a gap next to it does not matter.
            match share {
                ..1e-9 => low,
                0.999_999_999.. => high,
                _ => low.lerp(high, share),
            }
        });
        points.collect()
    }

    /// Returns the curve along the surface as it is drawn, in several pieces if it has gaps.
    pub fn shapes(&self, surface: &Surface, sight: &Sight) -> Vec<Shape> {
        let curve = self.curve_mm(surface).into_iter();
        let drawn = curve.map(|place| place.z.is_finite().then(|| sight.drawn(surface.drawn(place))));
        let shapes = unbroken(drawn).into_iter().flat_map(|points: Vec<Vec2>| {
            let under = Stroke::new(Ink::Ground.at(0.7), 3.5);
            let over = Stroke::new(Ink::Orange, 1.8);
            [Shape::Line(points.clone(), under), Shape::Line(points, over)]
        });
        shapes.collect()
    }
}

/// Returns what is across and what is along the curve, given x and y; or the other way round.
fn across_and_along<T>(is_row: bool, x: T, y: T) -> (T, T) {
    if is_row { (x, y) } else { (y, x) }
}

/// Returns the cell of an ascending axis that contains a place; `None` outside it.
pub(super) fn cell(points_mm: &[f64], at_mm: f64) -> Option<usize> {
    let after = points_mm.partition_point(|point| *point <= at_mm);
    (after > 0 && at_mm <= points_mm[points_mm.len() - 1]).then(|| (after - 1).min(points_mm.len() - 2))
}

/// Actual and decoupled z along a wire, with the nodes on it. `rows` are the row-wires read, from 0; the ranges of the surfaces
/// are always in view. Sections beyond the nodes are marked as extrapolated.
pub fn section_figure(section: &Section, rows: &[usize], actual: &Surface, decoupled: Option<&Surface>) -> PlotFigure {
    let (name, axis, place): (_, _, fn(&DVec3) -> f64) = match section.line {
        SectionLine::RowWire(row) => (format!("row-wire {}", row + 1), "y", |place| place.y),
        SectionLine::ColumnWire(column) => (format!("column-wire {}", column + 1), "x", |place| place.x),
    };
    let shown = || {
        let decoupled = decoupled.map(|surface| ("decoded", Ink::Blue, Marker::Disc, surface));
        std::iter::once(("actual", Ink::Grey, Marker::Square, actual)).chain(decoupled)
    };
    let title = capitalised(&name);
    let heights_mm = shown().flat_map(|(.., surface)| [*surface.range.start(), *surface.range.end()]);
    let x = PlotAxis::linear(format!("{axis} along {name} (mm)"));
    let y = PlotAxis::linear("z (mm)").including(heights_mm);
    let curves = shown().map(|(name, ink, _, surface)| {
        let curve = section.curve_mm(surface);
        let curve = curve.iter().map(|at| [place(at), at.z]);
        Series::new(name, Look::line(ink, LineStyle::Solid), curve)
    });
    let mut plot = Plot::new(x, y, curves);
    if plot.series.is_empty() {
        let note = format!("{title} lies beyond the nodes: there is no surface above it.");
        return PlotFigure::new([plot], [note]);
    }
    plot.series.extend(shown().filter_map(|(name, ink, marker, surface)| {
        let row = rows.iter().position(|&row| section.line == SectionLine::RowWire(row))?;
        let per_row = surface.nodes.len() / rows.len();
        // A column-wire passes below the surface, between the nodes.
        let points = surface.nodes.iter().enumerate().skip(row * per_row).take(per_row);
        let points = points.map(|(node, at)| {
            let note = format!(
                "{title}, node {}\n{name} z: {} mm",
                node % per_row + 1,
                format_number(at.z)
            );
            PlotPoint::from([place(at), at.z]).of_item(node).noted(note)
        });
        Some(Series::new(format!("{name} nodes"), Look::marker(ink, marker), points).listed(None))
    }));
    plot.series.extend(beyond(section.line, actual.map.grid()));
    plot.into()
}

/// The stretches on which the surface is extrapolated.
fn beyond(line: SectionLine, grid: &Grid) -> impl Iterator<Item = Series> {
    let (points_mm, inside) = match line {
        SectionLine::RowWire(_) => (grid.y_mm(), grid.inside_y()),
        SectionLine::ColumnWire(_) => (grid.x_mm(), grid.inside_x()),
    };
    let last = points_mm.len() - 1;
    let ends = [(0, *inside.start()), (*inside.end(), last)];
    let bands = ends.into_iter().filter(|(from, to)| from < to);
    bands.map(|(from, to)| {
        let at = LineAt::Between([points_mm[from], points_mm[to]]);
        Series::across("beyond the nodes", at, Ink::Grey, None)
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::surface::Quantity;

    /// A plane over 3 × 4 nodes, which every interpolation reproduces.
    fn plane() -> Surface {
        let (x, y) = ([8.0, 9.0, 10.0], [3.0, 5.0, 7.0, 9.0]);
        let map = SurfaceMap::shared(&x, &y).unwrap();
        let places = x.iter().flat_map(|&x| y.map(|y| DVec3::new(x, y, height(x, y))));
        Surface::through("", &map, Vec::from_iter(places), Quantity::Height, 4.0..=6.0)
    }

    fn height(x: f64, y: f64) -> f64 {
        4.0 + 0.1 * x - 0.03 * y
    }

    #[test]
    fn a_plane_is_cut_in_straight_lines() {
        let plane = plane();
        for line in [SectionLine::RowWire(0), SectionLine::ColumnWire(4)] {
            // On nodes, between them, and in the margin beyond them.
            for at_mm in [9.0, 8.37, 9.999_999, 7.6] {
                let curve = Section { line, at_mm }.curve_mm(&plane);
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
        let mut surface = plane();
        let map = Arc::clone(&surface.map);
        let grid = map.grid();
        let outside = Section {
            line: SectionLine::RowWire(0),
            at_mm: 2.0,
        };
        assert!(outside.curve_mm(&surface).is_empty());
        let row = grid.x_mm().iter().position(|x| (x - 9.0).abs() < 1e-9).unwrap();
        for iy in 0..grid.y_mm().len() {
            Arc::make_mut(&mut surface.values)[grid.index(row + 1, iy)] = f64::NAN;
        }
        let on = Section {
            line: SectionLine::RowWire(1),
            at_mm: 9.0 + 1e-13,
        };
        assert!(on.curve_mm(&surface).iter().all(|place| place.z.is_finite()));
    }
}

#[cfg(test)]
mod figure_tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::surface::Quantity;

    const X: [f64; 3] = [8.0, 9.0, 10.0];
    const Y: [f64; 4] = [3.0, 5.0, 7.0, 9.0];

    fn nodes(height: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
        let at = X.iter().flat_map(|&x| Y.iter().map(move |&y| (x, y)));
        at.map(|(x, y)| DVec3::new(x, y, height(x, y))).collect()
    }

    fn figure(line: SectionLine, at_mm: f64) -> PlotFigure {
        let map = Arc::new(SurfaceMap::new(&X, &Y).unwrap());
        let surface = |nodes: Vec<DVec3>| Surface::through("", &map, nodes, Quantity::Height, 4.0..=5.0);
        let actual = surface(nodes(|x, y| 4.0 + 0.05 * x - 0.02 * y));
        let decoupled = surface(nodes(|_, y| 4.5 - 0.01 * y));
        // Row-wires 3, 5 and 8 are read.
        section_figure(&Section { line, at_mm }, &[2, 4, 7], &actual, Some(&decoupled))
    }

    #[test]
    fn along_a_row_wire_the_curves_pass_through_its_nodes() {
        let figure = figure(SectionLine::RowWire(4), 9.0);
        let [plot] = &figure.plots[..] else { panic!() };
        let names: Vec<&str> = plot.series.iter().map(|series| &*series.name).collect();
        assert_eq!(
            names,
            [
                "actual",
                "decoded",
                "actual nodes",
                "decoded nodes",
                "beyond the nodes",
                "beyond the nodes"
            ]
        );
        for (curve, nodes) in [(0, 2), (1, 3)] {
            for (point, y) in plot.series[nodes].points.iter().zip(Y) {
                assert_eq!(point.x, y);
                let on_curve = plot.series[curve].points.iter().find(|at| (at.x - y).abs() < 1e-9);
                assert!((on_curve.unwrap().y - point.y).abs() < 1e-9);
            }
        }
        let node = &plot.series[3].points[2];
        assert_eq!(node.item, Some(6), "the third node of the second row read");
        assert_eq!(node.note.as_deref(), Some("Row-wire 5, node 3\ndecoded z: 4.43 mm"));
        let beyond: Vec<_> = plot.lines_across().map(|(_, at)| at).collect();
        assert_eq!(beyond, [[2.0, 3.0], [9.0, 10.0]].map(LineAt::Between));
    }

    #[test]
    fn a_column_wire_has_curves_only_and_outside_the_nodes_a_reason() {
        let along = figure(SectionLine::ColumnWire(3), 4.0);
        let points = &along.plots[0].series[0].points;
        assert!(points.iter().all(|at| (at.y - (4.0 + 0.05 * at.x - 0.08)).abs() < 1e-9));
        assert_eq!(along.keys().len(), 3, "the curves and the stretches beyond the nodes");
        assert_eq!(along.plots[0].x.name, "x along column-wire 4 (mm)");
        let outside = figure(SectionLine::ColumnWire(11), 12.0);
        assert!(outside.plots[0].series.is_empty() && outside.keys().is_empty());
        assert_eq!(
            outside.notes,
            ["Column-wire 12 lies beyond the nodes: there is no surface above it."]
        );
    }
}
