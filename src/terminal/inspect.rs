//! Inspection of the files of a recording, and the division of their samples.

use std::{
    io::{self, Write},
    iter::once,
    path::{Path, PathBuf},
};

use clap::Args;
use decoupler_core::{
    dataset::Dataset,
    evaluation::RunSets,
    problem::{Channel, TargetPosition},
    text::counted,
};
use decoupler_files::{
    export::{Cell, Table, TableColumn, describe_positions, format_number},
    import::{
        ColumnKind, ColumnSummary, Dialect, Dropped, FileReport, Inspection, JoinReport, Recording, Recordings,
        TimeSummary,
    },
};
use serde::Serialize;

use super::{
    failure::Failure,
    findings::StudyArguments,
    import_arguments::ImportArguments,
    output::{print, print_object},
    samples::with_bar,
};

/// List the columns of a recording, and measure how well its readings determine targets
///
/// Reads CSV, Excel, .npy, .npz and .mat. Each column has its name, unit, kind, range, number of missing cells and a histogram
/// over its range. The names are those that train --data takes. With --inputs and --targets (or --recipe), and with the
/// arguments of train --data, it measures on held-out samples how well the readings determine each target, by ridge and kernel
/// ridge regression and with confidence intervals, how optimistic a random split would be, and what may be a leak.
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
    dialect: Option<Dialect>,
    #[serde(flatten)]
    inspection: Inspection,
}

impl Inspect {
    pub(super) fn run(self) -> Result<(), Failure> {
        if self.study.are_given() || self.import.has_roles() {
            return self.study.run(&self.import, self.json);
        }
        let files = self.import.only_files()?;
        let mut reports = Vec::new();
        for file in &files {
            let (inspection, table) = with_bar(self.json, |watch| {
                Inspection::read(file, self.import.dialect.choice(), self.import.time.as_deref(), watch)
            })?;
            reports.push(Report {
                file,
                format: table.format.to_string(),
                dialect: table.dialect().copied(),
                inspection,
            });
        }
        match &reports[..] {
            [report] if self.json => print_object(report),
            reports if self.json => print_object(&Reports { files: reports }),
            reports => print(|out| {
                for (number, report) in reports.iter().enumerate() {
                    if number > 0 {
                        writeln!(out)?;
                    }
                    report.write(out)?;
                }
                Ok(())
            }),
        }
    }
}

/// Reports on several files, as JSON.
#[derive(Serialize)]
struct Reports<'a> {
    files: &'a [Report<'a>],
}

impl Report<'_> {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let inspection = &self.inspection;
        writeln!(
            out,
            "{}: {} × {}",
            self.file.display(),
            counted(inspection.rows, "row"),
            counted(inspection.columns.len(), "column")
        )?;
        writeln!(out, "{}\n", self.format)?;
        write!(out, "{}", columns_table(&inspection.columns).aligned())?;
        if let Some(time) = &inspection.time {
            write_time(time, out)?;
        }
        let mut warnings = inspection.warnings.iter();
        warnings.try_for_each(|warning| writeln!(out, "Warning: {warning}"))
    }
}

