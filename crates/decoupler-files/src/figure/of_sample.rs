//! Figures of targets over time, of decoupled next to actual nodes, of the singular values of each row,
//! and of the readings of a frame.

use std::ops::{Range, RangeInclusive};

use decoupler_core::{evaluation::Intervals, identifiability::Identifiability, problem::Channel, text::format_number};
use glam::DVec3;
use ndarray::{Array2, ArrayView2};

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, Scale},
    colour_map::SequentialMap,
    extremes,
    heat_map::HeatMap,
    plot::{Form, LineAt, Plot, PlotFigure, PlotPoint, Series},
};

/// Looks of actual and of decoded values next to each other.
const ACTUAL: Look = Look::marker(Ink::Grey, Marker::Square);
const DECODED: Look = Look::marker(Ink::Blue, Marker::Disc);

/// Values below the largest by this factor are rounding errors.
const ROUNDING: f64 = 1e-16;

/// Singular values of every row, from the best-seen deformation pattern to the worst. `worst` is the index of the row
/// drawn strongest; noise hides the patterns whose value is below `hidden_below_per_mm`, 0 without noise.
pub fn singular_values_figure(rows: &[Identifiability], worst: usize, hidden_below_per_mm: f64) -> PlotFigure {
    let series = |row: &Identifiability, more: &str, look: Look, key: &str| {
        // Numbered from 1, without rounding errors.
        let values = &row.singular_values_per_mm;
        let least = ROUNDING * values.first().copied().unwrap_or(0.0);
        let numbered = values.iter().enumerate().filter(|&(_, &value)| value > least);
        let points = numbered.map(|(number, value)| [number as f64 + 1.0, *value]);
        Series::new(format!("row {}{more}", row.row + 1), look, points).listed(Some(key))
    };
    let pale = Look::line(Ink::Grey, LineStyle::Fine);
    let others = rows.iter().enumerate().filter(|(index, _)| *index != worst);
    let others = others.map(|(_, row)| series(row, "", pale, "other rows"));
    let strong = DECODED.joined(LineStyle::Solid);
    let strongest = rows.get(worst).map(|row| series(row, ", worst", strong, "worst row"));
    let noise = (hidden_below_per_mm > 0.0).then(|| {
        let at = LineAt::Y(hidden_below_per_mm);
        Series::across("noise hides values below", at, Ink::Orange, LineStyle::Dashed)
    });
    let unknowns = rows.get(worst).map_or(1, Identifiability::unknowns);
    let x = PlotAxis::integers("deformation pattern, best seen first").including([0.5, unknowns as f64 + 0.5]);
    let y = PlotAxis::logarithmic("singular value (1/mm)");
    Plot::new(x, y, others.chain(strongest).chain(noise)).into()
}

/// The paper's Fig. 6: z of the nodes at these positions, row by row; actual as squares, decoupled as discs, each with a
/// bar of ± `spread_mm` if that is given.
pub fn node_figure(
    actual_mm: &[DVec3],
    decoupled_mm: Option<&[DVec3]>,
    spread_mm: Option<&[f64]>,
    nodes_per_row: usize,
) -> PlotFigure {
    let nodes_per_row = nodes_per_row.max(1);
    let series = |name: &str, look: Look, nodes_mm: &[DVec3], spread_mm: &[f64]| {
        let points = nodes_mm.iter().enumerate().map(|(node, &DVec3 { z, .. })| {
            let (row, of_row) = (node / nodes_per_row + 1, node % nodes_per_row + 1);
            let spread = spread_mm.get(node);
            let more = spread.map_or_else(String::new, |spread| format!(" ± {} mm", format_number(*spread)));
            let note = format!("Row {row}, node {of_row}\n{name} z: {} mm{more}", format_number(z));
            let mut point = PlotPoint::from([(node + 1) as f64, z]).of_item(node).noted(note);
            point.bar = spread.map(|spread| [z - spread, z + spread]);
            point
        });
        Series::new(name, look, points)
    };
    let decoupled_mm = decoupled_mm.unwrap_or_default();
    let actual = series("actual", ACTUAL, actual_mm, &[]);
    let decoupled = series("decoded", DECODED, decoupled_mm, spread_mm.unwrap_or_default());
    // A tick at the last node of a row.
    let x = PlotAxis::new("node, row by row", Scale::Multiples(nodes_per_row as f64));
    Plot::new(x, PlotAxis::linear("z (mm)"), [actual, decoupled]).into()
}

