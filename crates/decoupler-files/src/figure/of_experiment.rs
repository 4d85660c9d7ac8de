//! The figure of an experiment.

use ndarray::Array2;

use super::{
    Hue, LineStyle, Look, Marker,
    axis::{PlotAxis, TickRule},
    colour_map::SequentialMap,
    heat_map::HeatMap,
    plot::{LineAt, Plot, PlotFigure, PlotPoint, ReferenceLine, Series, Span},
};
use crate::figure::Figure;
use decoupler_core::{
    evaluation::{
        ErrorMeasure, TestErrors,
        experiments::{Axis, AxisKind, Cell, Experiment, ExperimentResults, Figure as Measured, Trial},
    },
    network::suggested_hidden,
    text::format_percent,
};

/// The results so far of an experiment: a heat map of the median error over two axes, the errors of every repeat of a
/// cross-validation (the paper's Fig. 5), or else the error along the axis next to the published one, with R² along the axis
/// for a recording.
pub fn experiment_figure(results: &ExperimentResults) -> Figure {
    if let Some(rows) = &results.experiment.second_axis {
        heat_map(results, rows).into()
    } else if results.experiment.cross_validation.is_some() {
        repeats(results).into()
    } else {
        along_the_axis(results).into()
    }
}

/// Name of the error in percent by which cells are ranked.
fn error_name(results: &ExperimentResults) -> &'static str {
    match results.experiment.recording {
        None => "Z error",
        Some(_) => "mean absolute error",
    }
}

/// Name of the axis of that error.
fn error_axis(results: &ExperimentResults) -> &'static str {
    match results.experiment.recording {
        None => "Z error (%)",
        Some(_) => "mean absolute error (% of range)",
    }
}

fn labels(axis: &Axis) -> Vec<String> {
    (0..axis.values.len()).map(|index| axis.label(index)).collect()
}

fn heat_map(results: &ExperimentResults, rows: &Axis) -> HeatMap {
    let columns = &results.experiment.axis;
    let shape = [rows.values.len(), columns.values.len()];
    let mut values = Array2::from_elem(shape, f64::NAN);
    let mut notes = Array2::from_elem(shape, String::new());
    for cell in &results.cells {
        let at = [cell.row, cell.column];
        let Measured { median, min, max, .. } = cell.percent();
        values[at] = median.unwrap_or(f64::NAN);
        let name = results.cell_labels(cell).join(", ");
        notes[at] = format!("{name}: median {} {}", error_name(results), format_percent(median));
        if let Some((least, largest)) = min.zip(max) {
            notes[at] += &format!("\n{} to {}", format_percent(least), format_percent(largest));
        }
    }
    HeatMap {
        colours: SequentialMap::default(),
        x_name: columns.kind.name().to_owned(),
        y_name: rows.kind.name().to_owned(),
        columns: labels(columns),
        rows: labels(rows),
        values,
        notes,
        value_axis: PlotAxis::logarithmic(format!("median {}", error_axis(results))),
    }
}

/// Position of a cell on the axis: the value itself, or its index in the list.
fn position(axis: &Axis, index: usize, cell: &Cell) -> f64 {
    match axis.kind {
        AxisKind::Hidden => cell.settings.hidden as f64,
        _ => index as f64,
    }
}

/// A point at the median of a figure, with a bar from the smallest to the largest.
fn median_point(x: f64, figure: &Measured) -> Option<PlotPoint> {
    let Measured { median, min, max, .. } = figure;
    Some(PlotPoint {
        bar: min.zip(*max).map(|(least, largest)| [least, largest]),
        ..PlotPoint::from([x, (*median)?])
    })
}

