//! Figures of targets of any meaning, decoded from recorded readings, and surfaces through targets with positions on
//! the skin.

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::{
    evaluation::recorded::HysteresisLoop,
    problem::{Channel, TargetPosition},
    surface::{SurfaceError, SurfaceMap},
    text::{counted, format_number},
};
use glam::DVec3;
use ndarray::{Array2, ArrayView2};

use super::{
    Ink, LineStyle, Look,
    axis::{PlotAxis, ends, step_for, tick_text},
    colour_map::SequentialMap,
    heat_map::HeatMap,
    of_errors::decoded_against_actual,
    plot::{Plot, PlotFigure, Series},
    surface::{Quantity, Surface},
    titled, with_unit,
};

/// Mean decoded against actual values of `target` while it rises and while it falls, with the line on which they would be
/// equal; next to it their differences from the actual values, which show a narrow loop.
pub fn hysteresis_figure(found: &HysteresisLoop, target: &Channel) -> PlotFigure {
    // The actual value at each level, and the mean ones of loading and unloading.
    let named = |name: &str, rmse| format!("{name}, RMSE {}", format_number(rmse));
    let branches = [
        ("equal".to_owned(), Ink::Text, LineStyle::Dashed),
        (named("loading", found.loading.rmse), Ink::Blue, LineStyle::Solid),
        (named("unloading", found.unloading.rmse), Ink::Orange, LineStyle::Solid),
    ];
    let series = |is_difference: bool| {
        let branches = branches.iter().enumerate().map(|(branch, (name, ink, style))| {
            let less = |level: &[f64; 3]| if is_difference { level[0] } else { 0.0 };
            let points = found.levels.iter().map(|level| [level[0], level[branch] - less(level)]);
            Series::new(name, Look::line(*ink, *style), points)
        });
        Vec::from_iter(branches)
    };
    let (title, unit) = (target.title(), target.unit.as_deref());
    let note = format!("Hysteresis {:.1} % of the range", found.percent_of_range);
    let mut figure = decoded_against_actual(&title, "decoded", series(false), vec![note]);
    let [x, y] = [format!("actual {title}"), titled("decoded − actual", unit)].map(PlotAxis::linear);
    figure.plots.push(Plot::new(x, y, series(true)));
    figure
}

/// Maximum number of cells along an axis of a map, not counting cells added by rounding its limits.
const CELLS: usize = 16;

/// Error of a position over the position: root mean square of the distance between the decoded and the actual one, for
/// the samples in each cell. `targets` and `answers` are samples × 2; `names` are those of both axes, in `unit`.
///
/// `None` if a position does not vary, or a value is not finite.
pub fn position_error_map(
    targets: ArrayView2<'_, f64>,
    answers: ArrayView2<'_, f64>,
    names: [&str; 2],
    unit: Option<&str>,
) -> Option<HeatMap> {
    if targets.iter().chain(&answers).any(|value| !value.is_finite()) {
        return None;
    }
    let [across, up] = [0, 1].map(|axis| Cells::of(targets.column(axis).iter().copied()));
    let (across, up) = (across?, up?);
    // The first row is at the top.
    let row = |cell: usize| up.count - 1 - cell;
    let mut cells = Array2::from_elem((up.count, across.count), (0.0, 0_usize));
    for (target, answer) in targets.rows().into_iter().zip(answers.rows()) {
        let (squares, count) = &mut cells[[row(up.place(target[1])), across.place(target[0])]];
        *squares += (answer[0] - target[0]).powi(2) + (answer[1] - target[1]).powi(2);
        *count += 1;
    }
    let values = cells.map(|&(squares, count)| (squares / count as f64).sqrt());
    let notes = Array2::from_shape_fn(cells.dim(), |at| {
        let [x, y] = [across.range_text(at.1), up.range_text(row(at.0))].map(|range| with_unit(range, unit));
        let error = with_unit(format_number(values[at]), unit);
        let found = match cells[at].1 {
            0 => "no test sample".to_owned(),
            count => format!("error {error} over {}", counted(count, "test sample")),
        };
        format!("{} {x}, {} {y}: {found}", names[0], names[1])
    });
    Some(HeatMap {
        x_name: titled(names[0], unit),
        y_name: titled(names[1], unit),
        columns: (0..across.count).map(|cell| across.centre_text(cell)).collect(),
        rows: (0..up.count).rev().map(|cell| up.centre_text(cell)).collect(),
        values,
        notes,
        value_axis: PlotAxis::linear(titled("error in both targets", unit)).including([0.0]),
        colours: SequentialMap::default(),
    })
}

/// Cells of equal width along an axis, with round limits.
struct Cells {
    first: f64,
    width: f64,
    count: usize,
}