/// Values of targets over time, or in the order of their samples.
pub struct TimeSeries<'a> {
    /// Names and units.
    pub targets: &'a [Channel],
    /// The horizontal axis.
    pub axis: PlotAxis,
    /// Place of each sample on it, ascending.
    pub places: &'a [f64],
    /// First sample after each gap, ascending.
    pub gaps: &'a [usize],
    /// Decoded values, samples × targets.
    pub decoded: ArrayView2<'a, f64>,
    /// Actual values, if they are known.
    pub actual: Option<ArrayView2<'a, f64>>,
    /// 90 % intervals of the decoded values, if they were calibrated.
    pub intervals: Option<&'a Intervals>,
}

impl TimeSeries<'_> {
    /// Plots of these targets one below the other, with the samples between the places `seen`. A gap breaks the lines; of many
    /// samples, each curve shows the extremes.
    pub fn figure(&self, targets: Range<usize>, seen: &RangeInclusive<f64>) -> PlotFigure {
        /// Parts of the axis that are about as wide as a pixel.
        const PARTS: usize = 800;
        let [from, to] = [*seen.start(), *seen.end()];
        // The lines go on to the samples beyond either end.
        let first = self.places.partition_point(|place| *place < from).saturating_sub(1);
        let end = (self.places.partition_point(|place| *place <= to) + 1).min(self.places.len());
        let step = end.saturating_sub(first).div_ceil(PARTS).max(1);
        let starts = self.gaps.iter().copied().filter(|gap| (first + 1..end).contains(gap));
        let starts = Vec::from_iter(std::iter::once(first).chain(starts).chain([end]));
        let parts = Vec::from_iter(starts.windows(2).flat_map(|ends| {
            let parts = (ends[0]..ends[1])
                .step_by(step)
                .map(|at| Some(at..(at + step).min(ends[1])));
            Vec::from_iter(parts.chain([None]))
        }));
        let gap = || PlotPoint::from([f64::NAN; 2]);
        let curve = |name: &str, ink: Ink, value: &dyn Fn(usize) -> f64| {
            let points = parts.iter().flat_map(|part| {
                let values = part.clone().map(|part| part.map(|sample| (sample, value(sample))));
                let Some((low, high)) = values.and_then(|values| extremes(values, |&(_, value)| value)) else {
                    return vec![gap()];
                };
                let mut ends = vec![low, high];
                ends.sort_unstable_by_key(|&(sample, _)| sample);
                ends.dedup_by_key(|(sample, _)| *sample);
                Vec::from_iter(
                    ends.into_iter()
                        .map(|(sample, value)| PlotPoint::from([self.places[sample], value])),
                )
            });
            Series::new(name, Look::line(ink, LineStyle::Solid), points)
        };
        let plots = targets.map(|target| {
            let decoded = |sample: usize| self.decoded[[sample, target]];
            let band = parts.iter().map(|part| {
                let limits = part.iter().cloned().flatten().filter_map(|sample| {
                    let half_width = self.intervals?.half_width(target, decoded(sample))?;
                    Some([-1.0, 1.0].map(|sign| decoded(sample) + sign * half_width))
                });
                let limits = limits.reduce(|one, other| [one[0].min(other[0]), one[1].max(other[1])]);
                let (Some(part), Some(bar)) = (part, limits) else {
                    return gap();
                };
                let mut point = PlotPoint::from([self.places[part.start], 0.5 * (bar[0] + bar[1])]);
                point.bar = Some(bar);
                point
            });
            let band = Series {
                form: Form::Band,
                ..Series::new("90 % interval", Look::line(Ink::Blue, None), band)
            };
            let actual = self
                .actual
                .map(|actual| curve("actual", Ink::Text, &|sample| actual[[sample, target]]));
            let decoded = curve("decoded", Ink::Blue, &decoded);
            let series = self.intervals.map(|_| band).into_iter().chain(actual).chain([decoded]);
            Plot::new(
                self.axis.clone().including([from, to]),
                PlotAxis::linear(self.targets[target].title()),
                series,
            )
        });
        PlotFigure {
            is_stacked: true,
            ..PlotFigure::new(plots, [])
        }
    }
}

