use std::{
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    failure::Failure,
    output::{print, print_object},
};
use crate::{
    evaluation::{
        CrossValidation,
        experiments::{CellSummary, ExperimentResults, PaperTable, Verdict},
    },
    export::{
        Cell, ExperimentTable, Table, describe_conditions, describe_failures, describe_worse_than_mean, format_duration,
    },
    sensor::Geometry,
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
    cells: Vec<CellSummary>,
    failures: Vec<String>,
    /// Cells with networks that are worse than the training mean.
    remarks: Vec<String>,
    verdicts: &'a [Verdict],
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
            cells: results.summaries(),
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
        let rows = table
            .rows
            .into_iter()
            .map(|row| row.into_iter().map(Cell::from).collect());
        writeln!(out, "{}", Table::of_headings(table.headings, rows).aligned())?;
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
    writeln!(out, "{}", ExperimentTable::NOTE)?;
    writeln!(out, "{}", Geometry::ASSUMPTION)?;
    writeln!(out, "Took {}", format_duration(took))
}
