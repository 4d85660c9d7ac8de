//! Tables of the results of an experiment, and the sentences that are shown with them.

use std::io::{self, Write};

use decoupler_core::{
    dataset::{Simulation, SplitBy},
    evaluation::{
        Combination, CrossValidation, ErrorMeasure, TestErrors,
        experiments::{self, AxisKind, Experiment, ExperimentRecording, ExperimentResults, Trial},
    },
    network::suggested_hidden,
    text::counted,
};

use super::{Cell, Table, TableColumn, TableForm, table::cell, tables::percent_of};

/// Table of the results of an experiment for readers, with the same columns in the terminal, in files and in the
/// window.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentTable {
    /// Headings, and the cells of the experiment row by row.
    pub table: Table,
    /// Kind of the figures in each column.
    pub kinds: Vec<ExperimentColumnKind>,
    /// Explanation of the last columns, to be shown below the table.
    pub note: &'static str,
}

/// Kind of the figures in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExperimentColumnKind {
    /// Values of a setting that is varied.
    Axis,
    /// Errors by which cells are ranked.
    Ranking,
    /// Errors that the paper reports.
    Published,
    /// Errors of the linear baseline.
    Linear,
    /// Other figures.
    Other,
}

impl ExperimentTable {
    /// The results so far.
    pub fn new(results: &ExperimentResults) -> Self {
        let has_published = results.cells.iter().any(|cell| cell.published.is_some());
        let row = |of: &experiments::Cell| {
            let labels = results.experiment.axes().zip(results.cell_labels(of));
            let labels = labels.map(|(axis, label)| {
                let cell = label.parse().map_or_else(|_| Cell::Text(label.clone()), Cell::Count);
                (axis.kind.name(), ExperimentColumnKind::Axis, cell)
            });
            let figures = figures(of).into_iter();
            let figures = figures.filter_map(|(_, shown, cell)| shown.map(|(heading, kind)| (heading, kind, cell)));
            let figures = figures.filter(|(_, kind, _)| has_published || *kind != ExperimentColumnKind::Published);
            Vec::from_iter(labels.chain(figures))
        };
        let rows = Vec::from_iter(results.cells.iter().map(row));
        let kinds = rows.first().into_iter().flatten();
        let cells = |row: Vec<(_, _, Cell)>| {
            let cells = row.into_iter();
            cells.map(|(heading, _, value)| cell(heading, value)).collect()
        };
        Self {
            kinds: kinds.map(|&(_, kind, _)| kind).collect(),
            table: Table::of_rows(rows.into_iter().map(cells)),
            note: match results.experiment.recording {
                None => NODES_NOTE,
                Some(_) => TARGETS_NOTE,
            },
        }
    }

    /// Returns the table for export, with the training time in seconds.
    pub fn table(&self) -> Table {
        let mut table = self.table.clone();
        for (place, column) in table.columns.iter_mut().enumerate() {
            for row in &mut table.rows {
                if let Cell::Seconds(seconds) = row[place] {
                    (column.unit, row[place]) = ("s", Cell::Number(seconds));
                }
            }
        }
        table
    }
}

const NODES_NOTE: &str = "Median, minimum and maximum over seeds (and repeats). mean: always answering the training mean; \
     linear: best affine map on resistance; epochs: mean of the restarts; training time: of one training, on one thread.";

const TARGETS_NOTE: &str = "Median, minimum and maximum over seeds. error: mean absolute error in percent of the range of \
     the target, averaged over the targets that vary, and R² likewise; mean: always answering the training mean; ridge: \
     ridge regression; epochs: mean of the restarts; training time: of one training, on one thread.";

