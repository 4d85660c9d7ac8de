use ndarray::Array2;

use super::{
    colours::Hue,
    heat_map::HeatMap,
    picture::Picture,
    plot::{Marker, Plot, PlotPoint, Series, Span},
    plot_axis::PlotAxis,
};
use crate::{
    evaluation::experiments::{Axis, CellSummary, ExperimentResults, Figure},
    network::HiddenSuggestions,
};

/// The figure of an experiment, of what is known so far. Over two axes a heat map; of a cross-validation the paper's
/// Fig. 5, the errors of every repeat; else the Z error along the axis, the published one beside ours.
pub fn experiment_figure(results: &ExperimentResults) -> Picture {
    let experiment = &results.experiment;
    let summaries = results.summaries();
    match &experiment.second_axis {
        Some(second) => heat_map(&experiment.axis, second, &summaries).draw(),
        None if experiment.cross_validation.is_some() => repeats(&experiment.axis, &summaries).draw(),
        None => along_axis(results, &summaries).draw(),
    }
}

/// What the Z error is called.
const Z_ERROR: &str = "Z error (%)";

fn labels(axis: &Axis) -> Vec<String> {
    (0..axis.len()).map(|index| axis.label(index)).collect()
}

fn heat_map(columns: &Axis, rows: &Axis, summaries: &[CellSummary]) -> HeatMap {
    let medians = Array2::from_shape_fn((rows.len(), columns.len()), |(row, column)| {
        let cell = summaries.get(row * columns.len() + column);
        cell.and_then(|cell| cell.z_percent.median).unwrap_or(f64::NAN)
    });
    HeatMap {
        x_name: columns.name().to_owned(),
        y_name: rows.name().to_owned(),
        columns: labels(columns),
        rows: labels(rows),
        values: medians,
        value_name: format!("{Z_ERROR}, median"),
    }
}

/// Squares for Z, discs for X, rings for Y; a colour for each cell, red and blue first, as in the paper.
fn repeats(axis: &Axis, summaries: &[CellSummary]) -> Plot {
    const HUES: [Hue; 4] = [Hue::Blue, Hue::Red, Hue::Green, Hue::Orange];
    let mut series = Vec::new();
    for (at, cell) in summaries.iter().enumerate() {
        let errors: [(&str, Marker, &Figure); 3] = [
            ("Z", Marker::Square, &cell.z_percent),
            ("X", Marker::Disc, &cell.x_percent),
            ("Y", Marker::Ring, &cell.y_percent),
        ];
        series.extend(errors.map(|(name, marker, figure)| {
            let numbered = figure.values.iter().enumerate();
            let points = numbered.filter_map(|(trial, value)| {
                Some(PlotPoint {
                    x: (trial + 1) as f64,
                    y: (*value)?,
                    bar: None,
                })
            });
            Series {
                name: format!("{name}, {} {}", axis.label(at), axis.name()),
                hue: HUES[at % HUES.len()],
                has_line: false,
                is_dashed: false,
                marker: Some(marker),
                points: points.collect(),
            }
        }));
    }
    Plot {
        x: PlotAxis::linear("repeat"),
        y: PlotAxis::logarithmic("error (%)"),
        series,
        spans: Vec::new(),
        width_pt: Plot::WIDE_PT,
    }
}

fn along_axis(results: &ExperimentResults, summaries: &[CellSummary]) -> Plot {
    let axis = &results.experiment.axis;
    let (x, numbers): (PlotAxis, Vec<f64>) = match axis {
        Axis::Hidden(values) | Axis::Samples(values) | Axis::Epochs(values) => (
            PlotAxis::linear(axis.name()),
            values.iter().map(|&value| value as f64).collect(),
        ),
        Axis::Array(_) | Axis::Method(_) | Axis::Seed(_) => {
            let places: Vec<f64> = (0..axis.len()).map(|index| index as f64).collect();
            let named = places.iter().copied().zip(labels(axis)).collect();
            let x = PlotAxis {
                named,
                ..PlotAxis::linear(axis.name())
            };
            (x, places)
        }
    };
    let mut cells: Vec<(f64, &CellSummary)> = numbers.into_iter().zip(summaries).collect();
    cells.sort_by(|one, other| one.0.total_cmp(&other.0));
    let series = |name: &str, hue, marker: Option<Marker>, y: fn(&CellSummary) -> Option<f64>| {
        let points = cells.iter().filter_map(|&(x, cell)| {
            let y = y(cell)?;
            Some(PlotPoint { x, y, bar: None })
        });
        Series {
            name: name.to_owned(),
            hue,
            has_line: true,
            is_dashed: marker != Some(Marker::Disc),
            marker,
            points: points.collect(),
        }
    };
    let mut ours = series("this run: median, min, max", Hue::Blue, Some(Marker::Disc), |cell| {
        cell.z_percent.median
    });
    for point in &mut ours.points {
        let cell = cells
            .iter()
            .find(|(x, cell)| *x == point.x && cell.z_percent.median.is_some());
        point.bar = cell.and_then(|(_, cell)| Some([cell.z_percent.min?, cell.z_percent.max?]));
    }
    let all = [
        series("published", Hue::Red, Some(Marker::Square), |cell| {
            cell.z_percent.published
        }),
        ours,
        series("bound of the hidden layer", Hue::Green, None, |cell| {
            cell.bound_z_percent
        }),
        series("linear map", Hue::Orange, None, |cell| cell.linear_z_percent),
    ];
    Plot {
        x,
        y: PlotAxis::linear(Z_ERROR),
        series: all.into_iter().filter(|series| !series.points.is_empty()).collect(),
        spans: suggestions(results),
        width_pt: Plot::WIDE_PT,
    }
}

/// What the paper's rules of thumb suggest, where hidden nodes are varied.
fn suggestions(results: &ExperimentResults) -> Vec<Span> {
    if !matches!(results.experiment.axis, Axis::Hidden(_)) {
        return Vec::new();
    }
    let scale = results.experiment.base.sensor.scale;
    let suggestions = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
    let span = |name: &str, from: usize, to: usize| Span {
        name: name.to_owned(),
        from: from as f64,
        to: to as f64,
    };
    let root = suggestions.square_root;
    vec![
        span("Eq. (12)", *root.start(), *root.end()),
        span("Eq. (13)", suggestions.logarithm, suggestions.logarithm),
    ]
}