fn along_the_axis(results: &ExperimentResults) -> PlotFigure {
    let axis = &results.experiment.axis;
    let is_number = axis.kind == AxisKind::Hidden;
    let cells = results.cells.iter().enumerate();
    let mut cells: Vec<(f64, &Cell)> = cells.map(|(index, cell)| (position(axis, index, cell), cell)).collect();
    cells.sort_by(|one, other| one.0.total_cmp(&other.0));
    let points = |value: fn(&Cell) -> Option<f64>| {
        let points = cells.iter().filter_map(move |(x, cell)| Some([*x, value(cell)?]));
        points.collect::<Vec<_>>()
    };
    // Categories are not joined by lines.
    let ours_look = match is_number {
        true => Look::marker(Hue::Blue, Marker::Disc).joined(),
        false => Look::marker(Hue::Blue, Marker::Disc),
    };
    let reference = match is_number {
        true => Look::line(Hue::Grey, LineStyle::Dashed),
        false => Look::marker(Hue::Grey, Marker::Ring),
    };
    let published = Look {
        line: is_number.then_some(LineStyle::Fine),
        ..Look::marker(Hue::Ink, Marker::Square)
    };
    let linear = match results.experiment.recording {
        None => "linear map",
        Some(_) => "ridge",
    };
    let ours = cells.iter().filter_map(|(x, cell)| median_point(*x, &cell.percent()));
    let mut series = vec![
        Series::new(linear, reference, points(Cell::linear_percent)),
        Series::new("published", published, points(|cell| cell.percent().published)),
        Series::new("ours: median, smallest to largest", ours_look, ours),
    ];
    series.retain(|series| !series.points.is_empty());
    let x = PlotAxis::linear(axis.kind.name());
    let x = match is_number {
        true => x.ticked(TickRule::Whole),
        false => x
            .ticked(TickRule::Names(labels(axis)))
            .including([-0.5, axis.values.len() as f64 - 0.5]),
    };
    let r2 = r2_plot(x.clone(), &cells, ours_look);
    let mut plot = Plot::new(x, PlotAxis::linear(error_axis(results)).including([0.0, 1.0]), series);
    if let Some(problem) = results.problem.as_ref().filter(|_| is_number) {
        // The suggestions of Eq. (12) and (13).
        let (root, logarithm) = suggested_hidden(problem.feature_count(), problem.targets.len());
        plot.spans.push(Span {
            name: "Eq. (12)".to_owned(),
            hue: Hue::Orange,
            range: *root.start() as f64..=*root.end() as f64,
        });
        let at = LineAt::X(logarithm as f64);
        let line = ReferenceLine::new("Eq. (13)", at, Hue::Orange, LineStyle::Solid);
        plot.lines.push(line.labelled("Eq. (13)"));
    }
    PlotFigure {
        plots: std::iter::once(plot).chain(r2).collect(),
        notes: Vec::new(),
    }
}

/// R² of the networks along the axis; `None` for the nodes of an array.
fn r2_plot(x: PlotAxis, cells: &[(f64, &Cell)], look: Look) -> Option<Plot> {
    let points = cells
        .iter()
        .map(|(x, cell)| Some(median_point(*x, &cell.error(ErrorMeasure::R2)?)));
    let points: Vec<Option<PlotPoint>> = points.collect::<Option<_>>()?;
    let series = Series::new("R²", look, points.into_iter().flatten()).listed(None);
    Some(Plot::new(x, PlotAxis::linear("R²").including([1.0]), vec![series]))
}

type PublishedError = fn(&Cell) -> Option<f64>;
type TrialError = fn(&TestErrors) -> Option<f64>;

/// The errors of every trial, one plot each for Z, X and Y.
fn repeats(results: &ExperimentResults) -> PlotFigure {
    const HUES: [Hue; 4] = [Hue::Blue, Hue::Orange, Hue::Green, Hue::Grey];
    let experiment = &results.experiment;
    let axis = &experiment.axis;
    let linear = |name: &str| PlotAxis::linear(name).including([0.0]);
    let errors: [(PlotAxis, PublishedError, TrialError); 3] = [
        (
            linear("Z error (%)"),
            |cell| cell.percent().published,
            TestErrors::percent,
        ),
        (
            linear("X error (%)"),
            |cell| cell.error(ErrorMeasure::XPercent)?.published,
            |errors| errors.nodes()?.x_percent,
        ),
        // Y is constant, so its error may be exactly 0 or of the size of rounding errors.
        (
            PlotAxis::logarithmic("Y error (%)"),
            |cell| cell.error(ErrorMeasure::YPercent)?.published,
            |errors| errors.nodes()?.y_percent,
        ),
    ];
    let trials = results.cells.iter().map(|cell| cell.expected).max().unwrap_or(1);
    let names = labels(axis)
        .into_iter()
        .map(|label| format!("{label} {}", axis.kind.name()));
    let cells: Vec<(String, Hue)> = names.zip(HUES.into_iter().cycle()).collect();
    let plots = errors.map(|(y, published, measured)| {
        let x = PlotAxis::linear(repeat_name(results)).including([0.5, trials as f64 + 0.5]);
        let of_cells = || results.cells.iter().zip(&cells);
        let series = of_cells().map(|(cell, (name, hue))| {
            let look = Look::marker(*hue, Marker::Disc);
            Series::new(name, look, trial_points(experiment, cell, measured))
        });
        let lines = of_cells().filter_map(|(cell, (name, hue))| {
            let at = LineAt::Y(published(cell)?);
            let line = ReferenceLine::new(format!("{name}, published"), at, *hue, LineStyle::Dashed);
            Some(line.listed(Some(name)))
        });
        Plot::new(x.ticked(TickRule::Whole), y, series.collect()).with_lines(lines)
    });
    let is_zero = |cell: &Cell| {
        cell.error(ErrorMeasure::YPercent)
            .is_some_and(|y| y.median == Some(0.0))
    };
    let notes = [
        (
            plots.iter().any(|plot| !plot.lines.is_empty()),
            "Dashed lines: published.",
        ),
        (
            results.cells.iter().any(is_zero),
            "Y is constant: its error is 0 and lies below the axis.",
        ),
    ];
    let notes = notes
        .into_iter()
        .filter(|(applies, _)| *applies)
        .map(|(_, note)| note.to_owned());
    PlotFigure {
        plots: plots.into(),
        notes: notes.collect(),
    }
}

