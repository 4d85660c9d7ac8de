use std::{
    io::{self, Write},
    time::Duration,
};

use super::{format_duration, format_number};
use crate::evaluation::experiments::{CellResults, CellSummary, ExperimentResults, Figure, Verdict};

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
                "training",
                seconds,
                time.map_or_else(|| format_number(None), format_duration),
            ),
        ]);
        figures
    }

    /// Explanation of the last columns, to be shown below the table.
    pub const NOTE: &'static str = "Medians, least and largest over seeds (and repeats). mean: always answering the \
         training mean; linear: best affine map on resistance; bound: what so few hidden nodes can carry, the \
         least-squares best answer of any network with them; epochs: mean of the starts; training: one network, all \
         its starts.";
}

/// Writes the figures of every cell as CSV. Numbers are written so that reading gives the same bits; where there is
/// none the field is empty.
///
/// # Errors
/// Any error of `writer`.
pub fn write_cells(results: &ExperimentResults, writer: &mut dyn Write) -> io::Result<()> {
    write!(writer, "array,hidden,samples,method,epochs,starts,trials")?;
    for axis in ["z", "x", "y"] {
        for figure in ["published", "median", "min", "max"] {
            write!(writer, ",{axis}_percent_{figure}")?;
        }
    }
    writeln!(
        writer,
        ",mean_z_percent,linear_z_percent,bound_z_percent,epochs_run,training_seconds,epoch_ms"
    )?;
    for summary in results.summaries() {
        write!(
            writer,
            "{},{},{},{},{},{},{}",
            summary.array,
            summary.hidden,
            summary.samples,
            summary.method,
            summary.epochs,
            summary.starts,
            summary.trials
        )?;
        for figure in [&summary.z_percent, &summary.x_percent, &summary.y_percent] {
            let Figure {
                published,
                median,
                min,
                max,
                ..
            } = *figure;
            write_fields([published, median, min, max], writer)?;
        }
        let rest = [
            summary.mean_z_percent,
            summary.linear_z_percent,
            summary.bound_z_percent,
            summary.epochs_run,
            summary.training_seconds,
            summary.epoch_ms,
        ];
        write_fields(rest, writer)?;
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes every trial as CSV, in the manner of [`write_cells`]; repeats are counted from 1.
///
/// # Errors
/// Any error of `writer`.
pub fn write_trials(results: &ExperimentResults, writer: &mut dyn Write) -> io::Result<()> {
    writeln!(
        writer,
        "array,hidden,samples,method,epochs,seed,repeat,z_percent,x_percent,y_percent,z_mm,worst_mm,mean_z_percent,\
         linear_z_percent,bound_z_percent,epochs_run,seconds"
    )?;
    for cell in &results.cells {
        let settings = &cell.cell.settings;
        let training = &settings.training;
        let method = training.method.short_name();
        for trial in &cell.trials {
            write!(
                writer,
                "{},{},{},{method},{},{},{}",
                settings.source.sensor.scale,
                settings.hidden,
                settings.source.samples,
                training.stopping.epochs,
                trial.seed,
                trial.repeat + 1
            )?;
            let figures = [
                trial.errors.z_percent,
                trial.errors.x_percent,
                trial.errors.y_percent,
                Some(trial.errors.z_mm),
                Some(trial.errors.worst_mm),
                trial.baselines.mean.z_percent,
                trial.baselines.linear.z_percent,
                trial.bottleneck.z_percent,
            ];
            write_fields(figures, writer)?;
            writeln!(writer, ",{},{:?}", trial.epochs, trial.seconds)?;
        }
    }
    Ok(())
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
    let table = ExperimentTable::new(results);
    writeln!(writer, "## {title}\n\n{conditions}\n")?;
    writeln!(writer, "| {} |", table.headings.join(" | "))?;
    writeln!(writer, "|{}", "---:|".repeat(table.headings.len()))?;
    for row in &table.rows {
        writeln!(writer, "| {} |", row.join(" | "))?;
    }
    writeln!(writer, "\n{}\n", ExperimentTable::NOTE)?;
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

fn write_fields<const N: usize>(values: [Option<f64>; N], writer: &mut dyn Write) -> io::Result<()> {
    for value in values {
        match value {
            Some(value) => write!(writer, ",{value:?}")?,
            None => write!(writer, ",")?,
        }
    }
    Ok(())
}
