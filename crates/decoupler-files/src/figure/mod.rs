//! Figures as values: the contents of a picture, independent of how it is drawn.
//!
//! A [`Figure`] is described once by a function that knows the data, such as [`loss_figure`]. The window draws it with
//! its theme and shows its texts under the pointer; [`crate::export::figures`] draws it as SVG and PNG. Surfaces, heat
//! maps and colour scales are laid out here, as [`Shape`]s that both paint; plots are laid out by `egui_plot` on the
//! screen. Values that are not finite are left out.

mod axis;
mod colour_map;
mod drawing;
mod heat_map;
mod of_epochs;
mod of_errors;
mod of_experiment;
mod of_recorded;
mod of_sample;
mod of_trade_off;
mod plot;
pub mod surface;

pub(crate) use axis::ends;
pub use axis::{PlotAxis, Scale, Ticks, tick_text};
pub use colour_map::{ColourMap, Rgb, SequentialMap, is_light};
pub use drawing::{Align, Bounds, Colour, Measure, Shape, Stroke};
pub use heat_map::{HeatMap, HeatMapDrawing};
pub use of_epochs::{EpochOutline, compared_losses_figure, loss_figure, training_state_figure};
pub use of_errors::{
    Decoded, RegressionLine, histogram_figure, pair_address, pair_sample, regression_figure, value_pairs,
};
pub use of_experiment::experiment_figure;
pub use of_recorded::{TargetSurface, hysteresis_figure, position_error_map};
pub use of_sample::{TimeSeries, node_figure, readings_figure, singular_values_figure};
pub use of_trade_off::{
    TradeOffCost, TradeOffLevel, TradeOffLimits, frame_time, point_facts, point_name, trade_off_figure, training_time,
};
pub use plot::{Form, LineAt, Plot, PlotFigure, PlotPoint, Series};
pub use surface::section_figure;

use decoupler_core::decoupling::DecoderKind;
use surface::SurfaceFigure;

/// Any picture.
#[derive(Clone, Debug)]
pub enum Figure {
    /// Plots side by side.
    Plots(PlotFigure),
    /// Values over two axes.
    HeatMap(Box<HeatMap>),
    /// Surfaces side by side.
    Surfaces(SurfaceFigure),
}

impl From<PlotFigure> for Figure {
    fn from(plots: PlotFigure) -> Self {
        Self::Plots(plots)
    }
}

impl From<HeatMap> for Figure {
    fn from(map: HeatMap) -> Self {
        Self::HeatMap(Box::new(map))
    }
}

impl From<SurfaceFigure> for Figure {
    fn from(surfaces: SurfaceFigure) -> Self {
        Self::Surfaces(surfaces)
    }
}

/// Role of a colour. The window resolves it by its theme, print by a palette for white paper; in both, the hues of series can
/// be distinguished in grey and by most colour-blind readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Ink {
    /// The network's own result.
    Blue,
    /// A comparison that failed or differs most.
    Red,
    /// The validation set; a bound.
    Green,
    /// The test set; a second run.
    Orange,
    /// A further series.
    Violet,
    /// A further series.
    Cyan,
    /// References and baselines.
    Grey,
    /// Text, and published values.
    Text,
    /// Grid lines.
    Grid,
    /// Outlines and ticks.
    Edge,
    /// Numbers and names of axes.
    Label,
    /// The background of the card.
    Ground,
    /// A cell without a value.
    Missing,
    /// The same in every theme.
    Rgb(Rgb),
}

impl Ink {
    /// The hue of a decoder in charts, a different one for each.
    pub fn of_decoder(kind: DecoderKind) -> Self {
        match kind {
            DecoderKind::Mean => Self::Grey,
            DecoderKind::Ridge => Self::Violet,
            DecoderKind::Network => Self::Blue,
            DecoderKind::RadialBasis => Self::Orange,
            DecoderKind::Fuzzy => Self::Cyan,
            DecoderKind::Newton => Self::Red,
            DecoderKind::Polish => Self::Green,
        }
    }
}

/// Style of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineStyle {
    /// A curve.
    Solid,
    /// A reference, or the less important of two curves.
    Dashed,
    /// A limit set by the user.
    Dotted,
    /// Thin and pale: one of many.
    Fine,
}

