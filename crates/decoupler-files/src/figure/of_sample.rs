//! The figure of all targets of one sample.
//!
//! The figure of what the readings of each row determine.

use decoupler_core::{evaluation::Channel, identifiability::Identifiability, text::format_number};

use super::{
    axis::{PlotAxis, TickRule},
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{LineAt, Plot, PlotFigure, PlotPoint, ReferenceLine, Series},
};

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

/// Values below the largest by this factor are rounding.
const ROUNDING: f64 = 1e-16;

/// Singular values of every row, from the best-seen deformation pattern to the worst. `worst` is the index of the row
/// drawn strongest; noise hides the patterns whose value is below `hidden_below_per_mm`, 0 without noise.
pub fn singular_values_figure(rows: &[Identifiability], worst: usize, hidden_below_per_mm: f64) -> PlotFigure {
    let strong = Look::marker(Hue::Blue, Marker::Disc).joined();
    let pale = Look::line(Hue::Grey, LineStyle::Fine);
    let others = rows.iter().enumerate().filter(|(index, _)| *index != worst);
    let others = others.map(|(_, row)| Series::new(format!("row {}", row.row + 1), pale, numbered(row)));
    let strongest = rows.get(worst).map(|row| {
        let name = format!("row {}, worst", row.row + 1);
        Series::new(name, strong, numbered(row))
    });
    let series: Vec<Series> = others.chain(strongest).collect();
    let mut keys = vec![Key::new("worst row", strong)];
    if rows.len() > 1 {
        keys.push(Key::new("other rows", pale));
    }
    let mut lines = Vec::new();
    if hidden_below_per_mm > 0.0 {
        let (name, hue, style) = ("noise hides values below", Hue::Orange, LineStyle::Dashed);
        lines.push(ReferenceLine::new(name, LineAt::Y(hidden_below_per_mm), hue, style));
        keys.push(Key::new(name, Look::line(hue, style)));
    }
    let unknowns = rows.get(worst).map_or(1, Identifiability::unknowns);
    let x = PlotAxis::linear("deformation pattern, best seen first").including([0.5, unknowns as f64 + 0.5]);
    let y = PlotAxis::logarithmic("singular value of ∂ ln R/∂u (1/mm)");
    PlotFigure {
        plots: vec![Plot {
            lines,
            ..Plot::new(x.ticked(TickRule::Whole), y, series)
        }],
        keys,
        notes: Vec::new(),
    }
}

/// Number of the pattern from 1, and its value; without those that are rounding.
fn numbered(row: &Identifiability) -> Vec<[f64; 2]> {
    let values = &row.singular_values_per_mm;
    let least = ROUNDING * values.first().copied().unwrap_or(0.0);
    let numbered = values.iter().enumerate().filter(|&(_, &value)| value > least);
    numbered.map(|(number, value)| [number as f64 + 1.0, *value]).collect()
}

#[cfg(test)]
mod tests {
    use decoupler_core::sensor::{Axes, SensorModel};
    use glam::DVec3;

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

    #[test]
    fn patterns_that_are_not_seen_have_no_place_on_a_logarithmic_axis() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let row = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z).unwrap();
        let points = numbered(&row);
        assert_eq!((row.unknowns(), points.len()), (6, 4));
        assert_eq!(points[0], [1.0, row.singular_values_per_mm[0]]);
        let quiet = singular_values_figure(std::slice::from_ref(&row), 0, 0.0);
        assert_eq!((quiet.keys.len(), quiet.plots[0].lines.len()), (1, 0));
        assert_eq!(singular_values_figure(&[row.clone(), row], 1, 0.1).keys.len(), 3);
        assert!(singular_values_figure(&[], 0, 0.0).plots[0].series.is_empty());
    }
}
