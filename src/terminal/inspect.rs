use std::{
    io::{self, Write},
    path::Path,
};

use clap::Args;
use serde::Serialize;

use super::{
    failure::Failure,
    findings::StudyArguments,
    import_arguments::ImportArguments,
    output::{print, print_object},
    samples::with_bar,
};
use decoupler_core::text::counted;
use decoupler_files::{
    export::{Cell, Table, TableColumn, format_number},
    import::{ColumnKind, ColumnSummary, Dialect, Inspection, TimeSummary},
};

/// List the columns of a recording, and measure how well its readings determine targets
///
/// Reads CSV, .npy, .npz and .mat. Each column has its name, unit, kind, range, number of missing cells and a histogram over
/// its range. The names are those that train --data takes. With --inputs and --targets (or --recipe), and with the arguments
/// of train --data, it measures on held-out samples how well the readings determine each target, how optimistic a random split
/// would be, what each channel is worth and what more samples would bring, with confidence intervals.
#[derive(Args)]
pub(super) struct Inspect {
    #[command(flatten)]
    import: ImportArguments,
    #[command(flatten)]
    study: StudyArguments,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    file: &'a Path,
    format: String,
    dialect: Option<&'a Dialect>,
    #[serde(flatten)]
    inspection: &'a Inspection,
}

impl Inspect {
    pub(super) fn run(self) -> Result<(), Failure> {
        if self.study.are_given() || self.import.has_meanings() {
            return self.study.run(&self.import, self.json);
        }
        let data = self.import.only_file()?;
        let (inspection, table) = with_bar(self.json, |watch| {
            Inspection::read(data, self.import.dialect.choice(), self.import.time.as_deref(), watch)
        })?;
        if self.json {
            return print_object(&Report {
                file: data,
                format: table.format.to_string(),
                dialect: table.dialect(),
                inspection: &inspection,
            });
        }
        print(|out| {
            writeln!(
                out,
                "{}: {} × {}",
                data.display(),
                counted(inspection.rows, "row"),
                counted(inspection.columns.len(), "column")
            )?;
            writeln!(out, "{}\n", table.format)?;
            write!(out, "{}", columns_table(&inspection.columns).aligned())?;
            if let Some(time) = &inspection.time {
                write_time(time, out)?;
            }
            inspection
                .warnings
                .iter()
                .try_for_each(|warning| writeln!(out, "Warning: {warning}"))
        })
    }
}

/// The table of the columns of a file.
fn columns_table(columns: &[ColumnSummary]) -> Table {
    let row = |column: &ColumnSummary| -> Vec<Cell> {
        let kind = match column.kind {
            ColumnKind::Number => "number",
            ColumnKind::Integer => "integer",
            ColumnKind::Text => "text",
            ColumnKind::Empty => "empty",
        };
        let number = |number: Option<f64>| number.map_or("–".to_owned(), plain);
        let notes = [
            column.is_constant.then(|| "constant".to_owned()),
            column.duplicate_of.as_ref().map(|other| format!("the same as {other}")),
            column.first_text.as_ref().map(|(line, text)| {
                format!(
                    "{} cells are not numbers, the first is '{text}' on line {line}",
                    column.texts
                )
            }),
        ];
        vec![
            column.name.as_str().into(),
            column.unit.as_deref().unwrap_or("").into(),
            kind.into(),
            number(column.min).into(),
            number(column.max).into(),
            column.missing.into(),
            bars(&column.histogram).into(),
            Vec::from_iter(notes.into_iter().flatten()).join("; ").into(),
        ]
    };
    let names = ["column", "unit", "kind", "min", "max", "missing", "histogram", ""];
    Table {
        columns: names.map(TableColumn::field).into(),
        rows: columns.iter().map(row).collect(),
    }
}

/// A number as short as it can be within 13 characters.
fn plain(number: f64) -> String {
    let short = format!("{number}");
    if short.len() <= 13 {
        short
    } else {
        format!("{number:.6e}")
    }
}

fn bars(histogram: &[usize]) -> String {
    const HEIGHTS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = histogram.iter().copied().max().unwrap_or(0).max(1);
    // What is there at all is seen.
    let height = |&count: &usize| (count * (HEIGHTS.len() - 1)).div_ceil(most);
    histogram.iter().map(|count| HEIGHTS[height(count)]).collect()
}

fn write_time(time: &TimeSummary, out: &mut impl Write) -> io::Result<()> {
    let guessed = if time.is_guessed { " (taken for the time)" } else { "" };
    write!(out, "\nTime {}{guessed}: ", time.column)?;
    match time.median_interval {
        Some(median) => write!(
            out,
            "median interval {}, {} gaps of more than 5 times that",
            format_number(median),
            time.gaps
        )?,
        None => write!(out, "no two times differ")?,
    }
    if let (Some(longest), Some(line)) = (time.longest, time.longest_after_line) {
        write!(out, ", the longest {} after line {line}", format_number(longest))?;
    }
    if time.backwards > 0 {
        write!(out, "; it runs backwards {} times", time.backwards)?;
    }
    writeln!(out)
}