/// Symbol at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Marker {
    /// A small filled circle: one of many.
    Dot,
    /// A filled circle.
    Disc,
    /// A hollow circle.
    Ring,
    /// A hollow circle around another symbol.
    Halo,
    /// A hollow square.
    Square,
    /// A filled diamond.
    Diamond,
    /// A hollow diamond.
    HollowDiamond,
}

/// Appearance of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Look {
    /// Colour of everything.
    pub ink: Ink,
    /// Line from point to point.
    pub line: Option<LineStyle>,
    /// Symbol at each point.
    pub marker: Option<Marker>,
}

impl Look {
    /// A line without symbols; without a style a filled area, such as a band or the bars of a histogram.
    pub fn line(ink: Ink, style: impl Into<Option<LineStyle>>) -> Self {
        let (line, marker) = (style.into(), None);
        Self { ink, line, marker }
    }

    /// Symbols without a line.
    pub const fn marker(ink: Ink, marker: Marker) -> Self {
        let (line, marker) = (None, Some(marker));
        Self { ink, line, marker }
    }

    /// Symbols joined by a line.
    pub fn joined(mut self, style: impl Into<Option<LineStyle>>) -> Self {
        self.line = style.into();
        self
    }
}

/// Returns the first of the items with each key.
fn unique_by<T, K: PartialEq>(items: impl Iterator<Item = T>, key: impl Fn(&T) -> K) -> Vec<T> {
    let mut unique: Vec<T> = Vec::new();
    for item in items {
        if unique.iter().all(|other| key(other) != key(&item)) {
            unique.push(item);
        }
    }
    unique
}

/// Returns a name with its unit in brackets, if there is one.
fn titled(name: &str, unit: Option<&str>) -> String {
    unit.map_or_else(|| name.to_owned(), |unit| format!("{name} ({unit})"))
}

/// Returns a value with its unit behind it, if there is one.
fn with_unit(value: impl std::fmt::Display, unit: Option<&str>) -> String {
    unit.map_or_else(|| value.to_string(), |unit| format!("{value} {unit}"))
}

/// Returns the items with the smallest and the largest value.
fn extremes<T: Copy>(items: impl Iterator<Item = T> + Clone, value: impl Fn(&T) -> f64) -> Option<(T, T)> {
    let by_value = |one: &T, other: &T| value(one).total_cmp(&value(other));
    Some((items.clone().min_by(by_value)?, items.max_by(by_value)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoders_have_different_colours() {
        for (index, kind) in DecoderKind::ALL.into_iter().enumerate() {
            let others = &DecoderKind::ALL[..index];
            assert!(
                others
                    .iter()
                    .all(|&other| Ink::of_decoder(other) != Ink::of_decoder(kind)),
                "{kind}"
            );
        }
    }
}

#[cfg(test)]
mod summary_tests {
    use std::sync::Arc;

    use glam::DVec3;
    use ndarray::array;

    use super::surface::{Quantity, Surface};
    use super::*;
    use crate::figure::{
        Decoded, Ink, Look, Marker, SequentialMap, histogram_figure, node_figure, readings_figure, surface::ViewMode,
    };
    use decoupler_core::surface::SurfaceMap;

    #[test]
    fn a_curve_is_described_by_its_ends_and_extremes() {
        let curve = Series::new(
            "training",
            Look::line(Ink::Blue, LineStyle::Solid),
            [[0.0, 1.5], [1.0, 2.5], [2.0, 0.01], [3.0, 0.25], [4.0, 0.0]],
        );
        let mut plot = Plot::new(
            PlotAxis::linear("epoch"),
            PlotAxis::logarithmic("mse (scaled)"),
            vec![curve],
        );
        let line = |name: &str| Series::across(name, LineAt::X(2.0), Ink::Grey, LineStyle::Dashed);
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
        let histogram = histogram_figure(&pairs, Decoded::Nodes).summary();
        assert_eq!(
            histogram,
            "nodes against error of z (mm), decoded − actual: 41 bars, the highest 2 at 0; no error at 0."
        );
        let nodes = [4.5, 4.0, 5.0].map(|z| DVec3::new(1.0, 2.0, z));
        assert_eq!(
            node_figure(&nodes, None, None, 3).summary(),
            "z (mm) against node, row by row: 3 points of actual, z (mm) 4 to 5, node, row by row 1 to 3."
        );
        let one = Series::new("run", Look::marker(Ink::Red, Marker::Disc), [[2.0, -0.5]]);
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