/// A figure of a cell: its name in tables for programs; where readers see it, the heading and kind of its column; its value.
type CellFigure = (String, Option<(&'static str, ExperimentColumnKind)>, Cell);

/// All figures of a cell.
fn figures(of: &experiments::Cell) -> Vec<CellFigure> {
    use ExperimentColumnKind::{Linear, Other, Published, Ranking};
    let is_array = of.settings.simulation().is_some();
    let mut figures: Vec<CellFigure> = Vec::new();
    for (measure, figure) in of.errors().filter(|(measure, _)| *measure != ErrorMeasure::ZMm) {
        let (published, median, kind) = match measure {
            ErrorMeasure::ZPercent => ("Z % publ.", "Z % median", Ranking),
            ErrorMeasure::XPercent | ErrorMeasure::YPercent => ("X % publ.", "X % median", Other),
            ErrorMeasure::R2 => ("", "R² median", Other),
            _ => ("", "error % median", Ranking),
        };
        // Y is constant.
        let shown = |heading, kind| (measure != ErrorMeasure::YPercent).then_some((heading, kind));
        let of_ranking = |heading| (kind == Ranking).then_some((heading, Other));
        let name = |statistic: &str| format!("{}_{statistic}", measure.field());
        // Nothing is published for a recording.
        figures.extend(is_array.then(|| (name("published"), shown(published, Published), figure.published.into())));
        figures.extend([
            (name("median"), shown(median, kind), figure.median.into()),
            (name("min"), of_ranking("min"), figure.min.into()),
            (name("max"), of_ranking("max"), figure.max.into()),
        ]);
    }
    let [mean, linear] = if is_array {
        ["mean Z %", "linear Z %"]
    } else {
        ["mean %", "ridge %"]
    };
    let (name, seconds) = (percent_of(is_array).field(), Cell::Seconds(of.training_seconds()));
    let [of_mean, of_linear] = [of.mean_percent(), of.linear_percent()].map(Cell::from);
    figures.extend([
        (format!("mean_{name}"), Some((mean, Other)), of_mean),
        (format!("linear_{name}"), Some((linear, Linear)), of_linear),
        ("epochs_run".to_owned(), Some(("epochs", Other)), of.epochs_run().into()),
        ("training_seconds".to_owned(), Some(("training time", Other)), seconds),
        ("epoch_ms".to_owned(), None, of.epoch_ms().into()),
    ]);
    figures
}

/// Returns the table of all cells, for programs.
pub fn cells_table(results: &ExperimentResults) -> Table {
    Table::of_rows(results.cells.iter().map(|of| {
        let mut fields = settings_fields(of);
        fields.push(cell("starts", of.settings.starts));
        fields.push(cell("trials", of.trials.len()));
        fields.extend({ figures(of).into_iter() }.map(|(name, _, figure)| cell(&*name, figure)));
        fields
    }))
}

/// Returns the table of all trials, for programs. Repeats are counted from 1.
pub fn trials_table(results: &ExperimentResults) -> Table {
    use ErrorMeasure::{Mae, R2, RangePercent, Rmse, Worst, WorstMm, XPercent, YPercent, ZMm, ZPercent};
    let trials = { results.cells.iter() }.flat_map(|of| of.trials.iter().map(move |trial| (of, trial)));
    let targets = results.problem.as_ref().map_or(&[][..], |problem| &problem.targets);
    Table::of_rows(trials.map(|(of, trial)| {
        let (network, baselines) = (&trial.scores.network, &trial.scores.baselines);
        let is_array = network.nodes().is_some();
        let mut fields = settings_fields(of);
        fields.push(cell("seed", Cell::Count(trial.seed.0)));
        fields.push(cell("repeat", trial.repeat + 1));
        let measures = match is_array {
            true => &[ZPercent, XPercent, YPercent, ZMm, WorstMm][..],
            false => &[RangePercent, R2],
        };
        let errors = measures.iter();
        fields.extend(errors.map(|&measure| cell(measure.field(), network.figure(measure))));
        // The errors of each target, in its unit.
        for (number, errors) in network.targets().iter().enumerate() {
            let name = targets.get(number).map(|target| target.name.clone());
            let name = name.unwrap_or_else(|| format!("t{}", number + 1));
            let of_target =
                |measure: ErrorMeasure| cell(&*format!("{name}.{}", measure.field()), measure.of_target(errors));
            fields.extend([Rmse, Mae, R2, Worst].map(of_target));
        }
        let name = percent_of(is_array).field();
        fields.extend([
            cell(&*format!("mean_{name}"), baselines.mean.percent()),
            cell(&*format!("linear_{name}"), baselines.linear.percent()),
            cell("epochs_run", trial.effort.epochs),
            cell("seconds", trial.effort.seconds),
        ]);
        fields
    }))
}

/// Settings of a cell.
fn settings_fields(of: &experiments::Cell) -> Vec<(TableColumn, Cell)> {
    use AxisKind::{Array, Epochs, Hidden, Method, Samples, Scaling, Split};
    let kinds = match of.settings.simulation() {
        Some(_) => [Array, Hidden, Samples, Method, Epochs],
        None => [Split, Scaling, Hidden, Method, Epochs],
    };
    kinds.map(|kind| cell(axis_word(kind), kind.setting().get(of))).to_vec()
}

/// Option of `train` for a setting, and its name in tables for programs.
pub(super) fn axis_word(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "hidden",
        kind => kind.setting().name,
    }
}

/// Writes the table as Markdown under `title`, with `conditions` between.
///
/// # Errors
/// Any error of `writer`.
pub fn write_experiment_markdown(
    title: &str,
    conditions: &str,
    results: &ExperimentResults,
    writer: &mut dyn Write,
) -> io::Result<()> {
    let table = ExperimentTable::new(results);
    let text = table.table().text(TableForm::Markdown);
    writeln!(writer, "## {title}\n\n{conditions}\n\n{text}")?;
    writeln!(writer, "{}", table.note)
}

/// Describes the conditions of an experiment in one or two sentences.
pub fn describe_conditions(experiment: &Experiment) -> String {
    let base = &experiment.base;
    let simulation = base.simulation();
    let varies = |kind| experiment.axes().any(|axis| axis.kind == kind);
    let mut said = vec![base.training.method.name().to_owned()];
    if let Some(recording) = &experiment.recording {
        said.insert(0, recording.name.clone());
        if varies(AxisKind::Method) {
            said.pop();
        }
    }
    if let Some(source) = simulation.filter(|_| experiment.axis.kind != AxisKind::Array) {
        said.push(source.sensor.scale.to_string());
    }
    if experiment.axis.kind != AxisKind::Hidden {
        said.push(counted(base.hidden, "hidden node"));
    }
    said.push(counted(base.training.stopping.epochs, "epoch"));
    said.push(match base.starts {
        1 => "one restart".to_owned(),
        starts => match base.combine {
            Combination::Best => format!("best of {starts} restarts by validation error"),
            Combination::Mean => format!("mean of {starts} restarts"),
        },
    });
    said.push(match experiment.seeds {
        1 => format!("seed {}", base.seed),
        seeds => format!("{seeds} seeds from {}", base.seed),
    });
    let division = experiment.recording.as_ref();
    said.extend(simulation.map(|source| describe_samples(source, experiment.cross_validation)));
    said.extend(division.map(|recording| describe_division(recording, varies(AxisKind::Split))));
    let mut conditions = said.join(", ");
    if let Some(source) = simulation.filter(|_| experiment.axis.kind == AxisKind::Hidden) {
        let scale = source.sensor.scale;
        let (root, logarithm) = suggested_hidden(scale.columns(), scale.coordinates_per_row());
        let (fewest, most) = (root.start(), root.end());
        conditions += &format!(". Eq. (12) suggests {fewest} to {most} hidden nodes, Eq. (13) {logarithm}");
    }
    conditions
}

fn describe_samples(source: &Simulation, cross_validation: Option<CrossValidation>) -> String {
    match cross_validation {
        None => format!(
            "{}, {} more for validation, {} for test",
            counted(source.samples, "training sample"),
            source.validation_samples,
            source.test_samples
        ),
        Some(CrossValidation { folds, repeats, by }) => {
            let unit = match by {
                SplitBy::Time => "block of time",
                SplitBy::Group => "snapshot",
                SplitBy::Random => "sample",
            };
            let validation = match folds {
                2 => "nothing held out for validation",
                _ => "one of the other folds is held out for validation",
            };
            format!("{folds} folds by {unit}, {validation}, {}", counted(repeats, "repeat"))
        }
    }
}

/// Describes the test samples, and those held out for validation; `varies` if the rule is an axis.
fn describe_division(recording: &ExperimentRecording, varies: bool) -> String {
    let percent = |share: f64| (1000.0 * share).round() / 10.0;
    let division = &recording.division;
    let share = percent(division.test_fraction);
    let test = match (recording.has_test_files, varies, division.by) {
        (true, ..) => "tested on separate files".to_owned(),
        (false, true, _) => format!("{share} % of the samples for test"),
        (false, false, SplitBy::Time) => format!("the last {share} % of the samples for test"),
        (false, false, SplitBy::Group) => format!("groups with {share} % of the samples for test"),
        (false, false, SplitBy::Random) => format!("a random {share} % of the samples for test"),
    };
    match division.validation_fraction {
        None | Some(0.0) => test,
        Some(fraction) => format!("{test}, {} % of the others for validation", percent(fraction)),
    }
}

/// Describes every failed trial in a sentence.
pub fn describe_failures(results: &ExperimentResults) -> Vec<String> {
    let of_cell = |cell| {
        let label = results.cell_labels(cell).join(", ");
        let failures = cell.failures.iter();
        failures.map(move |failure| format!("Failed at {label}, {failure}"))
    };
    results.cells.iter().flat_map(of_cell).collect()
}

/// Describes every cell that has networks worse than always answering the training mean, one sentence per cell.
pub fn describe_worse_than_mean(results: &ExperimentResults) -> Vec<String> {
    let of_cell = |cell: &experiments::Cell| {
        let is_worse = |trial: &&Trial| is_worse_than_mean(trial);
        let (worse, trials) = (cell.trials.iter().filter(is_worse).count(), cell.trials.len());
        (worse > 0).then(|| {
            format!(
                "At {}, {worse} of {trials} are worse than always answering the training mean: other epochs, hidden \
                 nodes, methods or more samples may help",
                results.cell_labels(cell).join(", ")
            )
        })
    };
    results.cells.iter().filter_map(of_cell).collect()
}

fn is_worse_than_mean(trial: &Trial) -> bool {
    let error = |errors: &TestErrors| errors.figure(ErrorMeasure::ZMm).or_else(|| errors.percent());
    let [network, mean] = [&trial.scores.network, &trial.scores.baselines.mean].map(error);
    // An error that is not finite counts as worse.
    mean.is_some_and(|mean| network.is_none_or(|network| network > mean))
}