/// Readings of a frame, rows × columns, as their drop below the unloaded state.
///
/// `drops_percent` is 100 (1 − R/R₀), in percent of the unloaded resistance; `rows` are the row-wires read, from 0.
/// Colours span 0 to `largest_percent` and are comparable between frames; larger values have the colour of the end.
pub fn readings_figure(drops_percent: Array2<f64>, rows: &[usize], largest_percent: f64) -> HeatMap {
    let axis = PlotAxis::linear("drop from unloaded (%)").including([0.0, largest_percent]);
    HeatMap {
        colours: SequentialMap::default(),
        x_name: "column-wire".to_owned(),
        y_name: "row-wire".to_owned(),
        columns: (1..=drops_percent.ncols()).map(|column| column.to_string()).collect(),
        rows: rows.iter().map(|row| (row + 1).to_string()).collect(),
        notes: Array2::default(drops_percent.dim()),
        values: drops_percent,
        value_axis: axis.limited(0.0..=largest_percent),
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::sensor::{Axes, RelativeNoise, SensorModel};
    use glam::DVec3;

    use super::*;

    #[test]
    fn patterns_without_effect_are_not_on_a_logarithmic_axis() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let row = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z, RelativeNoise::default()).unwrap();
        let quiet = singular_values_figure(std::slice::from_ref(&row), 0, 0.0);
        let points = &quiet.plots[0].series[0].points;
        assert_eq!((row.unknowns(), points.len()), (6, 4));
        assert_eq!([points[0].x, points[0].y], [1.0, row.singular_values_per_mm[0]]);
        assert_eq!((quiet.keys().len(), quiet.plots[0].series.len()), (1, 1));
        assert_eq!(singular_values_figure(&[row.clone(), row], 1, 0.1).keys().len(), 3);
        assert!(singular_values_figure(&[], 0, 0.0).plots[0].series.is_empty());
    }

    #[test]
    fn a_highlighted_node_has_a_halo_at_each_of_its_points() {
        let nodes = |z_mm: [f64; 3]| z_mm.map(|z| DVec3::new(1.0, 2.0, z));
        let (actual, decoupled) = (nodes([4.0, 4.5, 5.0]), nodes([4.1, 4.4, 5.0]));
        let figure = node_figure(&actual, Some(&decoupled), None, 3).lighting(|item| item == 1, &[]);
        let lit = figure.plots[0].series.last().unwrap();
        assert_eq!(lit.look.marker, Some(Marker::Halo));
        let places: Vec<[f64; 2]> = lit.points.iter().map(|point| [point.x, point.y]).collect();
        assert_eq!(places, [[2.0, 4.5], [2.0, 4.4]]);
    }

    #[test]
    fn a_node_is_named_by_its_row() {
        let nodes = |z_mm: [f64; 3]| z_mm.map(|z| DVec3::new(1.0, 2.0, z));
        let (actual, decoupled) = (nodes([4.0, 4.5, 5.0]), nodes([4.1, 4.4, 5.0]));
        let figure = node_figure(&actual, Some(&decoupled), Some(&[0.1, 0.2, 0.3]), 2);
        let decoupled = &figure.plots[0].series[1];
        assert_eq!(
            decoupled.points[2].note.as_deref(),
            Some("Row 2, node 1\ndecoded z: 5.00 mm ± 0.300 mm")
        );
        assert_eq!(
            node_figure(&actual, None, None, 1).keys().len(),
            1,
            "nothing decoded yet"
        );
    }
}

