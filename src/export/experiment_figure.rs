//! The picture of an experiment at publication size.

use ndarray::Array2;

use super::{
    experiment_points::{CellPoint, repeat_name, trial_points, z_points},
    figures::{HeatMap, Hue, Marker, Picture, Plot, PlotAxis, PlotPoint, Series, Span},
};
use crate::{
    evaluation::{
        Errors,
        experiments::{Axis, CellSummary, ExperimentResults},
    },
    network::HiddenSuggestions,
};

/// Draws the results so far of an experiment: a heat map of the median Z error over two axes, the errors of every
/// repeat of a cross-validation (the paper's Fig. 5), or else the Z error along the axis beside the published one.
pub fn draw_experiment(results: &ExperimentResults) -> Picture {
    if results.experiment.second_axis.is_some() {
        heat_map(results).draw()
    } else if results.experiment.cross_validation.is_some() {
        repeats(results).draw()
    } else {
        along_the_axis(results).draw()
    }
}

fn heat_map(results: &ExperimentResults) -> HeatMap {
    let [columns, rows] = [Some(&results.experiment.axis), results.experiment.second_axis.as_ref()];
    let labels = |axis: Option<&Axis>| -> Vec<String> {
        let axis = axis.into_iter();
        axis.flat_map(|axis| (0..axis.len()).map(|at| axis.label(at))).collect()
    };
    let name = |axis: Option<&Axis>| axis.map_or("", Axis::name).to_owned();
    let mut values = Array2::from_elem([rows.map_or(1, Axis::len), results.experiment.axis.len()], f64::NAN);
    for cell in &results.cells {
        if let Some(z) = cell.z_percent() {
            values[[cell.cell.row, cell.cell.column]] = z.median;
        }
    }
    HeatMap {
        x_name: name(columns),
        y_name: name(rows),
        columns: labels(columns),
        rows: labels(rows),
        values,
        value_axis: PlotAxis::logarithmic("median Z error (%)"),
    }
}

fn along_the_axis(results: &ExperimentResults) -> Plot {
    let axis = &results.experiment.axis;
    let cells = z_points(results, &results.summaries());
    let is_number = matches!(axis, Axis::Hidden(_));
    let series = |name: &str, hue, marker, points: Vec<PlotPoint>| Series {
        name: name.to_owned(),
        hue,
        has_line: is_number,
        is_dashed: false,
        marker: Some(marker),
        points,
    };
    let reference = |name: &str, hue, points| Series {
        is_dashed: is_number,
        marker: (!is_number).then_some(Marker::Ring),
        ..series(name, hue, Marker::Ring, points)
    };
    let ours = cells.iter().filter_map(|cell| {
        let [median, least, largest] = cell.spread?;
        Some(PlotPoint {
            x: cell.x,
            y: median,
            bar: Some([least, largest]),
        })
    });
    let plain = |value: fn(&CellPoint) -> Option<f64>| -> Vec<PlotPoint> {
        let points = cells.iter().filter_map(|cell| Some([cell.x, value(cell)?]));
        points.map(plain_point).collect()
    };
    let all = [
        reference("linear map", Hue::Grey, plain(|cell| cell.linear)),
        reference(
            "bound of the hidden nodes",
            Hue::Green,
            if is_number {
                plain(|cell| cell.bound)
            } else {
                Vec::new()
            },
        ),
        series("published", Hue::Red, Marker::Square, plain(|cell| cell.published)),
        series("median, least to largest", Hue::Blue, Marker::Disc, ours.collect()),
    ];
    let mut x = PlotAxis::linear(axis.name());
    if !is_number {
        x.named = (0..axis.len()).map(|at| (at as f64, axis.label(at))).collect();
    }
    Plot {
        x,
        y: PlotAxis::linear("Z error (%)"),
        series: all.into_iter().filter(|series| !series.points.is_empty()).collect(),
        spans: if is_number { suggestions(results) } else { Vec::new() },
        width_pt: Plot::WIDE_PT,
    }
}

