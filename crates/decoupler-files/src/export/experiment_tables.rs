//! Tables of the results of an experiment, and the sentences that are shown with them.

use std::{
    io::{self, Write},
    time::Duration,
};

use decoupler_core::{
    dataset::{Simulation, SplitBy},
    evaluation::{
        Combination, CrossValidation, ErrorMeasure, TargetErrors,
        experiments::{self, AxisKind, Experiment, ExperimentRecording, ExperimentResults, Figure, Trial},
    },
    network::suggested_hidden,
    problem::Channel,
    text::counted,
};

use super::{Cell, Table, TableColumn, TableForm, format_duration, format_number};

/// Table of the results of an experiment for readers, with the same columns in the terminal, in files and in the
/// window.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentTable {
    /// Columns of the table.
    pub columns: Vec<ExperimentColumn>,
    /// Cells of the experiment, row by row.
    pub rows: Vec<Vec<String>>,
    /// Sort keys of the rows: the numbers behind the texts; for an axis, the index of the value in its list.
    pub values: Vec<Vec<Option<f64>>>,
    /// Explanation of the last columns, to be shown below the table.
    pub note: &'static str,
}

/// A column of the results of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExperimentColumn {
    /// Name of the column.
    pub heading: &'static str,
    /// Kind of its figures.
    pub kind: ExperimentColumnKind,
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
    /// Training time.
    Time,
    /// Other figures.
    Other,
}

/// A column, and the value of a cell in it as number and text.
type CellFigure = (ExperimentColumn, Option<f64>, String);

impl ExperimentTable {
    /// The results so far.
    pub fn new(results: &ExperimentResults) -> Self {
        let has_published = results.cells.iter().any(|cell| cell.published.is_some());
        let axes = results.experiment.axes().map(|axis| ExperimentColumn {
            heading: axis.kind.name(),
            kind: ExperimentColumnKind::Axis,
        });
        let first = results.cells.first().map(|cell| figures(cell, has_published));
        let first = first.unwrap_or_default();
        let columns = axes.chain(first.into_iter().map(|(column, ..)| column)).collect();
        let row = |cell: &experiments::Cell| {
            let places = [cell.column, cell.row].map(|place| Some(place as f64));
            let labels = places.into_iter().zip(results.cell_labels(cell));
            let figures = figures(cell, has_published).into_iter();
            labels.chain(figures.map(|(_, value, text)| (value, text))).unzip()
        };
        let (values, rows) = results.cells.iter().map(row).unzip();
        let note = match results.experiment.recording {
            None => NODES_NOTE,
            Some(_) => TARGETS_NOTE,
        };
        Self {
            columns,
            rows,
            values,
            note,
        }
    }

    /// Returns the table for export, with the training time in seconds.
    pub fn table(&self) -> Table {
        let is_axis = |column: &&ExperimentColumn| column.kind == ExperimentColumnKind::Axis;
        let axes = self.columns.iter().take_while(is_axis).count();
        let columns = self.columns.iter().map(|column| match column.kind {
            ExperimentColumnKind::Time => TableColumn::new(column.heading, column.heading, "s"),
            _ => TableColumn::field(column.heading),
        });
        let row = |(texts, values): (&Vec<String>, &Vec<Option<f64>>)| {
            let labels = texts[..axes].iter().map(|label| match label.parse() {
                Ok(count) => Cell::Count(count),
                Err(_) => Cell::Text(label.clone()),
            });
            labels.chain(values[axes..].iter().copied().map(Cell::from)).collect()
        };
        Table {
            columns: columns.collect(),
            rows: self.rows.iter().zip(&self.values).map(row).collect(),
        }
    }
}

const NODES_NOTE: &str = "Median, minimum and maximum over seeds (and repeats). mean: always answering the training mean; \
     linear: best affine map on resistance; epochs: mean of the starts; training: one network, all its starts.";

const TARGETS_NOTE: &str = "Median, minimum and maximum over seeds. error: mean absolute error in percent of the range of \
     the target, averaged over the targets that vary, and R² likewise; mean: always answering the training mean; ridge: \
     ridge regression; epochs: mean of the starts; training: one network, all its starts.";

