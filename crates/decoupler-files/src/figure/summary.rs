//! Short descriptions of figures for screen readers.

use super::{
    LineStyle,
    axis::{AxisScale, PlotAxis, TickRule},
    heat_map::HeatMap,
    plot::{LineAt, Plot, PlotFigure, PlotPoint, Series},
    surface::{Quantity, Surface},
};
use decoupler_core::text::{counted, format_number};

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
        let on_logarithmic = if self.y.scale == AxisScale::Logarithmic {
            " on a logarithmic scale"
        } else {
            ""
        };
        let mut parts: Vec<String> = self
            .series
            .iter()
            .filter_map(|series| self.words_about(series))
            .collect();
        parts.extend(self.lines.iter().map(|line| match line.at {
            LineAt::X(x) if line.name.contains(&self.x.value_text(x)) => line.name.clone(),
            LineAt::X(x) => format!("{} at {}", line.name, self.x.value_text(x)),
            LineAt::Y(y) => format!("{} at {}", line.name, self.y.value_text(y)),
        }));
        let head = format!("{}{on_logarithmic} against {}", self.y.name, self.x.name);
        if parts.is_empty() {
            format!("{head}: nothing to show.")
        } else {
            format!("{head}: {}.", parts.join("; "))
        }
    }

    /// Describes a series; `None` if no point of it is drawn.
    fn words_about(&self, series: &Series) -> Option<String> {
        let points: Vec<&PlotPoint> = self.placed(series).map(|(point, _)| point).collect();
        let (first, last) = (points.first()?, points.last()?);
        let of = |pick: fn(&PlotPoint) -> f64| {
            let by_value = |one: &&&PlotPoint, other: &&&PlotPoint| pick(one).total_cmp(&pick(other));
            let (least, largest) = (points.iter().min_by(by_value), points.iter().max_by(by_value));
            Some((*least?, *largest?))
        };
        let ((lowest, highest), (leftmost, rightmost)) = (of(|point| point.y)?, of(|point| point.x)?);
        // An axis without values only keeps the points apart.
        let has_values = self.y.ticks != TickRule::Nothing;
        let at = |point: &PlotPoint| match has_values {
            true => format!("{} at {}", self.y.value_text(point.y), self.x.value_text(point.x)),
            false => self.x.value_text(point.x),
        };
        let name = &series.name;
        Some(if series.bar_width.is_some() {
            format!("{}, the highest {}", counted(points.len(), "bar"), at(highest))
        } else if series.look.line.is_some_and(|style| style != LineStyle::Fine) && points.len() > 1 {
            let inner = |point: &PlotPoint| point.y != first.y && point.y != last.y;
            let extremes = [("lowest", lowest), ("highest", highest)].into_iter();
            let extremes = extremes.filter(|(_, point)| inner(point));
            let extremes: String = extremes
                .map(|(what, point)| format!(", {what} {}", at(point)))
                .collect();
            format!("{name} from {} to {}{extremes}", at(first), at(last))
        } else if points.len() == 1 {
            format!("{name}: {}", at(first))
        } else {
            let range = |axis: &PlotAxis, low: f64, high: f64| {
                format!(", {} {} to {}", axis.name, axis.value_text(low), axis.value_text(high))
            };
            let heights = has_values.then(|| range(&self.y, lowest.y, highest.y));
            format!(
                "{} of {name}{}{}",
                counted(points.len(), "point"),
                heights.unwrap_or_default(),
                range(&self.x, leftmost.x, rightmost.x)
            )
        })
    }
}

impl HeatMap {
    /// Describes the map in a sentence: its values, and the places of their minimum and maximum.
    pub fn summary(&self) -> String {
        let (rows, columns) = self.values.dim();
        let head = format!(
            "{} over {} and {}, {rows} × {columns}",
            self.value_axis.name, self.y_name, self.x_name
        );
        let finite = || self.values.indexed_iter().filter(|(_, value)| value.is_finite());
        let least = finite().min_by(|one, other| one.1.total_cmp(other.1));
        let largest = finite().max_by(|one, other| one.1.total_cmp(other.1));
        let Some((least, largest)) = least.zip(largest) else {
            return format!("{head}: no values.");
        };
        let at = |((row, column), value): ((usize, usize), &f64)| {
            format!(
                "{} at {} {}, {} {}",
                self.value_axis.value_text(*value),
                self.y_name,
                self.rows[row],
                self.x_name,
                self.columns[column]
            )
        };
        format!("{head}: from {} to {}.", at(least), at(largest))
    }
}

impl Surface {
    /// Describes the surface: the range of its nodes, and the place furthest from rest.
    pub fn summary(&self) -> String {
        let finite = || self.nodes.iter().filter(|node| node.is_finite());
        let lowest = finite().min_by(|one, other| one.z.total_cmp(&other.z));
        let highest = finite().max_by(|one, other| one.z.total_cmp(&other.z));
        let Some((lowest, highest)) = lowest.zip(highest) else {
            return "no values".to_owned();
        };
        let hundredths = |value: f64| format!("{value:.2}").replace('-', "−");
        let number = |value: f64| format_number(value).replace('-', "−");
        let (low, high) = (lowest.z, highest.z);
        let range = self.quantity.range_text((low, high), hundredths, number);
        let (what, furthest) = match self.quantity {
            Quantity::Height => ("lowest", lowest),
            Quantity::Sensitivity | Quantity::Target(_) => ("largest", highest),
            Quantity::Error | Quantity::Pattern | Quantity::TargetError(_) if -low > high => {
                ("furthest from zero", lowest)
            }
            Quantity::Error | Quantity::Pattern | Quantity::TargetError(_) => ("furthest from zero", highest),
        };
        let nodes = counted(self.nodes.len(), "node");
        if low == high {
            return format!("{range}, the same at {nodes}");
        }
        format!(
            "{range} over {nodes}, {what} at x {}, y {} mm",
            number(furthest.x),
            number(furthest.y)
        )
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use ndarray::array;

    use super::*;
    use crate::figure::{
        Hue, Look, Marker, ReferenceLine, SequentialMap, error_histogram_figure, node_figure, readings_figure,
        surface::ViewMode,
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
        let line = |name: &str| ReferenceLine::new(name, LineAt::X(2.0), Hue::Grey, LineStyle::Dashed);
        plot.lines = vec![line("best weights, epoch 2"), line("displayed network")];
        // A zero has no place on a logarithmic axis and is left out.
        assert_eq!(
            plot.summary(),
            "mse (scaled) on a logarithmic scale against epoch: training from 1.50 at 0 to 0.250 at 3, lowest 0.0100 at 2, \
             highest 2.50 at 1; best weights, epoch 2; displayed network at 2."
        );
        plot.series.clear();
        plot.lines.clear();
        assert_eq!(
            plot.summary(),
            "mse (scaled) on a logarithmic scale against epoch: nothing to show."
        );
    }

    #[test]
    fn bars_and_clouds_of_points_are_described_by_their_extent() {
        let pairs: Vec<(f64, f64)> = [-0.2, 0.0, 0.0, 0.2].map(|error| (4.0, 4.0 + error)).into();
        let histogram = error_histogram_figure(&pairs, None).summary();
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
