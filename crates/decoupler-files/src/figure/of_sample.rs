//! Figures of all targets of one sample or over time, of decoupled next to actual nodes, of the singular values of each row,
//! and of the readings of a frame.

use std::sync::Arc;

use decoupler_core::{evaluation::Intervals, identifiability::Identifiability, problem::Channel, text::format_number};
use glam::DVec3;
use ndarray::Array2;

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, Scale},
    colour_map::SequentialMap,
    heat_map::HeatMap,
    plot::{LineAt, Plot, PlotFigure, PlotPoint, Series},
    titled, unique_by, with_unit,
};

/// Looks of actual and of decoded values next to each other.
const ACTUAL: Look = Look::marker(Ink::Grey, Marker::Square);
const DECODED: Look = Look::marker(Ink::Blue, Marker::Disc);

/// Maximum number of targets whose names fit below the axis.
const MAX_NAMES: usize = 12;

/// All targets of a sample in their order: actual as squares, decoded as discs. Targets of one unit share its axis;
/// with several units, each is shown in percent of its range; `ranges` are the minimum and maximum of each.
pub fn sample_figure(targets: &[Channel], actual: &[f64], decoded: &[f64], ranges: &[(f64, f64)]) -> PlotFigure {
    let unit = targets.first().and_then(|target| target.unit.as_deref());
    let has_one_unit = targets.iter().all(|target| target.unit.as_deref() == unit);
    let place = |(low, high): (f64, f64), value: f64| match has_one_unit {
        true => value,
        false => 100.0 * (value - low) / (high - low),
    };
    let has_names = targets.len() <= MAX_NAMES;
    // Targets without names are counted from 1.
    let first = if has_names { 0.0 } else { 1.0 };
    let series = |name: &str, look: Look, values: &[f64]| {
        let points = values.iter().enumerate().map(|(number, &value)| {
            let (target, y) = (&targets[number], place(ranges[number], value));
            let value = with_unit(format_number(value), target.unit.as_deref());
            let point = PlotPoint::from([first + number as f64, y]).of_item(number);
            point.noted(format!("{}\n{name}: {value}", target.name))
        });
        Series::new(name, look, points)
    };
    let y = match has_one_unit {
        true => titled("value", unit),
        false => "% of the target's range".to_owned(),
    };
    let x = match has_names {
        true => PlotAxis::of_names("target", targets.iter().map(|target| target.name.clone()).collect()),
        false => PlotAxis::integers("target").including([0.5, targets.len() as f64 + 0.5]),
    };
    let series = [series("actual", ACTUAL, actual), series("decoded", DECODED, decoded)];
    Plot::new(x, PlotAxis::linear(y), series).into()
}

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
    let y = PlotAxis::logarithmic("singular value of ∂ ln R/∂u (1/mm)");
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
    let decoupled = series("decoupled", DECODED, decoupled_mm, spread_mm.unwrap_or_default());
    // A tick at the last node of a row.
    let x = PlotAxis::new("node, row by row", Scale::Multiples(nodes_per_row as f64));
    Plot::new(x, PlotAxis::linear("z (mm)"), [actual, decoupled]).into()
}

const HUES: [Ink; 6] = [Ink::Blue, Ink::Orange, Ink::Green, Ink::Violet, Ink::Cyan, Ink::Red];
/// Maximum number of targets with their own colours and names; more targets are all drawn as fine lines.
const MAX_CURVES: usize = 2 * HUES.len();