/// Table of the columns of a file.
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
            column
                .original
                .as_deref()
                .map(|original| format!("in the file: {}", beginning(original))),
            column.is_constant.then(|| "constant".to_owned()),
            column.is_rounding.then(|| "constant except for rounding".to_owned()),
            column
                .sentinel
                .map(|found| format!("{} × {}: none?", found.cells, found.value)),
            column.duplicate_of.as_ref().map(|other| format!("the same as {other}")),
            column.first_text.as_ref().map(|(line, text)| {
                format!(
                    "{} not a number, the first is '{text}' on line {line}",
                    counted(column.texts, "cell")
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

/// Returns the first characters of a name.
fn beginning(name: &str) -> String {
    const LONGEST: usize = 60;
    match name.char_indices().nth(LONGEST) {
        None => name.to_owned(),
        Some((end, _)) => format!("{}…", &name[..end]),
    }
}

/// Formats a number as briefly as possible in at most 13 characters.
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
    // A nonzero count is always visible.
    let height = |&count: &usize| (count * (HEIGHTS.len() - 1)).div_ceil(most);
    histogram.iter().map(|count| HEIGHTS[height(count)]).collect()
}

fn write_time(time: &TimeSummary, out: &mut impl Write) -> io::Result<()> {
    let guessed = if time.is_guessed {
        " (assumed to be the time)"
    } else {
        ""
    };
    write!(out, "\nTime {}{guessed}: ", time.column)?;
    match time.median_interval {
        Some(median) => write!(
            out,
            "median interval {}, {} of more than 5 times that",
            format_number(median),
            counted(time.gaps, "gap")
        )?,
        None => write!(out, "all times are equal")?,
    }
    if let (Some(longest), Some(line)) = (time.longest, time.longest_after_line) {
        write!(out, ", the longest {} after line {line}", format_number(longest))?;
    }
    if time.backwards > 0 {
        write!(out, "; it runs backwards {}", counted(time.backwards, "time"))?;
    }
    writeln!(out)
}

/// Samples of a recording.
#[derive(Serialize)]
pub(super) struct RecordingReport {
    files: Vec<FileFound>,
    inputs: Vec<Channel>,
    /// Rule of the split: time, group, random or file.
    split: String,
    test_fraction: f64,
    /// Number of rows of the files, including dropped ones.
    rows: usize,
    /// Number of training samples.
    samples: usize,
    validation_samples: usize,
    test_samples: usize,
    dropped: Vec<Dropped>,
    /// Positions of targets, for those that have one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    positions: Vec<Position>,
    #[serde(skip)]
    positions_text: Option<String>,
}

/// Position of a target on the skin.
#[derive(Serialize)]
struct Position {
    target: String,
    x_mm: f64,
    y_mm: f64,
}

/// A file with its detected format.
#[derive(Serialize)]
pub(super) struct FileFound {
    path: PathBuf,
    format: String,
    rows: usize,
    columns: usize,
    join: Option<JoinReport>,
}

impl RecordingReport {
    pub(super) fn new(sets: &RunSets, recordings: &Recordings) -> Self {
        let plan = &recordings.recorded.plan;
        let all = || once(&recordings.training).chain(&recordings.test);
        let recording = &recordings.training;
        let position = |&TargetPosition { target, x_mm, y_mm }: &TargetPosition| Position {
            target: recording.targets[target].name.clone(),
            x_mm,
            y_mm,
        };
        let samples = sets.split.training.samples();
        let validation_samples = sets.split.validation.as_ref().map_or(0, Dataset::samples);
        let test_samples = sets.test.samples();
        Self {
            files: files(all()),
            inputs: recording.inputs.clone(),
            split: match recordings.test {
                Some(_) => "file".to_owned(),
                None => plan.division.by.to_string(),
            },
            test_fraction: test_samples as f64 / (samples + validation_samples + test_samples) as f64,
            rows: all().map(|recording| recording.rows).sum(),
            samples,
            validation_samples,
            test_samples,
            dropped: all().flat_map(|recording| recording.dropped.iter().cloned()).collect(),
            positions: recording.positions.iter().map(position).collect(),
            positions_text: describe_positions(&recording.positions),
        }
    }

    /// Writes the files, and how their samples are divided.
    pub(super) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        write_files(&self.files, self.rows, &self.dropped, out)?;
        writeln!(
            out,
            "{} for training, {} for validation, {} for testing (split by {})",
            counted(self.samples, "sample"),
            self.validation_samples,
            self.test_samples,
            self.split
        )?;
        self.positions_text.iter().try_for_each(|text| writeln!(out, "{text}"))
    }
}

/// Warnings of the import.
pub(super) fn import_warnings(recordings: &Recordings) -> Vec<String> {
    Recording::warnings_of(once(&recordings.training).chain(&recordings.test))
}

pub(super) fn files<'a>(recordings: impl Iterator<Item = &'a Recording>) -> Vec<FileFound> {
    let found = |report: &FileReport| FileFound {
        path: report.path.clone(),
        format: report.format.to_string(),
        rows: report.rows,
        columns: report.columns,
        join: report.join,
    };
    recordings
        .flat_map(|recording| recording.files.iter().map(found))
        .collect()
}

pub(super) fn write_files(
    files: &[FileFound],
    rows: usize,
    dropped: &[Dropped],
    out: &mut dyn Write,
) -> io::Result<()> {
    for file in files {
        writeln!(
            out,
            "{}: {} × {}, {}",
            file.path.display(),
            counted(file.rows, "row"),
            counted(file.columns, "column"),
            file.format
        )?;
        if let Some(join) = file.join {
            let offset = join.median_offset.map_or_else(String::new, |offset| {
                format!(", median {} apart", format_number(offset.abs()))
            });
            writeln!(
                out,
                "  joined by time within {}{offset}; {} without partner, {} of its rows unused",
                format_number(join.limit),
                counted(join.without_partner, "row"),
                join.unused
            )?;
        }
    }
    for Dropped {
        reason,
        rows: count,
        first_line,
    } in dropped
    {
        writeln!(
            out,
            "{count} of {rows} rows dropped: {reason} (first on line {first_line})"
        )?;
    }
    Ok(())
}

pub(super) fn write_warnings(warnings: &[String], out: &mut dyn Write) -> io::Result<()> {
    warnings
        .iter()
        .try_for_each(|warning| writeln!(out, "Warning: {warning}"))
}
