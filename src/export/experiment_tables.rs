use std::{
    io::{self, Write},
    time::Duration,
};

use super::{Cell, Table, TableColumn, TableForm, format_duration, format_number};
use crate::evaluation::experiments::{CellResults, CellSummary, ExperimentResults, Figure, Trial, Verdict};

/// The results of an experiment for reading: the same columns in the terminal, in files and in the window.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentTable {
    /// The names of the columns.
    pub headings: Vec<&'static str>,
    /// Cells of the experiment, row by row.
    pub rows: Vec<Vec<String>>,
    /// Sort keys of the rows: the numbers behind the texts; for an axis, the index of the value in its list.
    pub values: Vec<Vec<Option<f64>>>,
}

impl ExperimentTable {
    /// The results so far.
    pub fn new(results: &ExperimentResults) -> Self {
        let summaries = results.summaries();
        let has_published = results.cells.iter().any(|cell| cell.cell.published.is_some());
        let mut headings: Vec<_> = results.experiment.axes().map(|axis| axis.name()).collect();
        headings.extend(
            Self::figures(None, has_published)
                .into_iter()
                .map(|(heading, _, _)| heading),
        );
        let row = |(cell, summary): (&CellResults, &CellSummary)| {
            let places = [cell.cell.column, cell.cell.row].map(|place| Some(place as f64));
            let labels = places.into_iter().zip(results.cell_labels(cell));
            let figures = Self::figures(Some(summary), has_published).into_iter();
            labels.chain(figures.map(|(_, value, text)| (value, text))).unzip()
        };
        let (values, rows) = results.cells.iter().zip(&summaries).map(row).unzip();
        Self { headings, rows, values }
    }

    /// Headings with the figures of a cell.
    fn figures(summary: Option<&CellSummary>, has_published: bool) -> Vec<(&'static str, Option<f64>, String)> {
        let number = |heading, figure: fn(&CellSummary) -> Option<f64>| {
            let value = summary.and_then(figure);
            (heading, value, format_number(value))
        };
        let mut figures = Vec::new();
        let published = |heading, figure: fn(&CellSummary) -> Option<f64>| {
            if has_published {
                vec![number(heading, figure)]
            } else {
                Vec::new()
            }
        };
        figures.extend(published("Z % publ.", |cell| cell.z_percent.published));
        figures.extend([
            number("Z % median", |cell| cell.z_percent.median),
            number("min", |cell| cell.z_percent.min),
            number("max", |cell| cell.z_percent.max),
        ]);
        figures.extend(published("X % publ.", |cell| cell.x_percent.published));
        figures.push(number("X % median", |cell| cell.x_percent.median));
        figures.extend(published("Y % publ.", |cell| cell.y_percent.published));
        figures.push(number("Y % median", |cell| cell.y_percent.median));
        let seconds = summary.and_then(|summary| summary.training_seconds);
        let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        figures.extend([
            number("mean Z %", |cell| cell.mean_z_percent),
            number("linear Z %", |cell| cell.linear_z_percent),
            number("bound Z %", |cell| cell.bound_z_percent),
            number("epochs", |cell| cell.epochs_run),
            (
                Self::TIME,
                seconds,
                time.map_or_else(|| format_number(None), format_duration),
            ),
        ]);
        figures
    }

