//! The figure of all targets of one sample.

use super::{
    axis::{PlotAxis, TickRule},
    look::{Hue, Key, Look, Marker},
    plot::{Plot, PlotPoint, Series},
    plot_figure::PlotFigure,
};
use decoupler_core::{evaluation::Channel, text::format_number};

/// Most targets whose names have room below the axis.
const MAX_NAMES: usize = 12;

/// All targets of a sample in their order: actual as squares, decoded as discs. Targets of one unit share its axis; with
/// several units each is shown in percent of its range, `ranges` being the least and largest value of each.
pub fn sample_figure(targets: &[Channel], actual: &[f64], decoded: &[f64], ranges: &[(f64, f64)]) -> PlotFigure {
    let has_one_unit = targets.iter().all(|target| target.unit == targets[0].unit);
    let place = |target: usize, value: f64| {
        let (low, high) = ranges[target];
        if has_one_unit {
            value
        } else {
            100.0 * (value - low) / (high - low)
        }
    };
    let has_names = targets.len() <= MAX_NAMES;
    // Targets that are not named are counted from 1.
    let first = if has_names { 0.0 } else { 1.0 };
    let series = |name: &str, look: Look, values: &[f64]| {
        let points = values.iter().enumerate().map(|(target, &value)| {
            let unit = targets[target]
                .unit
                .as_ref()
                .map_or_else(String::new, |unit| format!(" {unit}"));
            PlotPoint {
                note: Some(format!(
                    "{}\n{name}: {}{unit}",
                    targets[target].name,
                    format_number(value)
                )),
                item: Some(target),
                ..PlotPoint::from([first + target as f64, place(target, value)])
            }
        });
        Series {
            points: points.collect(),
            ..Series::new(name, look, [])
        }
    };
    let series = vec![
        series("actual", Look::marker(Hue::Grey, Marker::Square), actual),
        series("decoded", Look::marker(Hue::Blue, Marker::Disc), decoded),
    ];
    let y = match targets.first().and_then(|target| target.unit.as_ref()) {
        _ if !has_one_unit => "% of the target's range".to_owned(),
        Some(unit) => format!("value ({unit})"),
        None => "value".to_owned(),
    };
    let x = PlotAxis::linear("target");
    let x = if has_names {
        x.ticked(TickRule::Names(
            targets.iter().map(|target| target.name.clone()).collect(),
        ))
    } else {
        x.ticked(TickRule::Whole)
    };
    let ends = [first - 0.5, first + targets.len() as f64 - 0.5];
    PlotFigure {
        keys: series
            .iter()
            .map(|series| Key::new(&series.name, series.look))
            .collect(),
        plots: vec![Plot::new(x.including(ends), PlotAxis::linear(y), series)],
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(units: [Option<&str>; 2]) -> [Channel; 2] {
        units.map(|unit| Channel {
            name: "f".to_owned(),
            unit: unit.map(str::to_owned),
        })
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
        let channel = Channel {
            name: "t".to_owned(),
            unit: None,
        };
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
}
