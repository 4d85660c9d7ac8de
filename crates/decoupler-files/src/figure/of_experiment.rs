//! The figure of an experiment.

use ndarray::Array2;

use super::{
    Figure, Ink, LineStyle, Look, Marker,
    axis::PlotAxis,
    colour_map::SequentialMap,
    heat_map::HeatMap,
    plot::{LineAt, Plot, PlotFigure, PlotPoint, Series},
    titled,
};
use decoupler_core::{
    evaluation::{
        ErrorMeasure,
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

/// Name and unit of the error by which cells are ranked.
fn error_name(results: &ExperimentResults) -> (&'static str, &'static str) {
    match results.experiment.recording {
        None => ("Z error", "%"),
        Some(_) => ("MAE", "% of range"),
    }
}

fn labels(axis: &Axis) -> Vec<String> {
    (0..axis.values.len()).map(|index| axis.label(index)).collect()
}

fn heat_map(results: &ExperimentResults, rows: &Axis) -> HeatMap {
    let (columns, (error, unit)) = (&results.experiment.axis, error_name(results));
    let shape = [rows.values.len(), columns.values.len()];
    let mut values = Array2::from_elem(shape, f64::NAN);
    let mut notes = Array2::from_elem(shape, String::new());
    for cell in &results.cells {
        let at = [cell.row, cell.column];
        let Measured { median, min, max, .. } = cell.percent();
        values[at] = median.unwrap_or(f64::NAN);
        let name = results.cell_labels(cell).join(", ");
        notes[at] = format!("{name}: median {error} {}", format_percent(median));
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
        value_axis: PlotAxis::logarithmic(titled(&format!("median {error}"), Some(unit))),
    }
}

/// A point at the median of a figure, with a bar from the smallest to the largest.
fn median_point(x: f64, figure: &Measured) -> Option<PlotPoint> {
    let mut point = PlotPoint::from([x, figure.median?]);
    point.bar = figure.min.zip(figure.max).map(<[f64; 2]>::from);
    Some(point)
}

fn along_the_axis(results: &ExperimentResults) -> PlotFigure {
    let axis = &results.experiment.axis;
    let is_number = axis.kind == AxisKind::Hidden;
    // The value itself, or its index in the list.
    let position = |index: usize, cell: &Cell| if is_number { cell.settings.hidden } else { index } as f64;
    let cells = results.cells.iter().enumerate();
    let mut cells = Vec::from_iter(cells.map(|(index, cell)| (position(index, cell), cell)));
    cells.sort_by(|one, other| one.0.total_cmp(&other.0));
    let points = |value: fn(&Cell) -> Option<f64>| {
        let points = cells.iter().filter_map(|(x, cell)| Some([*x, value(cell)?]));
        Vec::from_iter(points)
    };
    // Categories are not joined by lines.
    let look =
        |ink: Ink, marker: Marker, style: LineStyle| Look::marker(ink, marker).joined(is_number.then_some(style));
    let ours_look = look(Ink::Blue, Marker::Disc, LineStyle::Solid);
    let published = look(Ink::Text, Marker::Square, LineStyle::Fine);
    let reference = match is_number {
        true => Look::line(Ink::Grey, LineStyle::Dashed),
        false => Look::marker(Ink::Grey, Marker::Ring),
    };
    let linear = match results.experiment.recording {
        None => "linear map",
        Some(_) => "ridge",
    };
    let ours = cells.iter().filter_map(|(x, cell)| median_point(*x, &cell.percent()));
    let series = [
        Series::new(linear, reference, points(Cell::linear_percent)),
        Series::new("published", published, points(|cell| cell.percent().published)),
        Series::new("ours: median, smallest to largest", ours_look, ours),
    ];
    let x = match is_number {
        true => PlotAxis::integers(axis.kind.name()),
        false => PlotAxis::of_names(axis.kind.name(), labels(axis)),
    };
    // R² along the axis, which nodes of an array do not have.
    let r2 = |(x, cell): &(f64, &Cell)| Some(median_point(*x, &cell.error(ErrorMeasure::R2)?));
    let r2 = cells.iter().map(r2).collect::<Option<Vec<_>>>().map(|points| {
        let series = Series::new("R²", ours_look, points.into_iter().flatten()).listed(None);
        Plot::new(x.clone(), PlotAxis::linear("R²").including([1.0]), [series])
    });
    let (error, unit) = error_name(results);
    let y = PlotAxis::linear(titled(error, Some(unit))).including([0.0, 1.0]);
    // The suggestions of Eq. (12) and (13).
    let suggestions = results.problem.as_ref().filter(|_| is_number).map(|problem| {
        let (root, logarithm) = suggested_hidden(problem.feature_count(), problem.targets.len());
        let (root, logarithm) = ([*root.start() as f64, *root.end() as f64], logarithm as f64);
        let logarithm = Series::across("Eq. (13)", LineAt::X(logarithm), Ink::Orange, LineStyle::Solid);
        let root = Series::across("Eq. (12)", LineAt::Between(root), Ink::Orange, None);
        [root, logarithm]
    });
    let plot = Plot::new(x, y, series.into_iter().chain(suggestions.into_iter().flatten()));
    PlotFigure::new(std::iter::once(plot).chain(r2), [])
}

/// The errors of every trial, one plot each for Z and X (Y is constant); of a recording, the mean absolute error.
fn repeats(results: &ExperimentResults) -> PlotFigure {
    const HUES: [Ink; 4] = [Ink::Blue, Ink::Orange, Ink::Green, Ink::Grey];
    let experiment = &results.experiment;
    let linear = |name: &str| PlotAxis::linear(name).including([0.0]);
    let ranked = match experiment.recording {
        None => ErrorMeasure::ZPercent,
        Some(_) => ErrorMeasure::RangePercent,
    };
    let (error, unit) = error_name(results);
    let errors = [
        (linear(&titled(error, Some(unit))), ranked),
        (linear("X error (%)"), ErrorMeasure::XPercent),
    ];
    let trials = results.cells.iter().map(|cell| cell.expected).max().unwrap_or(1);
    let names = labels(&experiment.axis).into_iter();
    let names = names.map(|label| format!("{label} {}", experiment.axis.kind.name()));
    let cells: Vec<(String, Ink)> = names.zip(HUES.into_iter().cycle()).collect();
    let count = if experiment.recording.is_some() { 1 } else { 2 };
    let plots = errors.into_iter().take(count).map(|(y, measure)| {
        let x = PlotAxis::integers(if experiment.seeds == 1 { "repeat" } else { "trial" });
        let of_cells = || results.cells.iter().zip(&cells);
        let series = of_cells().map(|(cell, (name, ink))| {
            let points = trial_points(experiment, cell, measure);
            Series::new(name, Look::marker(*ink, Marker::Disc), points)
        });
        let lines = of_cells().filter_map(|(cell, (name, ink))| {
            let at = LineAt::Y(cell.error(measure)?.published?);
            let line = Series::across(format!("{name}, published"), at, *ink, LineStyle::Dashed);
            Some(line.listed(Some(name)))
        });
        Plot::new(x.including([0.5, trials as f64 + 0.5]), y, series.chain(lines))
    });
    let plots = Vec::from_iter(plots);
    let has_lines = plots.iter().any(|plot| plot.lines_across().next().is_some());
    PlotFigure::new(plots, has_lines.then(|| "Dashed lines: published.".to_owned()))
}

/// Error of each trial of a cell against the number of the trial, counted from 1 through all seeds (Fig. 5).
fn trial_points(experiment: &Experiment, cell: &Cell, measure: ErrorMeasure) -> Vec<[f64; 2]> {
    let repeats = experiment.cross_validation.map_or(1, |validation| validation.repeats);
    let number = |trial: &Trial| {
        let seeds_before = trial.seed.0.wrapping_sub(cell.settings.seed.0) as f64;
        seeds_before * repeats as f64 + trial.repeat as f64 + 1.0
    };
    let point = |trial: &Trial| Some([number(trial), trial.scores.network.figure(measure)?]);
    cell.trials.iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use super::*;
    use crate::figure::axis::Scale;
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
        let points = trial_points(&experiment, &results.cells[0], ErrorMeasure::ZPercent);
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
            ["published", "Eq. (12)", "Eq. (13)"],
            "there are no other results yet"
        );
        assert_eq!(hidden.plots[0].series[0].points[3], PlotPoint::from([12.0, 2.28]));
        let repeats = plots_of(PaperTable::CrossValidation);
        assert_eq!(keys(&repeats), ["1000 samples", "100 samples"]);
        assert_eq!(repeats.notes, ["Dashed lines: published."]);
        let published = |plot: &Plot| plot.lines_across().map(|(_, at)| at).collect::<Vec<_>>();
        assert_eq!(published(&repeats.plots[0]), [LineAt::Y(2.01), LineAt::Y(3.35)]);
        let arrays = plots_of(PaperTable::ArrayScales);
        assert!(matches!(&arrays.plots[0].x.scale, Scale::Names(names) if names[1] == "10×8_4×24"));
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
