use std::{
    collections::BTreeSet,
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    failure::Failure,
    output::{print, print_object},
};
use decoupler_core::{
    dataset::Seed,
    evaluation::{
        CrossValidation,
        experiments::{CellSummary, ExperimentResults, Figure, PaperTable, SummaryErrors, Verdict},
    },
    sensor::{ArrayScale, Geometry},
};
use decoupler_files::export::{
    Cell, ExperimentTable, Table, describe_conditions, describe_failures, describe_worse_than_mean, format_duration,
};

/// A reproduced table of the paper.
pub(super) struct Reproduced {
    pub(super) table: PaperTable,
    pub(super) results: ExperimentResults,
    pub(super) verdicts: Vec<Verdict>,
}

/// The object printed by `reproduce --json`.
#[derive(Serialize)]
struct Report<'a> {
    seconds: f64,
    is_complete: bool,
    tables: Vec<TableReport<'a>>,
}

#[derive(Serialize)]
struct TableReport<'a> {
    table: u8,
    title: &'static str,
    conditions: String,
    seeds: usize,
    cross_validation: Option<CrossValidation>,
    is_complete: bool,
    cells: Vec<CellReport>,
    failures: Vec<String>,
    /// Cells with networks that are worse than the training mean.
    remarks: Vec<String>,
    verdicts: &'a [Verdict],
}

/// Figures of a cell of an array.
#[derive(Serialize)]
struct CellReport {
    array: ArrayScale,
    hidden: usize,
    samples: usize,
    method: &'static str,
    epochs: usize,
    starts: usize,
    seed: Seed,
    trials: usize,
    expected_trials: usize,
    z_percent: Figure,
    x_percent: Figure,
    y_percent: Figure,
    z_mm: Figure,
    mean_z_percent: Option<f64>,
    linear_z_percent: Option<f64>,
    bound_z_percent: Option<f64>,
    epochs_run: Option<f64>,
    training_seconds: Option<f64>,
    epoch_ms: Option<f64>,
}

impl CellReport {
    /// `None` for a recording, which no table of the paper has.
    fn of(summary: CellSummary) -> Option<Self> {
        let SummaryErrors::Nodes {
            x_percent,
            y_percent,
            z_mm,
        } = summary.errors
        else {
            return None;
        };
        Some(Self {
            array: summary.array?,
            hidden: summary.hidden,
            samples: summary.samples?,
            method: summary.method,
            epochs: summary.epochs,
            starts: summary.starts,
            seed: summary.seed,
            trials: summary.trials,
            expected_trials: summary.expected_trials,
            z_percent: summary.percent,
            x_percent,
            y_percent,
            z_mm,
            mean_z_percent: summary.mean_percent,
            linear_z_percent: summary.linear_percent,
            bound_z_percent: summary.bound_percent,
            epochs_run: summary.epochs_run,
            training_seconds: summary.training_seconds,
            epoch_ms: summary.epoch_ms,
        })
    }
}

/// Prints one JSON object.
pub(super) fn print_json(reproduced: &[Reproduced], took: Duration) -> Result<(), Failure> {
    let table = |reproduced| {
        let Reproduced {
            table,
            results,
            verdicts,
        }: &Reproduced = reproduced;
        TableReport {
            table: table.number(),
            title: table.title(),
            conditions: describe_conditions(&results.experiment),
            seeds: results.experiment.seeds,
            cross_validation: results.experiment.cross_validation,
            is_complete: results.is_complete(),
            cells: results.summaries().into_iter().filter_map(CellReport::of).collect(),
            failures: describe_failures(results),
            remarks: describe_worse_than_mean(results),
            verdicts,
        }
    };
    let report = Report {
        seconds: took.as_secs_f64(),
        is_complete: reproduced.iter().all(|table| table.results.is_complete()),
        tables: reproduced.iter().map(table).collect(),
    };
    print_object(&report)
}

/// Prints each table with its conditions and verdicts.
pub(super) fn print_text(reproduced: &[Reproduced], took: Duration) -> Result<(), Failure> {
    print(|output| write_text(reproduced, took, output))
}

fn write_text(reproduced: &[Reproduced], took: Duration, out: &mut impl Write) -> io::Result<()> {
    let mut notes = BTreeSet::new();
    for Reproduced {
        table,
        results,
        verdicts,
    } in reproduced
    {
        writeln!(
            out,
            "{}\n{}\n",
            table.heading(),
            describe_conditions(&results.experiment)
        )?;
        let table = ExperimentTable::new(results);
        let headings = table.columns.iter().map(|column| column.heading);
        let rows = table
            .rows
            .iter()
            .map(|row| row.iter().map(|text| Cell::from(text.as_str())).collect());
        writeln!(out, "{}", Table::of_headings(headings, rows).aligned())?;
        notes.insert(table.note);
        for Verdict {
            claim,
            standing,
            finding,
        } in verdicts
        {
            writeln!(out, "{claim}: {standing}. {finding}")?;
        }
        for failure in describe_failures(results) {
            writeln!(out, "{failure}")?;
        }
        for remark in describe_worse_than_mean(results) {
            writeln!(out, "Warning: {remark}")?;
        }
        writeln!(out)?;
    }
    for note in notes {
        writeln!(out, "{note}")?;
    }
    writeln!(out, "{}", Geometry::ASSUMPTION)?;
    writeln!(out, "Took {}", format_duration(took))
}