impl Cells {
    /// Returns `None` if the values do not vary, or if their range overflows.
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (low, high) = ends(values);
        if low >= high || !(high - low).is_finite() {
            return None;
        }
        let width = step_for(&(low..=high), CELLS);
        let first = (low / width).floor() * width;
        let count = (((high - first) / width) as usize + 1).min(CELLS + 2);
        Some(Self { first, width, count })
    }

    fn place(&self, value: f64) -> usize {
        (((value - self.first) / self.width) as usize).min(self.count - 1)
    }

    fn range_text(&self, cell: usize) -> String {
        let ends = [cell, cell + 1].map(|end| self.first + self.width * end as f64);
        ends.map(|end| tick_text(end, self.width)).join(" to ")
    }

    fn centre_text(&self, cell: usize) -> String {
        tick_text(self.first + self.width * (cell as f64 + 0.5), 0.1 * self.width)
    }
}

/// Targets with positions, and the surface through them.
#[derive(Clone, Debug)]
pub struct TargetSurface {
    map: Arc<SurfaceMap>,
    /// The targets at the nodes, in the order of the map.
    nodes: Vec<TargetPosition>,
    unit: Option<Arc<str>>,
}

impl TargetSurface {
    /// Prepares the surface through the targets with these positions: of a lattice if they form one, else of scattered
    /// nodes.
    ///
    /// # Errors
    /// [`SurfaceError`] if no surface goes through them: see [`SurfaceMap::scattered`].
    pub fn new(positions: &[TargetPosition], targets: &[Channel]) -> Result<Self, SurfaceError> {
        let first = positions.first().and_then(|first| targets.get(first.target));
        let unit = first.and_then(|first| first.unit.as_deref()).map(Arc::from);
        let (map, nodes) = match TargetPosition::lattice(positions) {
            Some(([x_mm, y_mm], order)) => {
                let nodes = order.iter().map(|&place| positions[place]);
                (SurfaceMap::shared(&x_mm, &y_mm)?, nodes.collect())
            }
            None => {
                let map = SurfaceMap::scattered(&TargetPosition::places_mm(positions))?;
                (Arc::new(map), positions.to_vec())
            }
        };
        Ok(Self { map, nodes, unit })
    }

    /// The targets at the nodes, in the order of [`Surface::nodes`].
    pub fn nodes(&self) -> &[TargetPosition] {
        &self.nodes
    }

    /// Surfaces of a sample: the actual values, the decoded ones, and decoded minus actual. `actual` and `decoded` have an
    /// entry for each target, `range` is that of the values.
    pub fn surfaces(&self, actual: &[f64], decoded: &[f64], range: RangeInclusive<f64>) -> [Surface; 3] {
        let nodes = [actual, decoded].map(|values| {
            let node = |node: &TargetPosition| DVec3::new(node.x_mm, node.y_mm, values[node.target]);
            self.nodes.iter().map(node).collect()
        });
        let [value, error] = [Quantity::Target, Quantity::TargetError].map(|of_unit| of_unit(self.unit.clone()));
        // Rounding errors are not distinguished by colour.
        let least = 1e-9 * (range.end() - range.start());
        Surface::compared("Decoded", &self.map, nodes, [value, error], range, least)
    }

