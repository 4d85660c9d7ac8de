//! The figure of a section through the surfaces.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::{
    Hue, LineStyle, Look, Marker,
    axis::PlotAxis,
    plot::{Plot, PlotFigure, PlotPoint, Series, Span},
    surface::{Section, SectionLine},
};
use decoupler_core::{
    surface::SurfaceMap,
    text::{capitalised, format_number},
};

/// A surface to be cut, with its nodes.
#[derive(Clone, Copy, Debug)]
pub struct SectionNodes<'a> {
    /// Values on the grid of the map, in millimetres.
    pub values_mm: &'a [f64],
    /// The nodes row by row; a cut along a row-wire shows those on it.
    pub nodes_mm: &'a [DVec3],
}

/// Actual and decoupled z along a wire, with the nodes on it. `rows` are the row-wires read, from 0, and `heights_mm` are
/// always in view. Sections beyond the nodes are marked as extrapolated.
pub fn section_figure(
    section: &Section,
    map: &SurfaceMap,
    rows: &[usize],
    actual: SectionNodes<'_>,
    decoupled: Option<SectionNodes<'_>>,
    heights_mm: RangeInclusive<f64>,
) -> PlotFigure {
    let (axis, place): (_, fn(&DVec3) -> f64) = match section.line {
        SectionLine::RowWire(_) => ("y", |place| place.y),
        SectionLine::ColumnWire(_) => ("x", |place| place.x),
    };
    let looks = [
        ("actual", Look::line(Hue::Grey, LineStyle::Solid), Marker::Square),
        ("decoupled", Look::line(Hue::Blue, LineStyle::Solid), Marker::Disc),
    ];
    let surfaces = [Some(actual), decoupled];
    let shown = || {
        looks
            .into_iter()
            .zip(surfaces)
            .filter_map(|(look, surface)| Some((look, surface?)))
    };
    let curves = shown().map(|((name, look, _), surface)| {
        let curve = section.curve_mm(map.grid(), surface.values_mm);
        Series::new(name, look, curve.iter().map(|at| [place(at), at.z]))
    });
    let curves: Vec<Series> = curves.filter(|curve| !curve.points.is_empty()).collect();
    let nodes = shown().filter_map(|((name, look, marker), surface)| {
        let on = on_wire(section.line, rows, surface.nodes_mm)?;
        let points = on.map(|(node, of_row, at)| PlotPoint {
            note: Some(format!(
                "{}, node {}\n{name} z: {} mm",
                capitalised(&section.line.name()),
                of_row + 1,
                format_number(at.z)
            )),
            ..PlotPoint::from([place(at), at.z]).of_item(node)
        });
        let series = Series::new(format!("{name} nodes"), Look::marker(look.hue, marker), points);
        Some(series.listed(None))
    });
    let name = section.line.name();
    let (spans, notes) = match curves.is_empty() {
        false => (beyond(section.line, map), Vec::new()),
        true => {
            let note = "lies beyond the nodes: there is no surface above it.";
            (Vec::new(), vec![format!("{} {note}", capitalised(&name))])
        }
    };
    let plot = Plot::new(
        PlotAxis::linear(format!("{axis} along {name} (mm)")),
        PlotAxis::linear("z (mm)").including([*heights_mm.start(), *heights_mm.end()]),
        curves.iter().cloned().chain(nodes).collect(),
    );
    PlotFigure {
        plots: vec![Plot { spans, ..plot }],
        notes,
    }
}