    /// The table for other documents, with the training time in seconds.
    pub fn table(&self) -> Table {
        let axes = self.headings.iter().position(|heading| heading.starts_with("Z %"));
        let axes = axes.unwrap_or(self.headings.len());
        let columns = self.headings.iter().map(|&heading| match heading {
            Self::TIME => TableColumn::new(heading, heading, "s"),
            _ => TableColumn::field(heading),
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

    /// Heading of the training time.
    const TIME: &'static str = "training";

    /// Explanation of the last columns, to be shown below the table.
    pub const NOTE: &'static str = "Medians, least and largest over seeds (and repeats). mean: always answering the \
         training mean; linear: best affine map on resistance; bound: what so few hidden nodes can carry, the \
         least-squares best answer of any network with them; epochs: mean of the starts; training: one network, all \
         its starts.";
}

/// The figures of every cell: for programs.
pub fn cells_table(results: &ExperimentResults) -> Table {
    let mut fields = ["array", "hidden", "samples", "method", "epochs", "starts", "trials"]
        .map(str::to_owned)
        .to_vec();
    for axis in ["z", "x", "y"] {
        fields.extend(["published", "median", "min", "max"].map(|figure| format!("{axis}_percent_{figure}")));
    }
    let rest = [
        "mean_z_percent",
        "linear_z_percent",
        "bound_z_percent",
        "epochs_run",
        "training_seconds",
        "epoch_ms",
    ];
    fields.extend(rest.map(str::to_owned));
    let row = |summary: CellSummary| {
        let mut row: Vec<Cell> = vec![
            summary.array.to_string().into(),
            summary.hidden.into(),
            summary.samples.into(),
            summary.method.to_string().into(),
            summary.epochs.into(),
            summary.starts.into(),
            summary.trials.into(),
        ];
        for figure in [&summary.z_percent, &summary.x_percent, &summary.y_percent] {
            let Figure {
                published,
                median,
                min,
                max,
                ..
            } = *figure;
            row.extend([published, median, min, max].map(Cell::from));
        }
        let rest = [
            summary.mean_z_percent,
            summary.linear_z_percent,
            summary.bound_z_percent,
            summary.epochs_run,
            summary.training_seconds,
            summary.epoch_ms,
        ];
        row.extend(rest.map(Cell::from));
        row
    };
    Table {
        columns: fields.into_iter().map(TableColumn::field).collect(),
        rows: results.summaries().into_iter().map(row).collect(),
    }
}

/// Every trial: for programs. Repeats are counted from 1.
pub fn trials_table(results: &ExperimentResults) -> Table {
    const FIELDS: [&str; 17] = [
        "array",
        "hidden",
        "samples",
        "method",
        "epochs",
        "seed",
        "repeat",
        "z_percent",
        "x_percent",
        "y_percent",
        "z_mm",
        "worst_mm",
        "mean_z_percent",
        "linear_z_percent",
        "bound_z_percent",
        "epochs_run",
        "seconds",
    ];
    let of_cell = |cell: &CellResults| {
        let settings = cell.cell.settings;
        let row = |trial: &Trial| {
            vec![
                settings.source.sensor.scale.to_string().into(),
                settings.hidden.into(),
                settings.source.samples.into(),
                settings.training.method.short_name().into(),
                settings.training.stopping.epochs.into(),
                Cell::Count(trial.seed.0),
                (trial.repeat + 1).into(),
                trial.errors.z_percent.into(),
                trial.errors.x_percent.into(),
                trial.errors.y_percent.into(),
                trial.errors.z_mm.into(),
                trial.errors.worst_mm.into(),
                trial.baselines.mean.z_percent.into(),
                trial.baselines.linear.z_percent.into(),
                trial.bottleneck.z_percent.into(),
                trial.epochs.into(),
                trial.seconds.into(),
            ]
        };
        cell.trials.iter().map(row).collect::<Vec<_>>()
    };
    Table {
        columns: FIELDS.map(TableColumn::field).to_vec(),
        rows: results.cells.iter().flat_map(of_cell).collect(),
    }
}

/// Writes table and verdicts as Markdown under `title`, with `conditions` between.
///
/// # Errors
/// Any error of `writer`.
pub fn write_experiment_markdown(
    title: &str,
    conditions: &str,
    results: &ExperimentResults,
    verdicts: &[Verdict],
    writer: &mut dyn Write,
) -> io::Result<()> {
    let table = ExperimentTable::new(results).table().text(TableForm::Markdown);
    writeln!(writer, "## {title}\n\n{conditions}\n\n{table}")?;
    writeln!(writer, "{}\n", ExperimentTable::NOTE)?;
    for Verdict {
        claim,
        standing,
        finding,
    } in verdicts
    {
        writeln!(writer, "* {claim}: **{standing}**. {finding}")?;
    }
    Ok(())
}