/// Columns with the figures of a cell.
fn figures(cell: &experiments::Cell, has_published: bool) -> Vec<CellFigure> {
    use ExperimentColumnKind::{Linear, Other, Published, Ranking, Time};
    let number = |heading, kind, value: Option<f64>| {
        let column = ExperimentColumn { heading, kind };
        (column, value, format_number(value))
    };
    let published = |heading, figure: &Figure| {
        let value = figure.published;
        has_published.then(|| number(heading, Published, value))
    };
    let percent = cell.percent();
    let is_array = cell.settings.simulation().is_some();
    let [publ, median, mean, linear] = if is_array {
        ["Z % publ.", "Z % median", "mean Z %", "linear Z %"]
    } else {
        ["error % publ.", "error % median", "mean %", "ridge %"]
    };
    let mut figures = Vec::from_iter(published(publ, &percent));
    figures.extend([
        number(median, Ranking, percent.median),
        number("min", Other, percent.min),
        number("max", Other, percent.max),
    ]);
    for (measure, figure) in cell.errors() {
        let (publ, median) = match measure {
            ErrorMeasure::XPercent => (Some("X % publ."), "X % median"),
            ErrorMeasure::YPercent => (Some("Y % publ."), "Y % median"),
            ErrorMeasure::R2 => (None, "R² median"),
            _ => continue,
        };
        figures.extend(publ.and_then(|publ| published(publ, &figure)));
        figures.push(number(median, Other, figure.median));
    }
    figures.push(number(mean, Other, cell.mean_percent()));
    figures.push(number(linear, Linear, cell.linear_percent()));
    figures.push(number("epochs", Other, cell.epochs_run()));
    let seconds = cell.training_seconds();
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let column = ExperimentColumn {
        heading: "training",
        kind: Time,
    };
    let time = time.map_or_else(|| format_number(None), format_duration);
    figures.push((column, seconds, time));
    figures
}

/// Returns the table of all cells, for programs.
pub fn cells_table(results: &ExperimentResults) -> Table {
    let rows = results.cells.iter().map(|cell| {
        let mut fields = settings_fields(cell);
        fields.extend([
            field("starts", cell.settings.starts.into()),
            field("trials", cell.trials.len().into()),
        ]);
        let figure = |name: &str, figure: &Figure, has_published: bool| {
            let published = has_published.then_some(("published", figure.published));
            let of_trials = [("median", figure.median), ("min", figure.min), ("max", figure.max)];
            let figures = published.into_iter().chain(of_trials);
            Vec::from_iter(figures.map(|(which, value)| field(&format!("{name}_{which}"), value.into())))
        };
        let is_array = cell.settings.simulation().is_some();
        for (measure, of_trials) in cell.errors() {
            if measure != ErrorMeasure::ZMm {
                fields.extend(figure(measure.field(), &of_trials, is_array));
            }
        }
        let name = if is_array {
            ErrorMeasure::ZPercent
        } else {
            ErrorMeasure::RangePercent
        };
        let name = name.field();
        fields.extend([
            field(&format!("mean_{name}"), cell.mean_percent().into()),
            field(&format!("linear_{name}"), cell.linear_percent().into()),
            field("epochs_run", cell.epochs_run().into()),
            field("training_seconds", cell.training_seconds().into()),
            field("epoch_ms", cell.epoch_ms().into()),
        ]);
        fields
    });
    table_of(rows)
}

