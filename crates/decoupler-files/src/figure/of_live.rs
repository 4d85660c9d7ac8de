//! Figures of decoded values over time, and of the readings of a frame.

use std::sync::Arc;

use decoupler_core::{evaluation::Intervals, problem::Channel};
use ndarray::Array2;

use super::{
    Hue, LineStyle, Look,
    axis::PlotAxis,
    colour_map::SequentialMap,
    heat_map::HeatMap,
    plot::{Plot, PlotFigure, Series},
    titled, unique_by,
};

const HUES: [Hue; 6] = [Hue::Blue, Hue::Orange, Hue::Green, Hue::Violet, Hue::Cyan, Hue::Red];
/// Maximum number of targets with their own colours and names; more targets are all drawn as fine lines.
const MAX_NAMES: usize = 2 * HUES.len();

/// Values of all targets over time, one plot per unit; `history` has times in seconds with a value for each target. Fine
/// lines limit the band of the 90 % `intervals`, if there are any and targets have their own colours.
pub fn targets_over_time_figure(
    targets: &[Channel],
    history: &[(f64, Arc<[f64]>)],
    intervals: Option<&Intervals>,
) -> PlotFigure {
    let has_names = targets.len() <= MAX_NAMES;
    let hue = |target: usize| HUES[target % HUES.len()];
    let series = |target: usize| {
        let style = match target / HUES.len() {
            _ if !has_names => LineStyle::Fine,
            0 => LineStyle::Solid,
            _ => LineStyle::Dashed,
        };
        let points = history.iter().map(|(time_s, values)| [*time_s, values[target]]);
        let series = Series::new(&targets[target].name, Look::line(hue(target), style), points);
        series.listed(has_names.then(|| targets[target].title()).as_deref())
    };
    let intervals = intervals.filter(|_| has_names);
    let limit = |target: usize, side: &str, sign: f64| {
        let points = history.iter().filter_map(|(time_s, values)| {
            let half_width = intervals?.half_width(target, values[target])?;
            Some([*time_s, values[target] + sign * half_width])
        });
        let name = format!("{}, {side} limit of the 90 % interval", targets[target].name);
        Series::new(name, Look::line(hue(target), LineStyle::Fine), points).listed(None)
    };
    let units = unique_by(targets.iter().map(|target| target.unit.as_deref()), |unit| *unit);
    let plots = units.into_iter().map(|unit| {
        let of_unit = (0..targets.len()).filter(|&target| targets[target].unit.as_deref() == unit);
        let limits = |target: usize| [limit(target, "lower", -1.0), limit(target, "upper", 1.0)];
        let series = of_unit.clone().map(series).chain(of_unit.flat_map(limits));
        Plot::new(
            PlotAxis::linear("time (s)"),
            PlotAxis::linear(titled("decoded value", unit)),
            series,
        )
    });
    PlotFigure::new(plots, [])
}

/// Readings of a frame, rows × columns, as their drop below the unloaded state.
///
/// `drops_percent` is 100 (1 − R/R₀), in percent of the unloaded resistance; `rows` are the row-wires read, from 0.
/// Colours span 0 to `largest_percent` and are comparable between frames; larger values have the colour of the end.
pub fn readings_figure(drops_percent: Array2<f64>, rows: &[usize], largest_percent: f64) -> HeatMap {
    let axis = PlotAxis::linear("drop from unloaded (%)").including([0.0, largest_percent]);
    of_wires(drops_percent, rows, axis.limited(0.0..=largest_percent))
}

/// Gains of the unloaded state, rows × columns, as their difference from 1 in percent; `rows` as for [`readings_figure`].
pub fn zero_gains_figure(gains: &Array2<f64>, rows: &[usize]) -> HeatMap {
    let percent = gains.mapv(|gain| 100.0 * (gain - 1.0));
    of_wires(percent, rows, PlotAxis::linear("gain − 1, unloaded (%)"))
}

fn of_wires(values: Array2<f64>, rows: &[usize], value_axis: PlotAxis) -> HeatMap {
    HeatMap {
        colours: SequentialMap::default(),
        x_name: "column-wire".to_owned(),
        y_name: "row-wire".to_owned(),
        columns: (1..=values.ncols()).map(|column| column.to_string()).collect(),
        rows: rows.iter().map(|row| (row + 1).to_string()).collect(),
        notes: Array2::default(values.dim()),
        values,
        value_axis,
    }
}

#[cfg(test)]
mod tests {
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

    #[test]
    fn gains_are_shown_by_their_difference_from_one() {
        let figure = zero_gains_figure(&array![[1.02, 0.99]], &[0]);
        assert!((figure.values[[0, 0]] - 2.0).abs() < 1e-12 && (figure.values[[0, 1]] + 1.0).abs() < 1e-12);
        assert_eq!(figure.range(), figure.values[[0, 1]]..=figure.values[[0, 0]]);
    }
}