/// The nodes on a row-wire: their numbers among all and on the wire, and their places. `None` for a column-wire, which
/// passes below the surface between them.
fn on_wire<'a>(
    line: SectionLine,
    rows: &[usize],
    nodes_mm: &'a [DVec3],
) -> Option<impl Iterator<Item = (usize, usize, &'a DVec3)> + use<'a>> {
    let SectionLine::RowWire(wire) = line else { return None };
    let row = rows.iter().position(|row| *row == wire)?;
    let per_row = nodes_mm.len() / rows.len();
    let first = row * per_row;
    let of_row = nodes_mm[first..first + per_row].iter().enumerate();
    Some(of_row.map(move |(of_row, at)| (first + of_row, of_row, at)))
}

/// The stretches on which the surface is extrapolated.
fn beyond(line: SectionLine, map: &SurfaceMap) -> Vec<Span> {
    let grid = map.grid();
    let (points_mm, inside) = match line {
        SectionLine::RowWire(_) => (grid.y_mm(), grid.inside_y()),
        SectionLine::ColumnWire(_) => (grid.x_mm(), grid.inside_x()),
    };
    let last = points_mm.len() - 1;
    let ends = [(0, *inside.start()), (*inside.end(), last)];
    let spans = ends.into_iter().filter(|(from, to)| from < to).map(|(from, to)| Span {
        name: "beyond the nodes".to_owned(),
        hue: Hue::Grey,
        range: points_mm[from]..=points_mm[to],
    });
    spans.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: [f64; 3] = [8.0, 9.0, 10.0];
    const Y: [f64; 4] = [3.0, 5.0, 7.0, 9.0];

    fn nodes(height: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
        let at = X.iter().flat_map(|&x| Y.iter().map(move |&y| (x, y)));
        at.map(|(x, y)| DVec3::new(x, y, height(x, y))).collect()
    }

    fn figure(line: SectionLine, at_mm: f64) -> PlotFigure {
        let map = SurfaceMap::new(&X, &Y).unwrap();
        let [actual, decoupled] = [nodes(|x, y| 4.0 + 0.05 * x - 0.02 * y), nodes(|_, y| 4.5 - 0.01 * y)];
        let values =
            [&actual, &decoupled].map(|nodes| map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>()));
        let cut = |place: usize, nodes| SectionNodes {
            values_mm: &values[place],
            nodes_mm: nodes,
        };
        let section = Section { line, at_mm };
        // Row-wires 3, 5 and 8 are read.
        section_figure(
            &section,
            &map,
            &[2, 4, 7],
            cut(0, &actual),
            Some(cut(1, &decoupled)),
            4.0..=5.0,
        )
    }

    #[test]
    fn along_a_row_wire_the_curves_pass_through_its_nodes() {
        let figure = figure(SectionLine::RowWire(4), 9.0);
        let [plot] = &figure.plots[..] else { panic!() };
        let names: Vec<&str> = plot.series.iter().map(|series| &*series.name).collect();
        assert_eq!(names, ["actual", "decoupled", "actual nodes", "decoupled nodes"]);
        for (curve, nodes) in [(0, 2), (1, 3)] {
            for (point, y) in plot.series[nodes].points.iter().zip(Y) {
                assert_eq!(point.x, y);
                let on_curve = plot.series[curve].points.iter().find(|at| (at.x - y).abs() < 1e-9);
                assert!((on_curve.unwrap().y - point.y).abs() < 1e-9);
            }
        }
        let node = &plot.series[3].points[2];
        assert_eq!(node.item, Some(6), "the third node of the second row read");
        assert_eq!(node.note.as_deref(), Some("Row-wire 5, node 3\ndecoupled z: 4.43 mm"));
        let beyond: Vec<_> = plot.spans.iter().map(|span| span.range.clone()).collect();
        assert_eq!(beyond, [2.0..=3.0, 9.0..=10.0]);
    }

    #[test]
    fn a_column_wire_has_curves_only_and_outside_the_nodes_a_reason() {
        let along = figure(SectionLine::ColumnWire(3), 4.0);
        let points = &along.plots[0].series[0].points;
        assert!(points.iter().all(|at| (at.y - (4.0 + 0.05 * at.x - 0.08)).abs() < 1e-9));
        assert_eq!(along.plots[0].series.len(), 2);
        assert_eq!(along.plots[0].x.name, "x along column-wire 4 (mm)");
        let outside = figure(SectionLine::ColumnWire(11), 12.0);
        assert!(outside.plots[0].series.is_empty() && outside.keys().is_empty());
        assert_eq!(
            outside.notes,
            ["Column-wire 12 lies beyond the nodes: there is no surface above it."]
        );
    }
}