    /// Returns the range of the targets at the nodes; `ranges` are the minimum and maximum of each target.
    pub fn range_of(&self, ranges: &[(f64, f64)]) -> RangeInclusive<f64> {
        let (low, high) = ends(self.nodes.iter().flat_map(|node| <[f64; 2]>::from(ranges[node.target])));
        low..=high
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::dataset::{Dataset, SplitBy};
    use ndarray::array;

    use super::*;

    #[test]
    fn a_loop_has_a_branch_on_either_side_of_the_diagonal() {
        let actual = Array2::from_shape_fn((400, 1), |(sample, _)| (0.0628 * sample as f64).sin());
        let rises = |sample: usize| (0.0628 * sample as f64).cos() > 0.0;
        let decoded = Array2::from_shape_fn((400, 1), |(sample, _)| {
            actual[[sample, 0]] + if rises(sample) { -0.1 } else { 0.1 }
        });
        let test = Dataset::new(actual.clone(), actual, None, (0..400).collect()).unwrap();
        let found = HysteresisLoop::of_test(&test, decoded.view(), SplitBy::Time)
            .remove(0)
            .unwrap();
        let force = Channel::new("force", Some("N"));
        let figure = hysteresis_figure(&found, &force);
        let [_, differences] = &figure.plots[..] else {
            panic!("{figure:?}");
        };
        for (series, expected) in differences.series.iter().zip([0.0, -0.1, 0.1]) {
            assert!(
                series.points.iter().all(|point| (point.y - expected).abs() < 0.02),
                "{series:?}"
            );
        }
        let [equal, loading, unloading] = &figure.plots[0].series[..] else {
            panic!("{figure:?}");
        };
        assert!(equal.points.len() > 15, "{equal:?}");
        for place in 0..equal.points.len() {
            let [low, middle, high] = [loading, equal, unloading].map(|series| series.points[place].y);
            assert!(
                (middle - low - 0.1).abs() < 0.02 && (high - middle - 0.1).abs() < 0.02,
                "{low} {middle} {high}"
            );
        }
        assert!(figure.notes[0].starts_with("Hysteresis 10"), "{:?}", figure.notes);
    }

    #[test]
    fn a_cell_has_the_root_mean_square_distance_of_its_samples() {
        // Cells are 1 wide; the first two samples share one, 3–4–5 triangles give the distances.
        let targets = array![[0.2, 0.2], [0.8, 0.8], [11.9, 11.9]];
        let answers = array![[3.2, 4.2], [0.8, 0.8], [11.9, 10.9]];
        let map = position_error_map(targets.view(), answers.view(), ["x", "y"], Some("mm")).unwrap();
        assert_eq!(map.values.dim(), (12, 12));
        assert!(
            (map.values[[11, 0]] - 12.5_f64.sqrt()).abs() < 1e-12,
            "below on the left"
        );
        assert!((map.values[[0, 11]] - 1.0).abs() < 1e-12, "above on the right");
        assert_eq!(map.values.iter().filter(|value| value.is_nan()).count(), 142);
        assert_eq!(
            map.notes[[11, 0]],
            "x 0 to 1 mm, y 0 to 1 mm: error 3.54 mm over 2 test samples"
        );
        assert_eq!(map.notes[[0, 0]], "x 0 to 1 mm, y 11 to 12 mm: no test sample");
        assert_eq!((map.rows[0].as_str(), map.columns[0].as_str()), ("11.5", "0.5"));
    }

    #[test]
    fn constant_or_infinite_positions_have_no_map() {
        let varying = array![[0.0, 0.0], [1.0, 1.0]];
        for targets in [array![[1.0, 0.0], [1.0, 2.0]], array![[0.0, f64::NAN], [1.0, 2.0]]] {
            assert!(position_error_map(targets.view(), varying.view(), ["x", "y"], None).is_none());
        }
        let huge = array![[-1e308, 0.0], [1e308, 1.0]];
        assert!(position_error_map(huge.view(), huge.view(), ["x", "y"], None).is_none());
    }

    /// 2 × 3 targets in shuffled order with others between them, and a plane over the skin.
    fn plane() -> (TargetSurface, Vec<f64>) {
        let channel = |unit: &str| Channel::new(String::new(), Some(unit));
        let targets = Vec::from_iter((0..8).map(|target| channel(if target == 3 { "°C" } else { "N" })));
        let places = [
            (7, 0.0, 5.0),
            (0, 2.0, 0.0),
            (6, 2.0, 10.0),
            (1, 0.0, 0.0),
            (4, 2.0, 5.0),
            (2, 0.0, 10.0),
        ];
        let positions = places.map(|(target, x_mm, y_mm)| TargetPosition { target, x_mm, y_mm });
        let mut values = vec![f64::NAN; 8];
        for position in &positions {
            values[position.target] = 1.0 + 0.5 * position.x_mm - 0.2 * position.y_mm;
        }
        (TargetSurface::new(&positions, &targets).unwrap(), values)
    }

    #[test]
    fn a_plane_over_the_skin_is_drawn_as_that_plane() {
        let (surface, actual) = plane();
        let decoded = Vec::from_iter(actual.iter().map(|value| value + 0.25));
        let [actual, decoded, error] = surface.surfaces(&actual, &decoded, -1.0..=2.0);
        let grid = actual.map.grid();
        for (ix, x) in grid.x_mm().iter().enumerate() {
            for (iy, y) in grid.y_mm().iter().enumerate() {
                let (at, expected) = (grid.index(ix, iy), 1.0 + 0.5 * x - 0.2 * y);
                assert!((actual.values[at] - expected).abs() < 1e-9, "{x} {y}");
                assert!((decoded.values[at] - expected - 0.25).abs() < 1e-9, "{x} {y}");
                assert!((error.values[at] - 0.25).abs() < 1e-9, "{x} {y}");
            }
        }
        for (node, place) in actual.nodes.iter().zip(surface.nodes()) {
            assert_eq!((node.x, node.y), (place.x_mm, place.y_mm));
            assert!((node.z - (1.0 + 0.5 * node.x - 0.2 * node.y)).abs() < 1e-12);
        }
        assert_eq!((error.range, actual.range), (-0.25..=0.25, -1.0..=2.0));
        assert_eq!(actual.quantity.axis_name(), "value (N)");
        assert_eq!(error.quantity.axis_name(), "error (N)");
    }

    #[test]
    fn the_range_covers_the_targets_with_positions() {
        let (surface, _) = plane();
        let mut ranges = vec![(-1.0, 1.0); 8];
        (ranges[3], ranges[6], ranges[0]) = ((-100.0, 100.0), (-3.0, 0.0), (0.0, 2.0));
        assert_eq!(surface.range_of(&ranges), -3.0..=2.0);
    }
}