/// Error of each trial of a cell against the number of the trial, counted from 1 through all seeds (Fig. 5).
fn trial_points(experiment: &Experiment, cell: &Cell, error: TrialError) -> Vec<[f64; 2]> {
    let repeats = experiment.cross_validation.map_or(1, |validation| validation.repeats);
    let number = |trial: &Trial| {
        let seeds_before = trial.seed.0.wrapping_sub(cell.settings.seed.0) as f64;
        seeds_before * repeats as f64 + trial.repeat as f64 + 1.0
    };
    let points = cell.trials.iter();
    points
        .filter_map(|trial| Some([number(trial), error(&trial.scores.network)?]))
        .collect()
}

/// Returns the name of the trial axis of a cross-validation.
fn repeat_name(results: &ExperimentResults) -> &'static str {
    match results.experiment.seeds {
        1 => "repeat",
        _ => "trial",
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use super::*;
    use decoupler_core::{
        dataset::{Seed, SplitBy},
        evaluation::{
            CrossValidation,
            experiments::{Finished, PaperTable, TrialSamples, run_experiments},
        },
        machine::MemoryBudget,
    };

    #[test]
    fn trials_keep_their_numbers_in_any_order_of_finishing() {
        let mut experiment = PaperTable::CrossValidation.experiment();
        experiment.base.training.stopping.epochs = 1;
        experiment.base.hidden = 1;
        experiment.axis = Axis::integers(AxisKind::Samples, [40]);
        (experiment.seeds, experiment.base.seed) = (2, Seed(7));
        experiment.cross_validation = Some(CrossValidation {
            folds: 2,
            repeats: 3,
            by: SplitBy::Random,
        });
        let mut results = ExperimentResults::new(experiment.clone());
        let mut finished = Vec::new();
        let keep = |trial: Finished| finished.push(trial);
        let one = NonZero::<usize>::MIN;
        run_experiments(
            std::slice::from_ref(&experiment),
            &TrialSamples::Drawn(MemoryBudget::UNLIMITED),
            one,
            || false,
            keep,
        )
        .unwrap();
        // The fourth trial is the second seed's first.
        for trial in finished.into_iter().rev().take(3) {
            results.record(trial.cell, trial.outcome);
        }
        let points = trial_points(&experiment, &results.cells[0], TestErrors::percent);
        assert_eq!(points.iter().map(|point| point[0]).collect::<Vec<_>>(), [4.0, 5.0, 6.0]);
    }

    fn plots_of(table: PaperTable) -> PlotFigure {
        match experiment_figure(&ExperimentResults::new(table.experiment())) {
            Figure::Plots(figure) => figure,
            _ => panic!("a table is not a heat map"),
        }
    }

    #[test]
    fn published_figures_are_shown_before_any_run() {
        let keys = |figure: &PlotFigure| {
            figure
                .keys()
                .into_iter()
                .map(|(key, _)| key.to_owned())
                .collect::<Vec<_>>()
        };
        let hidden = plots_of(PaperTable::HiddenNodes);
        assert_eq!(
            keys(&hidden),
            ["published", "Eq. (12)"],
            "there are no other results yet"
        );
        assert_eq!(hidden.plots[0].series[0].points[3], PlotPoint::from([12.0, 2.28]));
        let repeats = plots_of(PaperTable::CrossValidation);
        assert_eq!(keys(&repeats), ["1000 samples", "100 samples"]);
        assert_eq!(repeats.notes, ["Dashed lines: published."]);
        let published = |plot: &Plot| plot.lines.iter().map(|line| line.at).collect::<Vec<_>>();
        assert_eq!(published(&repeats.plots[0]), [LineAt::Y(2.01), LineAt::Y(3.35)]);
        let arrays = plots_of(PaperTable::ArrayScales);
        assert!(matches!(&arrays.plots[0].x.ticks, TickRule::Names(names) if names[1] == "10×8_4×24"));
    }

    #[test]
    fn a_sweep_is_a_heat_map_with_rows_and_columns_named() {
        let mut experiment = PaperTable::ArrayScales.experiment();
        experiment.second_axis = Some(Axis::integers(AxisKind::Hidden, [7, 9]));
        let Figure::HeatMap(map) = experiment_figure(&ExperimentResults::new(experiment)) else {
            panic!("two axes make a heat map");
        };
        assert_eq!(map.values.dim(), (2, 3));
        assert!(map.values.iter().all(|value| value.is_nan()));
        assert_eq!(
            (map.rows, map.columns[0].as_str()),
            (vec!["7".to_owned(), "9".to_owned()], "10×6_3×18")
        );
        assert_eq!(map.notes[[1, 2]], "10×10_5×30, 9: median Z error –");
    }
}
