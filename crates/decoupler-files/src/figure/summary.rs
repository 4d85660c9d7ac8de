//! Short descriptions of figures for screen readers.

use super::{
    LineStyle,
    axis::{AxisScale, PlotAxis, TickRule},
    heat_map::HeatMap,
    plot::{Form, LineAt, Plot, PlotFigure, PlotPoint, Series},
    surface::{Quantity, Surface},
};
use decoupler_core::text::{counted, format_number};

/// Returns the items with the smallest and the largest value.
fn extremes<T: Copy>(items: impl Iterator<Item = T> + Clone, value: impl Fn(&T) -> f64) -> Option<(T, T)> {
    let by_value = |one: &T, other: &T| value(one).total_cmp(&value(other));
    Some((items.clone().min_by(by_value)?, items.max_by(by_value)?))
}

impl PlotFigure {
    /// Describes the figure in one sentence per plot, followed by its notes.
    pub fn summary(&self) -> String {
        let plots = self.plots.iter().map(Plot::summary);
        plots.chain(self.notes.iter().cloned()).collect::<Vec<_>>().join(" ")
    }
}

impl Plot {
    /// Describes the plot in a sentence: its axes, the course of each curve, the extent of each cloud of points,
    /// the highest bar.
    pub fn summary(&self) -> String {
        let scale = match self.y.scale {
            AxisScale::Logarithmic => " on a logarithmic scale",
            AxisScale::Linear => "",
        };
        let series = self.series.iter().filter_map(|series| self.words_about(series));
        let parts = Vec::from_iter(series).join("; ");
        let parts = if parts.is_empty() { "nothing to show" } else { &parts };
        format!("{}{scale} against {}: {parts}.", self.y.name, self.x.name)
    }

    /// Describes a series; `None` if no point of it is drawn.
    fn words_about(&self, series: &Series) -> Option<String> {
        let name = &series.name;
        match series.form {
            Form::Across(LineAt::X(x)) if name.contains(&self.x.value_text(x)) => return Some(name.clone()),
            Form::Across(LineAt::X(x)) => return Some(format!("{name} at {}", self.x.value_text(x))),
            Form::Across(LineAt::Y(y)) => return Some(format!("{name} at {}", self.y.value_text(y))),
            Form::Across(LineAt::Between(_)) => return None,
            Form::Points | Form::Bars(_) => {}
        }
        let points: Vec<&PlotPoint> = self.placed(series).map(|(point, _)| point).collect();
        let (first, last) = (points.first()?, points.last()?);
        let (lowest, highest) = extremes(points.iter(), |point| point.y)?;
        // An axis without values only keeps the points apart.
        let has_values = self.y.ticks != TickRule::Nothing;
        let at = |point: &PlotPoint| match has_values {
            true => format!("{} at {}", self.y.value_text(point.y), self.x.value_text(point.x)),
            false => self.x.value_text(point.x),
        };
        Some(if series.form != Form::Points {
            format!("{}, the highest {}", counted(points.len(), "bar"), at(highest))
        } else if points.len() == 1 {
            format!("{name}: {}", at(first))
        } else if series.look.line.is_some_and(|style| style != LineStyle::Fine) {
            let extremes = [("lowest", lowest), ("highest", highest)].into_iter();
            let inner = extremes.filter(|(_, point)| point.y != first.y && point.y != last.y);
            let inner: String = inner.map(|(what, point)| format!(", {what} {}", at(point))).collect();
            format!("{name} from {} to {}{inner}", at(first), at(last))
        } else {
            let range = |axis: &PlotAxis, low: f64, high: f64| {
                format!(", {} {} to {}", axis.name, axis.value_text(low), axis.value_text(high))
            };
            let (leftmost, rightmost) = extremes(points.iter(), |point| point.x)?;
            let mut words = format!("{} of {name}", counted(points.len(), "point"));
            if has_values {
                words += &range(&self.y, lowest.y, highest.y);
            }
            words + &range(&self.x, leftmost.x, rightmost.x)
        })
    }
}

impl HeatMap {
    /// Describes the map in a sentence: its values, and the places of their minimum and maximum.
    pub fn summary(&self) -> String {
        let ((rows, columns), [x_name, y_name]) = (self.values.dim(), [&self.x_name, &self.y_name]);
        let head = format!(
            "{} over {y_name} and {x_name}, {rows} × {columns}",
            self.value_axis.name
        );
        let finite = self.values.indexed_iter().filter(|(_, value)| value.is_finite());
        let Some((least, largest)) = extremes(finite, |(_, value)| **value) else {
            return format!("{head}: no values.");
        };
        let at = |((row, column), value): ((usize, usize), &f64)| {
            let (value, row, column) = (
                self.value_axis.value_text(*value),
                &self.rows[row],
                &self.columns[column],
            );
            format!("{value} at {y_name} {row}, {x_name} {column}")
        };
        format!("{head}: from {} to {}.", at(least), at(largest))
    }
}

impl Surface {
    /// Returns the range of its nodes: "z 4.00 to 5.00 mm".
    pub fn range_text(&self) -> String {
        let nodes = self.nodes.iter().filter(|node| node.is_finite());
        let range = extremes(nodes, |node| node.z);
        range.map_or_else(
            || "no values".to_owned(),
            |(low, high)| self.quantity.range_text(low.z, high.z),
        )
    }