/// Values of all targets over time, one plot per unit; `history` has times in seconds with a value for each target. Fine
/// lines limit the band of the 90 % `intervals`, if there are any and targets have their own colours.
pub fn targets_over_time_figure(
    targets: &[Channel],
    history: &[(f64, Arc<[f64]>)],
    intervals: Option<&Intervals>,
) -> PlotFigure {
    let has_names = targets.len() <= MAX_CURVES;
    let ink = |target: usize| HUES[target % HUES.len()];
    let series = |target: usize| {
        let style = match target / HUES.len() {
            _ if !has_names => LineStyle::Fine,
            0 => LineStyle::Solid,
            _ => LineStyle::Dashed,
        };
        let points = history.iter().map(|(time_s, values)| [*time_s, values[target]]);
        let series = Series::new(&targets[target].name, Look::line(ink(target), style), points);
        series.listed(has_names.then(|| targets[target].title()).as_deref())
    };
    let intervals = intervals.filter(|_| has_names);
    let limit = |target: usize, side: &str, sign: f64| {
        let points = history.iter().filter_map(|(time_s, values)| {
            let half_width = intervals?.half_width(target, values[target])?;
            Some([*time_s, values[target] + sign * half_width])
        });
        let name = format!("{}, {side} limit of the 90 % interval", targets[target].name);
        Series::new(name, Look::line(ink(target), LineStyle::Fine), points).listed(None)
    };
    let units = unique_by(targets.iter().map(|target| target.unit.as_deref()), |unit| *unit);
    let plots = units.into_iter().map(|unit| {
        let of_unit = (0..targets.len()).filter(|&target| targets[target].unit.as_deref() == unit);
        let limits = |target: usize| [limit(target, "lower", -1.0), limit(target, "upper", 1.0)];
        let series = of_unit.clone().map(series).chain(of_unit.flat_map(limits));
        let y = PlotAxis::linear(titled("decoded value", unit));
        Plot::new(PlotAxis::linear("time (s)"), y, series)
    });
    PlotFigure::new(plots, [])
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

    fn channels(units: [Option<&str>; 2]) -> [Channel; 2] {
        units.map(|unit| Channel::new("f", unit))
    }

    #[test]
    fn targets_of_several_units_are_shown_by_their_ranges() {
        let ranges = [(0.0, 10.0), (-1.0, 1.0)];
        let figure = |units| sample_figure(&channels(units), &[5.0, 0.5], &[4.0, -1.0], &ranges);
        let heights = |figure: &PlotFigure| -> Vec<f64> {
            figure.plots[0]
                .series
                .iter()
                .flat_map(|series| series.points.iter().map(|point| point.y))
                .collect()
        };
        let alike = figure([Some("N"), Some("N")]);
        assert_eq!(heights(&alike), [5.0, 0.5, 4.0, -1.0]);
        assert_eq!(alike.plots[0].y.name, "value (N)");
        let apart = figure([Some("N"), Some("mm")]);
        assert_eq!(heights(&apart), [50.0, 75.0, 40.0, 0.0]);
        assert_eq!(
            apart.plots[0].series[1].points[1].note.as_deref(),
            Some("f\ndecoded: -1.00 mm")
        );
    }

    #[test]
    fn many_targets_are_counted_from_one() {
        let channel = Channel::new("t", None);
        let places = |count: usize| -> Vec<f64> {
            let values = vec![0.5; count];
            let figure = sample_figure(
                &vec![channel.clone(); count],
                &values,
                &values,
                &vec![(0.0, 1.0); count],
            );
            figure.plots[0].series[0].points.iter().map(|point| point.x).collect()
        };
        assert_eq!(places(3), [0.0, 1.0, 2.0], "these are at their names");
        assert_eq!(places(13), Vec::from_iter((1..=13).map(f64::from)));
    }

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
            Some("Row 2, node 1\ndecoupled z: 5.00 mm ± 0.300 mm")
        );
        assert_eq!(
            node_figure(&actual, None, None, 1).keys().len(),
            1,
            "nothing decoupled yet"
        );
    }
}

#[cfg(test)]
mod live_tests {
    use decoupler_core::evaluation::HalfWidth;
    use ndarray::array;

    use super::*;

    #[test]
    fn targets_of_one_unit_share_a_plot() {
        let channel = |name: &str, unit: &str| Channel::new(name, Some(unit));
        let targets = [channel("x", "mm"), channel("force", "N"), channel("y", "mm")];
        let history = [(0.0, Arc::from([1.0, 2.0, 3.0])), (0.5, Arc::from([4.0, 5.0, 6.0]))];
        let figure = targets_over_time_figure(&targets, &history, None);
        let names = |plot: &Plot| Vec::from_iter(plot.series.iter().map(|series| series.name.clone()));
        assert_eq!(
            figure.plots.iter().map(names).collect::<Vec<_>>(),
            [vec!["x", "y"], vec!["force"]]
        );
        let last = &figure.plots[0].series[1].points[1];
        assert_eq!([last.x, last.y], [0.5, 6.0]);
        assert_eq!(figure.keys().len(), 3);
    }

    #[test]
    fn intervals_limit_a_band_around_the_values() {
        let target = Channel::new("force", None);
        let history = [(0.0, Arc::from([1.0])), (0.5, Arc::from([4.0]))];
        let half_width = HalfWidth {
            constant: 0.5,
            by_answer: Vec::new(),
            samples: 100,
            effective_samples: 100.0,
        };
        let intervals = Intervals {
            targets: vec![Some(half_width)],
        };
        let figure = targets_over_time_figure(&[target], &history, Some(&intervals));
        let last = |series: &Series| series.points.last().map(|point| point.y);
        let last = Vec::from_iter(figure.plots[0].series.iter().filter_map(last));
        assert_eq!(last, [4.0, 3.5, 4.5]);
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