/// Returns the table of all trials, for programs. Repeats are counted from 1.
pub fn trials_table(results: &ExperimentResults) -> Table {
    let trials = results
        .cells
        .iter()
        .flat_map(|cell| cell.trials.iter().map(move |trial| (cell, trial)));
    let targets = results.problem.as_ref().map_or(&[][..], |problem| &problem.targets);
    table_of(trials.map(|(cell, trial)| {
        let mut fields = settings_fields(cell);
        fields.extend([
            field("seed", Cell::Count(trial.seed.0)),
            field("repeat", (trial.repeat + 1).into()),
        ]);
        let name = match trial.scores.network.nodes() {
            Some(errors) => {
                fields.extend([
                    field("z_percent", errors.z_percent.into()),
                    field("x_percent", errors.x_percent.into()),
                    field("y_percent", errors.y_percent.into()),
                    field("z_mm", errors.z_mm.into()),
                    field("worst_mm", errors.worst_mm.into()),
                ]);
                "z_percent"
            }
            None => {
                fields.extend(target_fields(trial, targets));
                "percent_of_range"
            }
        };
        fields.extend([
            field(&format!("mean_{name}"), trial.scores.baselines.mean.percent().into()),
            field(
                &format!("linear_{name}"),
                trial.scores.baselines.linear.percent().into(),
            ),
            field("epochs_run", trial.effort.epochs.into()),
            field("seconds", trial.effort.seconds.into()),
        ]);
        fields
    }))
}

type Field = (String, Cell);

fn field(name: &str, value: Cell) -> Field {
    (name.to_owned(), value)
}

/// Settings of a cell.
fn settings_fields(cell: &experiments::Cell) -> Vec<Field> {
    let settings = &cell.settings;
    let method = field("method", settings.training.method.short_name().into());
    let epochs = field("epochs", settings.training.stopping.epochs.into());
    match settings.simulation() {
        Some(source) => vec![
            field("array", source.sensor.scale.to_string().into()),
            field("hidden", settings.hidden.into()),
            field("samples", source.samples.into()),
            method,
            epochs,
        ],
        None => {
            let split = cell.division.map(|division| division.by.to_string());
            vec![
                field("split", split.unwrap_or_default().into()),
                field("scaling", settings.inputs.scaling.to_string().into()),
                field("hidden", settings.hidden.into()),
                method,
                epochs,
            ]
        }
    }
}

/// Errors of a trial on a recording: over all targets, and of each in its unit.
fn target_fields(trial: &Trial, targets: &[Channel]) -> Vec<Field> {
    let errors = trial.scores.network.targets();
    let r2 = TargetErrors::over_all(errors).and_then(|errors| errors.r2);
    let mut fields = vec![
        field("percent_of_range", trial.scores.network.percent().into()),
        field("r2", r2.into()),
    ];
    for (number, errors) in errors.iter().enumerate() {
        let name = targets
            .get(number)
            .map_or_else(|| format!("t{}", number + 1), |target| target.name.clone());
        fields.extend([
            field(&format!("{name}.rmse"), errors.rmse.into()),
            field(&format!("{name}.mae"), errors.mae.into()),
            field(&format!("{name}.r2"), errors.r2.into()),
            field(&format!("{name}.worst"), errors.worst.into()),
        ]);
    }
    fields
}

/// A table of rows that have the same fields.
fn table_of(rows: impl Iterator<Item = Vec<Field>>) -> Table {
    let mut columns = Vec::new();
    let rows = rows.map(|fields| {
        if columns.is_empty() {
            columns = fields
                .iter()
                .map(|(name, _)| TableColumn::field(name.clone()))
                .collect();
        }
        fields.into_iter().map(|(_, value)| value).collect()
    });
    let rows = Vec::from_iter(rows);
    Table { columns, rows }
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
        1 => "one start".to_owned(),
        starts => match base.combine {
            Combination::Best => format!("best of {starts} starts by validation error"),
            Combination::Mean => format!("mean of {starts} starts"),
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
        0.0 => test,
        fraction => format!("{test}, {} % of the others for validation", percent(fraction)),
    }
}

/// Describes every failed trial in a sentence.
pub fn describe_failures(results: &ExperimentResults) -> Vec<String> {
    let of_cell = |cell| {
        let label = results.cell_labels(cell).join(", ");
        cell.failures
            .iter()
            .map(move |failure| format!("Failed at {label}, {failure}"))
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
    let mean = &trial.scores.baselines.mean;
    match (trial.scores.network.nodes(), mean.nodes()) {
        (Some(errors), Some(mean)) => errors.z_mm > mean.z_mm,
        // An error that is not finite counts as worse.
        _ => mean
            .percent()
            .is_some_and(|mean| trial.scores.network.percent().is_none_or(|percent| percent > mean)),
    }
}