    /// Describes the surface: the range of its nodes, and the place furthest from rest.
    pub fn summary(&self) -> String {
        let (range, nodes) = (self.range_text(), counted(self.nodes.len(), "node"));
        let finite = self.nodes.iter().filter(|node| node.is_finite());
        let Some((lowest, highest)) = extremes(finite, |node| node.z) else {
            return range;
        };
        if lowest.z == highest.z {
            return format!("{range}, the same at {nodes}");
        }
        let (what, furthest) = match self.quantity {
            Quantity::Height => ("lowest", lowest),
            Quantity::Sensitivity | Quantity::Target(_) => ("largest", highest),
            Quantity::Error | Quantity::Pattern | Quantity::TargetError(_) => {
                let furthest = if -lowest.z > highest.z { lowest } else { highest };
                ("furthest from zero", furthest)
            }
        };
        let [x, y] = [furthest.x, furthest.y].map(|place_mm| format_number(place_mm).replace('-', "−"));
        format!("{range} over {nodes}, {what} at x {x}, y {y} mm")
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use ndarray::array;

    use super::*;
    use crate::figure::{
        Decoded, Hue, Look, Marker, SequentialMap, histogram_figure, node_figure, readings_figure, surface::ViewMode,
    };
    use decoupler_core::surface::SurfaceMap;

    #[test]
    fn a_curve_is_described_by_its_ends_and_extremes() {
        let curve = Series::new(
            "training",
            Look::line(Hue::Blue, LineStyle::Solid),
            [[0.0, 1.5], [1.0, 2.5], [2.0, 0.01], [3.0, 0.25], [4.0, 0.0]],
        );
        let mut plot = Plot::new(
            PlotAxis::linear("epoch"),
            PlotAxis::logarithmic("mse (scaled)"),
            vec![curve],
        );
        let line = |name: &str| Series::across(name, LineAt::X(2.0), Hue::Grey, LineStyle::Dashed);
        plot.series
            .extend([line("best weights, epoch 2"), line("displayed network")]);
        // A zero has no place on a logarithmic axis and is left out.
        assert_eq!(
            plot.summary(),
            "mse (scaled) on a logarithmic scale against epoch: training from 1.50 at 0 to 0.250 at 3, lowest 0.0100 at 2, \
             highest 2.50 at 1; best weights, epoch 2; displayed network at 2."
        );
        plot.series.clear();
        assert_eq!(
            plot.summary(),
            "mse (scaled) on a logarithmic scale against epoch: nothing to show."
        );
    }

    #[test]
    fn bars_and_clouds_of_points_are_described_by_their_extent() {
        let pairs: Vec<(f64, f64)> = [-0.2, 0.0, 0.0, 0.2].map(|error| (4.0, 4.0 + error)).into();
        let histogram = histogram_figure(&pairs, None, Decoded::Nodes).summary();
        assert_eq!(
            histogram,
            "nodes of the test set against error of z (mm), decoupled − actual: 41 bars, the highest 2 at 0; no error at 0."
        );
        let nodes = [4.5, 4.0, 5.0].map(|z| DVec3::new(1.0, 2.0, z));
        assert_eq!(
            node_figure(&nodes, None, None, 3).summary(),
            "z (mm) against node, row by row: 3 points of actual, z (mm) 4 to 5, node, row by row 1 to 3."
        );
        let one = Series::new("run", Look::marker(Hue::Red, Marker::Disc), [[2.0, -0.5]]);
        let plot = Plot::new(PlotAxis::linear("µs"), PlotAxis::linear("mm"), vec![one]);
        assert_eq!(plot.summary(), "mm against µs: run: −0.500 at 2.");
    }

    #[test]
    fn maps_and_surfaces_are_described_by_their_extremes() {
        let map = readings_figure(array![[0.0, 3.0], [f64::NAN, 1.5]], &[0, 4], 4.0);
        assert_eq!(
            map.summary(),
            "drop from unloaded (%) over row-wire and column-wire, 2 × 2: from 0 at row-wire 1, column-wire 1 to 3 at \
             row-wire 1, column-wire 2."
        );
        let (x, y) = ([8.0, 9.0], [3.0, 5.0]);
        let nodes = |z: [f64; 4]| -> Vec<DVec3> {
            let at = x.iter().flat_map(|&x| y.map(|y| (x, y)));
            at.zip(z).map(|((x, y), z)| DVec3::new(x, y, z)).collect()
        };
        let surface = |quantity, z: [f64; 4]| Surface {
            title: String::new(),
            map: Arc::new(SurfaceMap::new(&x, &y).unwrap()),
            values: Arc::new([]),
            nodes: nodes(z).into(),
            quantity,
            range: 0.0..=1.0,
            mode: ViewMode::Top,
            colours: SequentialMap::default(),
        };
        let cases = [
            (
                Quantity::Height,
                [5.0, 4.5, 4.25, f64::NAN],
                "z 4.25 to 5.00 mm over 4 nodes, lowest at x 9.00, y 3.00 mm",
            ),
            (
                Quantity::Error,
                [0.1, -0.3, 0.0, 0.2],
                "error −0.30 to 0.20 mm over 4 nodes, furthest from zero at x 8.00, y 5.00 mm",
            ),
            (Quantity::Height, [5.0; 4], "z 5.00 to 5.00 mm, the same at 4 nodes"),
            (Quantity::Height, [f64::NAN; 4], "no values"),
        ];
        for (quantity, z, expected) in cases {
            assert_eq!(surface(quantity, z).summary(), expected);
        }
    }
}