#[cfg(test)]
mod live_tests {
    use decoupler_core::evaluation::HalfWidth;
    use ndarray::array;

    use super::*;

    /// The sine of the place, decoded 0.1 too high, with a missing value at 3 and a gap before 5.
    fn figure(samples: usize, seen: RangeInclusive<f64>) -> PlotFigure {
        let half_width = HalfWidth {
            constant: 0.5,
            by_answer: Vec::new(),
            samples: 100,
            effective_samples: 100.0,
        };
        let mut actual = Array2::from_shape_fn((samples, 1), |(sample, _)| (0.01 * sample as f64).sin());
        actual[[3, 0]] = f64::NAN;
        let decoded = &actual + 0.1;
        let intervals = Intervals {
            targets: vec![Some(half_width)],
        };
        let series = TimeSeries {
            targets: &[Channel::new("force", Some("N"))],
            axis: PlotAxis::linear("time (s)"),
            places: &Vec::from_iter((0..samples).map(|sample| sample as f64)),
            gaps: &[5],
            decoded: decoded.view(),
            actual: Some(actual.view()),
            intervals: Some(&intervals),
        };
        series.figure(0..1, &seen)
    }

    #[test]
    fn a_missing_value_and_a_gap_break_the_lines_and_their_band() {
        let figure = figure(9, 0.0..=8.0);
        let [band, actual, decoded] = &figure.plots[0].series[..] else {
            panic!("{figure:?}");
        };
        let lengths = |stretches: Vec<Vec<[f64; 2]>>| Vec::from_iter(stretches.iter().map(Vec::len));
        // A single sample is no line.
        for line in [actual, decoded] {
            assert_eq!(lengths(figure.plots[0].stretches(line)), [3, 4]);
        }
        let ends = &figure.plots[0].bands(band)[0];
        assert_eq!((ends.len(), ends[0]), (3, [0.0, -0.4, 0.6]));
        assert_eq!((figure.plots[0].y.name.as_str(), figure.keys().len()), ("force (N)", 3));
    }

    #[test]
    fn many_samples_are_drawn_by_their_extremes_and_all_of_them_from_near() {
        let points = |figure: &PlotFigure| figure.plots[0].series[1].points.len();
        let all = figure(100_000, 0.0..=1e5);
        assert!((800..1610).contains(&points(&all)), "{}", points(&all));
        let [x, y] = all.plots[0].ranges();
        assert!(*x.end() >= 99_999.0 && *y.end() > 1.5, "{x:?}, {y:?}");
        let near = figure(100_000, 500.0..=600.0);
        // With the samples on either side, and the end of the line.
        assert_eq!(points(&near), 104);
        assert!(*near.plots[0].ranges()[0].end() < 610.0);
    }

    #[test]
    fn colours_of_readings_are_comparable_between_frames() {
        let [slight, strong] = [0.4, 30.0].map(|drop| readings_figure(array![[0.0, drop], [-1.0, 2.0]], &[0, 4], 5.0));
        assert_eq!((slight.range(), strong.range()), (0.0..=5.0, 0.0..=5.0));
        assert_eq!(strong.colour_share(30.0, &strong.range()), Some(1.0));
        assert_eq!(strong.colour_share(-1.0, &strong.range()), Some(0.0));
        assert_eq!(
            (slight.rows, slight.columns),
            (vec!["1".into(), "5".into()], vec!["1".into(), "2".into()])
        );
    }
}