/// The ranges suggested by Eq. (12) and (13).
fn suggestions(results: &ExperimentResults) -> Vec<Span> {
    let scale = results.experiment.base.source.sensor.scale;
    let suggested = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
    let span = |name: &str, from: usize, to: usize| Span {
        name: name.to_owned(),
        from: from as f64,
        to: to as f64,
    };
    vec![
        span("Eq. (12)", *suggested.square_root.start(), *suggested.square_root.end()),
        span("Eq. (13)", suggested.logarithm, suggested.logarithm),
    ]
}

type PublishedError = fn(&CellSummary) -> Option<f64>;
type TrialError = fn(&Errors) -> Option<f64>;

/// The error of every trial on a logarithmic axis. Errors of exactly 0, as of Y where it is constant, are left out.
fn repeats(results: &ExperimentResults) -> Plot {
    const HUES: [Hue; 4] = [Hue::Blue, Hue::Orange, Hue::Green, Hue::Red];
    let errors: [(&str, Marker, PublishedError, TrialError); 3] = [
        (
            "Z",
            Marker::Disc,
            |cell| cell.z_percent.published,
            |errors| errors.z_percent,
        ),
        (
            "X",
            Marker::Ring,
            |cell| cell.x_percent.published,
            |errors| errors.x_percent,
        ),
        (
            "Y",
            Marker::Square,
            |cell| cell.y_percent.published,
            |errors| errors.y_percent,
        ),
    ];
    let experiment = &results.experiment;
    let axis = &experiment.axis;
    let summaries = results.summaries();
    let mut series = Vec::new();
    for (name, marker, published, measured) in errors {
        for (at, (cell, summary)) in results.cells.iter().zip(&summaries).enumerate() {
            let hue = HUES[at % HUES.len()];
            let of = format!("{name}, {} {}", axis.label(at), axis.name());
            let trials = trial_points(experiment, cell, measured).into_iter();
            let trials = trials.filter(|point| point[1] > 0.0).map(plain_point).collect();
            series.push(Series {
                name: of.clone(),
                hue,
                has_line: false,
                is_dashed: false,
                marker: Some(marker),
                points: trials,
            });
            let ends = published(summary).map(|value| [[1.0, value], [cell.expected as f64, value]]);
            series.push(Series {
                name: format!("{of}, published"),
                hue,
                has_line: true,
                is_dashed: true,
                marker: None,
                points: ends.into_iter().flatten().map(plain_point).collect(),
            });
        }
    }
    series.retain(|series| !series.points.is_empty());
    Plot {
        x: PlotAxis::linear(repeat_name(results)),
        y: PlotAxis::logarithmic("error (%)"),
        series,
        spans: Vec::new(),
        width_pt: Plot::WIDE_PT,
    }
}

fn plain_point([x, y]: [f64; 2]) -> PlotPoint {
    PlotPoint { x, y, bar: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::experiments::PaperTable;

    #[test]
    fn the_published_figures_stand_before_anything_is_run() {
        let svg = |table: PaperTable| {
            let results = ExperimentResults::new(table.experiment());
            draw_experiment(&results).svg().to_owned()
        };
        let says = |svg: &str, texts: &[&str]| {
            for text in texts {
                assert!(svg.contains(text), "{text} is not in {svg}");
            }
        };
        let hidden = svg(PaperTable::HiddenNodes);
        says(
            &hidden,
            &["published", "hidden nodes", "Z error (%)", "Eq. (12)", "Eq. (13)"],
        );
        assert!(!hidden.contains("linear map"), "nothing is known of it");
        says(
            &svg(PaperTable::CrossValidation),
            &["Z, 1000 samples, published", "Y, 100 samples, published"],
        );
        says(&svg(PaperTable::ArrayScales), &["10×8_4×24", "published"]);
    }

    #[test]
    fn a_sweep_is_a_heat_map_with_rows_and_columns_named() {
        let mut experiment = PaperTable::ArrayScales.experiment();
        experiment.second_axis = Some(Axis::Hidden(vec![7, 9]));
        let map = heat_map(&ExperimentResults::new(experiment));
        assert_eq!(map.values.dim(), (2, 3));
        assert!(map.values.iter().all(|value| value.is_nan()));
        assert_eq!(
            (map.rows, map.columns[0].as_str()),
            (vec!["7".to_owned(), "9".to_owned()], "10×6_3×18")
        );
    }
}
